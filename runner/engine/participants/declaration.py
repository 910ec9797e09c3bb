"""Declaration of an entity in a scenario, and its state while the scenario runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from schemas.common.errors import InvalidFile, Unsupported
from xodr.model import NO_WIDTH, TEMPORARY
from xodr.model.road import lane_in
from xosc.document.node import Node

if TYPE_CHECKING:
    from xodr.model import LaneSection, RoadPoint
    from xodr.model.road import Road


_ROUNDING = 1e-6
"""Distance (m) beyond a lane's border that counts as on it"""


class BoundingBox(NamedTuple):
    """Box of an entity in its own frame: x forward, y left, z up from the reference point (rear
    axle on the ground), m."""

    x: float
    y: float
    z: float
    length: float
    width: float
    height: float


class Performance(NamedTuple):
    """Limits of a vehicle: m/s, m/s² and (jerk) m/s³; infinite where the file gives none."""

    max_speed: float = math.inf
    max_acceleration: float = math.inf
    max_deceleration: float = math.inf
    max_acceleration_rate: float = math.inf
    max_deceleration_rate: float = math.inf


@dataclass(frozen=True, slots=True)
class Declaration:
    """One participant as the scenario describes it; the same throughout every run.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point.
        performance: its limits.
        front_axle: x of the front axle, m (0 where there is none).
        max_steering: greatest angle of the front wheels, rad (0 where it is not known).
        model: its 3D model, or else the name of its kind.
        mass: kg (0 where it is not known).
        role: of a vehicle or pedestrian, e.g. ambulance, civil; empty where the file gives none.
        properties: its Properties by name.
        controllers: the controllers assigned from the beginning: name → properties.
        hitch: x of the hitch that a trailer can be put on, m; None where there is none.
        coupler: x of the coupler by which this vehicle can be towed, m; None where there is none.
        node: the element that describes it, for complaints.
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    performance: Performance = field(default_factory=Performance)
    front_axle: float = 0.0
    max_steering: float = 0.0
    model: str = ""
    mass: float = 0.0
    role: str = ""
    properties: Mapping[str, str] = field(default_factory=dict)
    controllers: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    hitch: float | None = None
    coupler: float | None = None
    node: Node | None = None

    @property
    def front(self) -> float:
        """x of the front end in the own frame, m."""
        return self.box.x + self.box.length / 2

    def invalid(self, message: str) -> InvalidFile:
        """An InvalidFile at the element that describes the participant, to be
        raised by the caller.
        """
        return self.node.invalid(message) if self.node is not None else InvalidFile(message)

    def unsupported(self, message: str) -> Unsupported:
        """An Unsupported at the element that describes the participant, to be
        raised by the caller.
        """
        return self.node.unsupported(message) if self.node is not None else Unsupported(message)


@dataclass(slots=True, eq=False)
class EntityState:
    """State of a participant: existence, place, motion, and visible properties.

    Poses are those of the OpenSCENARIO reference point (vehicles: rear axle centre on the ground),
    in the world frame of the road network: x, y, z in m; h mathematical, pitch, roll in rad.
    `speed` is signed, along the own heading.

    Its *place* (road, s, t, and the lane under the reference point) is one thing, its *intent*
    (`kept_lane`, `kept_offset`) another: in a lane change the intent is the lane bound for, while
    the place is still the old one. Motion reads the intent; outputs, observations, conditions and
    positions read the place (`runner.engine.motion.on_roads.Roads.road_point`). Road coordinates
    are those of OpenDRIVE; they are current only while `on_lane` is true (lane motion) and else
    looked up there.
    """

    active: bool = True
    """whether it exists in the world"""
    placed: bool = False
    """whether it has a position"""
    entered: float | None = None
    """time (s) at which an action has brought it into the world; None where it is there from the
    start"""

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
    turn: float = 0.0
    """velocity (m/s) and acceleration (m/s²) over ground in the world frame, and change of heading
    (rad), in the last step"""
    odometer: float = 0.0
    """distance travelled, m"""
    standstill: float = 0.0
    """time since it last moved, s"""
    settled: int = -1
    """`Run.changes` at the end of a step in which it stood, which has left it as it was"""
    at_road_end: bool = False
    road_end: float = 0.0
    """time since it reached the end of its road, s"""

    on_lane: bool = False
    road: Road | None = None
    section: LaneSection | None = None
    layer: str = TEMPORARY
    """layer of lanes that it keeps to"""
    s: float = 0.0
    t: float = 0.0
    kept_lane: int = 0
    """lane that its motion keeps to"""
    kept_offset: float = 0.0
    """t minus the t of that lane's centre, m"""
    direction: int = 1
    """+1 when the entity faces increasing s, −1 otherwise"""
    heading_offset: float = 0.0
    """heading relative to the lane in the direction it faces, rad"""
    located: RoadPoint | None = None
    """last road point looked up off the lane"""
    located_at: tuple[float, float] | None = None
    """x, y for which it was looked up, m"""

    visible: dict[str, bool] = field(
        default_factory=lambda: {"graphics": True, "sensors": True, "traffic": True}
    )
    lights: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    animations: dict[str, str] = field(default_factory=dict)

    def begin_at(self, speed: float) -> None:
        """Have a speed (m/s) without an acceleration that led to it: nothing is known of the time
        before."""
        self.speed, self.acceleration = speed, 0.0
        self.vx, self.vy = speed * math.cos(self.h), speed * math.sin(self.h)

    def lane_below(self) -> tuple[int, float]:
        """Lane under the reference point and the offset (m, towards +t) from its centre; only while
        `on_lane`.

        On the border of two lanes, the kept one is meant, and on the centre of the kept one,
        however narrow, too.
        """
        if not self.kept_offset:
            return self.kept_lane, self.kept_offset
        assert self.road is not None and self.section is not None
        lane, offset = self.section.lanes[self.kept_lane], self.kept_offset
        width = lane.width.constant
        if width is None:
            width = lane.width(self.s)
        if width > NO_WIDTH and abs(offset) <= 0.5 * width + _ROUNDING:
            return self.kept_lane, offset
        below = lane_in(self.section, self.s, self.t)
        return below, self.t - self.section.lanes[below].center(self.s)
