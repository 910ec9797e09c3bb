"""The state of a participant: what changes about it while a scenario runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from xodr.model import TEMPORARY

if TYPE_CHECKING:
    from xodr.model import LaneSection, RoadPoint
    from xodr.road import Road


@dataclass(slots=True, eq=False)
class EntityState:
    """Whether a participant exists, where it is, how it moves, and what can be seen of it.

    Poses are those of the OpenSCENARIO reference point (vehicles: rear axle centre on the ground), in the world frame of the
    road network: x, y, z in m; h mathematical, pitch, roll in rad. `speed` is signed, along the own heading. Road
    coordinates are those of OpenDRIVE; they are current only while `on_lane` is true (lane motion) and otherwise looked up by
    `runner.motion.on_roads.Roads.road_point`.
    """

    active: bool = True
    """whether it exists in the world"""
    placed: bool = False
    """whether it has a position"""
    entered: float | None = None
    """time (s) at which an action has brought it into the world; None where it is there from the start"""

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
    """distance travelled, m"""
    milestone: float = math.inf
    """awaited odometer reading (m): the run counts a change when it is reached (`Run.changes`)"""
    standstill: float = 0.0
    """time since it last moved, s"""
    patience: float = math.inf
    """awaited standstill time (s), likewise"""
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
    lane: int = 0
    s: float = 0.0
    t: float = 0.0
    offset: float = 0.0
    """t minus the t of the lane's centre, m"""
    direction: int = 1
    """+1 when the entity faces increasing s, −1 otherwise"""
    heading_offset: float = 0.0
    """heading relative to the lane in the direction it faces, rad"""
    located: RoadPoint | None = None
    """last road point looked up off the lane"""
    located_at: tuple[float, float] | None = None
    """x, y for which it was looked up, m"""

    visible: dict[str, bool] = field(default_factory=lambda: {"graphics": True, "sensors": True, "traffic": True})
    lights: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    animations: dict[str, str] = field(default_factory=dict)
