"""State of an entity in many runs at once: the arrays of `EntityState`, and single runs of them as
entities."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from runner.engine.participants.entity import STRAIGHT_AHEAD, Controls, Entity
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.model.geometry import Arc, Line

if TYPE_CHECKING:
    from runner.engine.participants.entity import Motion

_FLOATS = (
    "x", "y", "z", "h", "pitch", "roll", "speed", "acceleration", "vx", "vy", "ax", "ay", "turn",
    "odometer", "standstill", "road_end", "s", "t", "kept_offset", "heading_offset",
)  # fmt: skip
_FLAGS = ("placed", "at_road_end", "on_lane")
_WHOLE = ("kept_lane", "direction")
_COPIED = (*_FLOATS, *_FLAGS, *_WHOLE)
_MOVING = (
    "speed", "acceleration", "vx", "vy", "ax", "ay", "turn", "odometer", "standstill",
    "target_speed", "path_compensated", "activated", "route", "easing", "guided", "eased",
)  # fmt: skip
"""State that an entity keeps when it is put somewhere"""


class RunRows:
    """State in many runs: the arrays among the attributes have an entry for each run."""

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        for name, values in vars(self).items():
            if type(values) is np.ndarray and len(values) == len(kept):
                setattr(self, name, values[kept])


class LastLoaded:
    """Entity and run that were loaded last of those of all runs.

    Attributes:
        name: of the entity; empty for none.
        row: of the run.
        count: how many were loaded.
    """

    name = ""
    row: Any = 0
    count = 0


class EntityRows(RunRows):
    """An entity in n runs: arrays (n,) with the names, units and frames of `EntityState` and
    `Controls`.

    A run in which something rare happens to it is a step of the interpreter: `load` makes the
    entity what it is there, `store` takes it back.

    Args:
        entity: of the compiled scenario.
        n: number of runs.
        lane_motion: along lanes; None without roads.
        loaded: shared by all entities.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray
    pitch: FloatArray
    roll: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    vx: FloatArray
    vy: FloatArray
    ax: FloatArray
    ay: FloatArray
    turn: FloatArray
    odometer: FloatArray
    standstill: FloatArray
    road_end: FloatArray
    s: FloatArray
    t: FloatArray
    kept_offset: FloatArray
    heading_offset: FloatArray
    kept_lane: IntArray
    direction: IntArray
    placed: BoolArray
    at_road_end: BoolArray
    on_lane: BoolArray

    def __init__(
        self, entity: Entity, n: int, lane_motion: Motion | None, loaded: LastLoaded
    ) -> None:
        self._loaded = loaded
        self.entity, self.name, self.box, self.reach = entity, entity.name, entity.box, entity.reach
        self.declared = entity.declared
        self._lane_motion = lane_motion
        self.driver: Any = None
        """driver of the entity for a system under test"""
        for name in _FLOATS:
            setattr(self, name, np.zeros(n))
        for name in _FLAGS:
            setattr(self, name, np.zeros(n, bool))
        self.kept_lane, self.direction = np.zeros(n, np.int64), np.ones(n, np.int64)
        self.target_speed = np.zeros(n)
        self.target_offset = np.full(n, np.nan)
        """lane offset that is asked for (m); NaN for none"""
        self.path_compensated = np.ones(n, bool)
        self.owners: dict[str, IntArray] = {}
        """number of the process that owns a control domain, −1 for none, by domain"""
        self.road = np.full(n, None, object)
        self.route, self.easing = np.full(n, None, object), np.full(n, None, object)
        self.guided, self.eased = np.zeros(n, bool), np.zeros(n, bool)
        """where there is a route, and a way back into a lane: quickly looked at"""
        self.motion = np.full(n, None, object)
        """ways of moving that are neither along a lane nor straight ahead, as along a path"""
        self.section = np.full(n, None, object)
        self.edge_right, self.edge_left = np.full(n, np.nan), np.full(n, np.nan)
        """t of the edges of the road (m) where these and the lanes between stay; NaN elsewhere"""
        self.road_key, self.section_key = np.zeros(n, np.int64), np.zeros(n, np.int64)
        """identities of road and lane section, 0 off lanes: quickly compared"""
        self.activated = np.zeros(n, bool)
        self.layer = np.full(n, entity.layer, object)
        self._layers: dict[Any, int] = {entity.layer: 0}
        self.layer_number = np.zeros(n, np.int64)
        """equal where layers are: quickly compared"""
        self.width = np.full(n, np.nan)
        """width of the kept lane (m) where it is constant; NaN elsewhere"""
        self.gliding = np.zeros(n, bool)
        """whether the entity is on one line or arc of a level road, on a lane of constant t"""
        self.straight = np.zeros(n, bool)
        """where its road is straight"""
        self.low, self.high = np.zeros(n), np.zeros(n)
        """least s of that stretch, and the s of its end, m"""
        self.start_s, self.start_x, self.start_y, self.start_h = (np.zeros(n) for _ in range(4))
        """start of the line or arc"""
        self.start_cos, self.start_sin, self.curvature = (np.zeros(n) for _ in range(3))
        self.center = np.zeros(n)
        """t of the kept lane's centre, m"""

    def take(self, kept: BoolArray) -> None:
        """Keep some runs only."""
        super().take(kept)
        self.owners = {domain: values[kept] for domain, values in self.owners.items()}

    def load(self, row: Any) -> Entity:
        """The entity of the compiled scenario, as it is in a run."""
        entity = self.entity
        loaded = self._loaded
        loaded.name, loaded.row, loaded.count = self.name, row, loaded.count + 1
        for name in _COPIED:
            setattr(entity, name, getattr(self, name)[row].item())
        entity.road, entity.section, entity.layer = (
            self.road[row],
            self.section[row],
            self.layer[row],
        )
        offset = self.target_offset[row]
        entity.controls = controls = Controls(
            route=self.route[row],
            easing=self.easing[row],
            target_speed=float(self.target_speed[row]),
            target_offset=None if np.isnan(offset) else float(offset),
            path_compensated=bool(self.path_compensated[row]),
            activated=bool(self.activated[row]),
            driver=self.driver,
        )
        for domain, owners in self.owners.items():
            if owners[row] >= 0:
                controls.owners[domain] = None  # type: ignore[assignment]
        motion = self._lane_motion if entity.on_lane else None
        controls.motion = self.motion[row] or motion or STRAIGHT_AHEAD
        entity.located = entity.located_at = None
        return entity

    def store(self, row: Any, entity: Entity) -> None:
        """Take back what a run has made of the entity."""
        for name in _COPIED:
            getattr(self, name)[row] = getattr(entity, name)
        controls = entity.controls
        self.road[row], self.section[row], self.layer[row] = (
            entity.road,
            entity.section,
            entity.layer,
        )
        self.layer_number[row] = self._layers.setdefault(entity.layer, len(self._layers))
        self.route[row], self.easing[row] = controls.route, controls.easing
        self.guided[row], self.eased[row] = (
            controls.route is not None,
            controls.easing is not None,
        )
        self.target_speed[row] = controls.target_speed
        usual = controls.motion is STRAIGHT_AHEAD or controls.motion is self._lane_motion
        self.motion[row] = None if usual else controls.motion
        offset = controls.target_offset
        self.target_offset[row] = np.nan if offset is None else offset
        self.path_compensated[row] = controls.path_compensated
        self._survey(row, entity)

    def copy(self, row: int, rows: BoolArray) -> None:
        """Make the place in some runs that in one of them."""
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray) and name not in _MOVING:
                values[rows] = values[row]

    def on_stretch(self, s: FloatArray, aside: FloatArray) -> tuple[FloatArray, ...]:
        """x, y (m) and the heading of the road (rad) at s and t on the line or arc of each run
        (n,)."""
        along, cos, sin = s - self.start_s, self.start_cos, self.start_sin
        x = self.start_x + along * cos - aside * sin
        y = self.start_y + along * sin + aside * cos
        if not self.curvature.any():
            return x, y, self.start_h
        half = 0.5 * self.curvature * along
        chord = np.divide(along * np.sin(half), half, out=along.copy(), where=half != 0.0)
        middle = self.start_h + half
        h = middle + half
        arc = (
            self.start_x + chord * np.cos(middle) - aside * np.sin(h),
            self.start_y + chord * np.sin(middle) + aside * np.cos(h),
            h,
        )
        bent = self.curvature != 0.0
        line = x, y, self.start_h
        return tuple(np.where(bent, *pair) for pair in zip(arc, line, strict=True))

    def spread(self, row: int, rows: BoolArray, s: FloatArray) -> BoolArray:
        """Put the entity in some runs where one of them has it, but at other s on its line or arc.

        Args:
            row: the run that has it.
            rows: the runs (n,).
            s: of each run (n,), m; NaN where the place differs in more than that.

        Returns:
            The runs in which it is there now; the stretch has no such s in the others.
        """
        held: BoolArray = rows & (self.low[row] <= s) & (s < self.high[row])
        if not self.gliding[row] or self.motion[row] is not None or s[row] != self.s[row]:
            return np.zeros_like(rows)
        self.copy(row, held)
        self.s[held] = s[held]
        x, y, h = self.on_stretch(self.s, self.t)
        self.x[held], self.y[held] = x[held], y[held]
        if self.curvature[row]:
            turned = self.h[row] + h[held] - h[row]
            self.h[held] = turned - math.tau * np.round(turned / math.tau)
        return held

    def alike(self, row: int, rows: BoolArray) -> BoolArray:
        """Runs in which the entity glides in the same lane and direction as in one of them, within
        the lane."""
        found: BoolArray = rows & self.gliding & (self.section_key == self.section_key[row])
        found &= (self.kept_lane == self.kept_lane[row]) & (self.direction == self.direction[row])
        found &= self.layer_number == self.layer_number[row]
        found &= np.abs(self.kept_offset) <= 0.5 * self.width
        return found & self.unled & ~np.isnan(self.edge_left)

    @property
    def unled(self) -> BoolArray:
        """Runs in which no route and no way back into a lane leads it (n,)."""
        return ~(self.guided | self.eased)

    def change_lane(self, row: int, rows: BoolArray) -> None:
        """Express the place in some runs, that were `alike`, in the lane that one of them keeps to
        now."""
        if (self.kept_lane[rows] == self.kept_lane[row]).all():
            return
        for name in ("kept_lane", "center", "width"):
            values = getattr(self, name)
            values[rows] = values[row]
        self.kept_offset[rows] = self.t[rows] - self.center[row]

    def _survey(self, row: Any, entity: Entity) -> None:
        """Find the stretch of its lane along which the entity moves by one formula."""
        self.gliding[row] = False
        road, section = entity.road, entity.section
        if not entity.on_lane or road is None or section is None:
            self.width[row], self.road_key[row], self.section_key[row] = np.nan, 0, 0
            return
        if self.section_key[row] != id(section):
            known = all(
                lane.outer.constant is not None and (not lane.id or lane.type != "none")
                for lane in section.lanes.values()
            )
            self.edge_right[row], self.edge_left[row] = (
                road.edges(entity.s) if known else (np.nan, np.nan)
            )
        self.road_key[row], self.section_key[row] = id(road), id(section)
        lane = section.lanes[entity.kept_lane]
        self.width[row] = np.nan if lane.width.constant is None else lane.width.constant
        start, end, element = road.line.element(entity.s)
        center, route = lane.center.constant, entity.controls.route
        if (
            center is None
            or not road.flat
            or entity.controls.easing is not None
            or not isinstance(element, Line | Arc)
        ):
            return
        low, high = max(start, section.s), min(end, section.end)
        if route is not None:
            until = route.settled(entity, entity.direction > 0)
            low, high = (
                (max(low, entity.s), min(high, until))
                if entity.direction > 0
                else (max(low, until), min(high, np.nextafter(entity.s, np.inf)))
            )
        if not low <= entity.s < high:
            return
        self.gliding[row], self.straight[row] = True, road.line.straight
        self.low[row], self.high[row], self.center[row] = low, high, center
        self.start_s[row], self.start_x[row], self.start_y[row] = start, element.x, element.y
        self.start_h[row] = element.h
        self.start_cos[row], self.start_sin[row] = np.cos(element.h), np.sin(element.h)
        if isinstance(element, Line):
            self.start_cos[row], self.start_sin[row] = element.cos, element.sin
        self.curvature[row] = element.curvature(0.0)
