"""Scenarios on their roads, for exports of documents: positions, trajectories and routes as the
runner has them."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile.compiler import ScenarioContext, compile_scenario
from runner.engine.compile.protocols import Transition
from runner.engine.compile.road_network import load_roads
from runner.engine.motion.on_roads import Roads
from runner.engine.motion.routes import AssignedRoute, Route
from runner.engine.motion.trajectories import TimedPath, Trajectory
from runner.engine.participants.scenario_objects import read_entities
from runner.judging.execution import Prepared
from xosc.document.node import STORYBOARD
from xosc.exports.starts import InitialState, Pose, Vertex
from xosc.resolve import resolve

if TYPE_CHECKING:
    from lxml import etree

    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entity
    from runner.engine.storyboard.story_elements import Element
    from runner.judging.settings import RunSettings
    from runner.recording import Recording
    from runner.recording import Track as Recorded
    from xodr.graph.routes import RoadPath
    from xosc.document import Document
    from xosc.document.node import Node

_STEP = 0.25
"""m between the places that are looked at along a way."""
_TURN = 0.02
"""rad of turning between two vertices: a chord is within half a millimetre of a bend of 10 m."""
_FURTHEST = 10.0
"""m between two vertices."""
_LONGER, _ON = 2.0, 500.0
"""Bounds of a followed route: ratio to its length, as an entity may start off it, and m."""
_BEFORE_END = 8
"""Places by which a way ends before its road does."""
_SAME = 1e-4
"""m, rad, s"""
_WATCHED = 120.0
"""s for which a scenario is run to see how actions begin."""
_GOES_ON = ("LateralAction", "RoutingAction", "SynchronizeAction", "TrailerAction")


class RunnerGeometry:
    """A worked-out scenario as the runner has it.

    Raises:
        InvalidFile, Unsupported: it can't be run.
    """

    def __init__(self, document: Document, settings: RunSettings) -> None:
        enforce = settings.enforce_constraints
        self._resolved = resolve(
            document, enforce_constraints=enforce, catalog_path=settings.catalog_path
        )
        # The scripted motion alone: an export says what the file says.
        self._settings = replace(settings, sut="none", world="kinematic", max_time=0.0)
        self._network, _ = load_roads(
            self._resolved, settings.road, settings.road_path, settings.strict
        )
        self._context = ScenarioContext(self._resolved, self._network)
        read_entities(self._resolved.node.need("Entities"), self._context)
        self._numbers = {element: number for number, element in enumerate(_storyboard(document))}

    @cached_property
    def _first(self) -> Mapping[str, Recorded]:
        # A copy, since actions are removed from it.
        document = replace(
            self._resolved, root=copy.deepcopy(self._resolved.root.getroottree()).getroot()
        )
        _keep_first(document.node)
        scenario = compile_scenario(document, self._network)
        return Prepared(scenario, {}).run(self._settings).recording.tracks

    @cached_property
    def _whole(self) -> tuple[Recording, Sequence[Element]]:
        """The recording of a run, and the elements of the storyboard after it,
        in document order.
        """
        document = replace(
            self._resolved, root=copy.deepcopy(self._resolved.root.getroottree()).getroot()
        )
        scenario = compile_scenario(document, self._network)
        recording = Prepared(scenario, {}).run(replace(self._settings, max_time=_WATCHED)).recording
        recording.locate()
        return recording, scenario.storyboard.elements()

    def _first_time(self, node: Node, transition: Transition) -> float | None:
        """Time (s) at which the innermost storyboard element around a node first makes a
        transition; names may be used twice."""
        around = (
            self._numbers.get(element) for element in (node.element, *node.element.iterancestors())
        )
        number = next((number for number in around if number is not None), None)
        return self._whole[1][number].first.get(transition) if number is not None else None

    def starts(self) -> Mapping[str, InitialState]:
        """Return the initial states of the entities present at the start, by name."""
        return {
            name: self._state(track, 0)
            for name, track in self._first.items()
            if track.columns["time"][0] == 0.0
        }

    def begins(self, element: Node) -> float | None:
        """Time (s) at which a storyboard element first begins, in a run without a system under
        test; None where it doesn't."""
        return self._first_time(element, Transition.START)

    def ends(self, element: Node) -> float | None:
        """Time (s) at the end of the step in which an element first ends in that run; None where it
        doesn't, or others end it."""
        time = self._first_time(element, Transition.END)
        return time + self._settings.timestep if time is not None else None

    def driven(self, entity: str, begin: float, end: float) -> Sequence[Vertex]:
        """Return the positions of an entity at each step of that run between two times (s); times
        start at the first step."""
        track = self._whole[0].tracks.get(entity)
        if track is None:
            return []
        time, x, y, z = (track.columns[name] for name in ("time", "x", "y", "z"))
        # Times are sums of steps: both ends are meant.
        rows = np.flatnonzero((time > begin - _SAME) & (time < end + _SAME))
        return [
            Vertex(float(x[n]), float(y[n]), float(z[n]), None, float(time[n]) - begin)
            for n in rows
        ]

    def during(self, action: Node, entity: str) -> InitialState | None:
        """Return the state of an entity at the start of a story's action; None if the action never
        starts or the entity is absent."""
        time, track = self.begins(action), self._whole[0].tracks.get(entity)
        if time is None or track is None:
            return None
        row = int(np.searchsorted(track.columns["time"], time - _SAME))
        return self._state(track, row) if row < len(track.columns["time"]) else None

    def put(self, action: Node, entity: str) -> Vertex | None:
        """Return the place to which an action teleports an entity in that run; None if the action
        never starts."""
        time, track = self.begins(action), self._whole[0].tracks.get(entity)
        if time is None or track is None:
            return None
        rows = np.flatnonzero(track.columns["time"] > time + _SAME)[
            :1
        ]  # a step after it, which it has driven on
        for x, y, z, h, speed in zip(
            *(track.columns[name][rows] for name in ("x", "y", "z", "h", "speed")), strict=True
        ):
            # Back by the step that it has driven since.
            gone = float(speed) * self._settings.timestep
            return Vertex(
                float(x) - gone * math.cos(h), float(y) - gone * math.sin(h), float(z), float(h)
            )
        return None

    def direction(self, road: str, lane: int) -> int:
        """1 where the traffic of a lane drives towards greater s, else −1."""
        assert self._network is not None
        return self._network.road(road).direction(lane)

    def _state(self, track: Recorded, at: int) -> InitialState:
        row = {
            column: track.columns[column][at]
            for column in ("x", "y", "z", "h", "speed", "road_id", "lane_id", "s")
        }
        x, y, z, h, speed, s = (float(row[column]) for column in ("x", "y", "z", "h", "speed", "s"))
        road = str(row["road_id"]) if row["road_id"] else None
        if (
            road is None
            or self._network is None
            or road not in self._network.roads
            or not int(row["lane_id"])
        ):
            return InitialState(speed=speed, pose=(x, y, z, h))
        lane = int(row["lane_id"])
        there = self._on_lane(road, lane, s)
        centred = (
            math.hypot(there.x - x, there.y - y) < _SAME
            and abs(math.remainder(there.h - h, math.tau)) < _SAME
        )
        return InitialState(road, lane, s, speed, (x, y, z, h), centred)

    def _on_lane(self, road: str, lane: int, s: float) -> Placement:
        from runner.engine.positions.lane import lane_placement
        from runner.engine.positions.world import Orientation

        assert self._network is not None
        return lane_placement(
            self._network, self._network.road(road).lane_point(s, lane), Orientation()
        )

    def place(self, position: Node) -> Vertex | None:
        """Return the place of an element Position; None if it depends on the run."""
        fixed = self._context.position(position).fixed
        return Vertex(fixed.x, fixed.y, fixed.z, fixed.h) if fixed is not None else None

    def track(
        self,
        trajectory: Node,
        skip: float = 0.0,
        actor: str | None = None,
        pose: Pose = (0.0, 0.0, 0.0, 0.0),
    ) -> Sequence[Vertex] | None:
        """Vertices of a Trajectory from a distance (m) on; None if it depends on the run."""
        found = Trajectory.from_xml(trajectory, self._context)
        track = found.fixed
        if (
            track is None and actor is not None and not found.shape.positions
        ):  # it begins where its actor is
            entity = self._context.declared[actor]
            entity.reset()
            entity.x, entity.y, entity.z, entity.h = pose
            entity.placed = True
            track = found.track(None, entity)
        return list(_sampled(track, skip)) if track is not None else None

    def way(self, action: Node, entity: str) -> Sequence[Vertex]:
        """The way along lanes that a routing action leads an entity from its start; empty where it
        takes that way anyway."""
        path, closed = self._path(action, entity)
        length = _LONGER * path.length + _ON
        led = self._driven(action, entity, length, AssignedRoute(path, closed, self._network))
        free = self._driven(action, entity, length, None)
        # A way that is taken anyway needs no vertices: the target's own drivers find it.
        same = len(led) == len(free) and all(
            math.dist(a[:2], b[:2]) < _SAME for a, b in zip(led, free, strict=True)
        )
        return [] if same else list(_thinned(led))

    def _path(self, action: Node, entity: str) -> tuple[RoadPath, bool]:
        assert self._network is not None
        if action.tag == "AssignRouteAction":
            route = Route.from_xml(action.need("Route"), self._context)
            if not route.fixed:
                raise action.unsupported("the route depends on what happens")
            return route.path(None), route.closed
        there, start = (
            self._context.position(action.need("Position")).fixed,
            self.starts().get(entity, InitialState()),
        )
        if there is None or start.road is None:
            raise action.unsupported("the way depends on what happens")
        here = self._network.road(start.road).lane_point(start.s, start.lane)
        path = self._network.route(
            [here, there.point or self._network.locate(there.x, there.y, there.z)]
        )
        if path is None:
            raise action.invalid(f"no way leads {entity!r} to the position")
        return path, False

    def _driven(
        self, action: Node, name: str, length: float, guide: AssignedRoute | None
    ) -> list[Pose]:
        """x, y, z and h along the lanes that an entity follows from its start, for a length (m) or
        until the road ends."""
        start, entity = self.starts().get(name, InitialState()), self._context.declared[name]
        if self._network is None or start.road is None or start.pose is None:
            raise action.unsupported(
                "the way along lanes is known only of entities that start on one"
            )
        entity.reset()
        # Moved as the runner moves it, so that the export's way is that of a run.
        roads = Roads(self._network)
        self._put(entity, roads, start)
        entity.controls.route = guide
        driven = [(entity.x, entity.y, entity.z, entity.h)]
        for _ in range(round(length / _STEP)):
            entity.controls.motion.advance(entity, _STEP, 1.0)
            if (
                math.dist(driven[-1][:2], (entity.x, entity.y)) < _SAME
            ):  # the end of the road, which lanes are left to stop at
                return driven[:-_BEFORE_END]
            driven.append((entity.x, entity.y, entity.z, entity.h))
        return driven

    def _put(self, entity: Entity, roads: Roads, start: InitialState) -> None:
        from runner.engine.motion.placement import in_world
        from xodr.model import WorldPose

        assert self._network is not None and start.road is not None and start.pose is not None
        if start.centred:
            roads.place(entity, self._on_lane(start.road, start.lane, start.s))
            return
        x, y, z, h = start.pose
        hint = self._network.road(start.road).lane_point(start.s, start.lane)
        roads.place(
            entity,
            in_world(self._network, WorldPose(x, y, z, h, 0.0, 0.0), z_known=False, hint=hint),
        )


