"""Participants: what the scenario declares about them and the state they are in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from runner.participants.declaration import BoundingBox, Performance
from schemas.errors import InvalidFile, Unsupported

if TYPE_CHECKING:
    from runner.interpreter.elements import Process
    from runner.motion.lane import Motion
    from xodr.model import LaneSection, RoadPoint
    from xodr.road import Road
    from xosc.node import Node


@dataclass(slots=True, eq=False)
class Entity:
    """One participant.

    Poses are those of the OpenSCENARIO reference point (vehicles: rear axle centre on the ground), in the
    world frame of the road network: x, y, z in m; h mathematical, pitch, roll in rad. `speed` is signed,
    along the own heading. Road coordinates are those of OpenDRIVE; they are current only while `on_lane`
    is true (lane motion) and otherwise looked up by `Simulation.road_point`.
    """

    name: str
    kind: str
    """vehicle, pedestrian or miscellaneous"""
    category: str
    box: BoundingBox
    performance: Performance = field(default_factory=Performance)
    front_axle: float = 0.0
    """x of the front axle, m (0 where there is none)"""
    max_steering: float = 0.0
    """greatest angle of the front wheels, rad (0 where it is not known)"""
    model: str = ""
    mass: float = 0.0
    properties: dict[str, str] = field(default_factory=dict)
    node: Node | None = None
    """the element that describes it, for complaints"""

    # existence and appearance
    active: bool = True
    visible: dict[str, bool] = field(default_factory=lambda: {"graphics": True, "sensors": True, "traffic": True})
    placed: bool = False

    # state
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    h: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    speed: float = 0.0
    acceleration: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    """velocity (m/s) and acceleration (m/s²) over ground in the world frame"""
    odometer: float = 0.0
    standstill: float = 0.0
    """time since it last moved, s"""
    at_road_end: bool = False
    road_end: float = 0.0
    """time since it reached the end of its road, s"""

    # road coordinates and lane motion
    on_lane: bool = False
    road: Road | None = None
    section: LaneSection | None = None
    lane: int = 0
    s: float = 0.0
    t: float = 0.0
    offset: float = 0.0
    """t minus the t of the lane's centre, m"""
    along: int = 1
    """+1 when the entity faces increasing s, −1 otherwise"""
    heading_offset: float = 0.0
    """heading relative to the lane in the direction it faces, rad"""

    located: RoadPoint | None = None
    """last road point looked up off the lane, and where that was"""
    located_at: tuple[float, float] | None = None

    # control
    motion: Motion = None  # type: ignore[assignment]
    demand: float = 0.0
    """speed that the scenario asks for at the end of this step, m/s"""
    next_offset: float | None = None
    """lane offset that the running lateral action asks for at the end of this step, m"""
    path_compensated: bool = True
    """whether lateral motion is taken out of the distance travelled (lane change) or added to it (lane offset)"""
    controls: dict[str, Process] = field(default_factory=dict)
    """control domain → the process that owns it"""
    route: Any = None
    controllers: dict[str, Any] = field(default_factory=dict)
    system: Any = None
    """the system under test that drives this entity, if any"""
    driven: bool = False
    """whether the simulator's own driver moves it"""
    spawned: bool = False
    """whether a traffic action has brought it in"""
    overrides: dict[str, float] = field(default_factory=dict)
    """controller inputs that OverrideControllerValueAction holds"""
    lights: dict[str, str] = field(default_factory=dict)
    animations: dict[str, str] = field(default_factory=dict)
    hitch: float | None = None
    """x of the hitch that a trailer can be put on, m; None where there is none"""
    coupler: float | None = None
    """x of the coupler by which this vehicle can be towed, m; None where there is none"""
    trailer: Entity | None = None
    tractor: Entity | None = None

    def __repr__(self) -> str:
        return f"<{self.kind} {self.name}>"

    def invalid(self, message: str) -> InvalidFile:
        """An InvalidFile at the element that describes this entity, to be raised by the caller."""
        return self.node.invalid(message) if self.node is not None else InvalidFile(message)

    def unsupported(self, message: str) -> Unsupported:
        """An Unsupported at the element that describes this entity, to be raised by the caller."""
        return self.node.unsupported(message) if self.node is not None else Unsupported(message)

    @property
    def front(self) -> float:
        """x of the front end in the own frame, m."""
        return self.box.x + self.box.length / 2


class Entities(dict[str, Entity]):
    """All declared entities by name, in document order."""

    def present(self) -> Iterator[Entity]:
        """Those that exist in the world now."""
        return (entity for entity in self.values() if entity.active)