def _storyboard(document: Document) -> Iterator[etree._Element]:
    for story in document.node.need("Storyboard").children("Story"):
        yield from story.element.iter(*STORYBOARD)


def _keep_first(scenario: Node) -> None:
    """Remove everything after the start of a scenario: entities are placed, and their first speeds
    set."""
    storyboard = scenario.need("Storyboard")
    for child in storyboard.children("Story", "StopTrigger"):
        storyboard.element.remove(child.element)
    for private in storyboard.need("Init").iter("Private"):
        placed = any(True for _ in private.iter("TeleportAction"))
        for action in private.children("PrivateAction"):
            # A routing action may be all that places an entity: it stays then.
            if any(placed or node.tag != "RoutingAction" for node in action.iter(*_GOES_ON)):
                private.element.remove(action.element)


def _sampled(track: TimedPath, skip: float) -> Iterator[Vertex]:
    """Places along a curve, at its ends and wherever it has a time."""
    timed = {
        station: time
        for station, time in zip(track.stations, track.times, strict=True)
        if time is not None
    }
    end = track.path.length
    marks = sorted({skip, end, *(s for s in timed if skip <= s <= end)})
    for start, stop in pairwise(marks):
        pieces = max(math.ceil((stop - start) / _STEP), 1)
        for n in range(pieces):
            s = start + (stop - start) * n / pieces
            yield _at(track, s, _time(timed, s))
    yield _at(track, end, _time(timed, end))


def _at(track: TimedPath, s: float, time: float | None) -> Vertex:
    pose = track.path.at(s)
    return Vertex(pose.x, pose.y, pose.z, None, time)


def _time(timed: Mapping[float, float], s: float) -> float | None:
    """The time at s, between known ones at constant speed."""
    known = sorted(timed)
    before = [station for station in known if station <= s]
    after = [station for station in known if station >= s]
    if not before or not after:
        return None
    a, b = before[-1], after[0]
    return timed[a] if a == b else timed[a] + (timed[b] - timed[a]) * (s - a) / (b - a)


def _thinned(driven: Sequence[Pose]) -> Iterator[Vertex]:
    """Vertices of a way: many where it bends, few where it is straight."""
    last, gone = driven[0], 0.0
    yield Vertex(*last[:3])
    for here, following in pairwise(driven[1:]):
        gone += _STEP
        if gone >= _FURTHEST or abs(math.remainder(following[3] - last[3], math.tau)) > _TURN:
            last, gone = here, 0.0
            yield Vertex(*here[:3])
    if len(driven) > 1:
        yield Vertex(*driven[-1][:3])
