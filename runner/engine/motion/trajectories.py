"""Trajectories of the standard: their shapes read from XML and turned into paths with, where given,
the time at each place.

Shapes whose positions never change are turned into paths when the scenario is compiled; the others
when they are needed. OpenSCENARIO XML 1.3, 6.9: a shape gives the heading as well where its
positions have one, else entities face the tangent.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import Enum
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from runner.engine.motion.nurbs import ControlPoint, sampled
from runner.engine.motion.paths import Chain, Corner, Path, Polyline, Segments, smoothed
from runner.engine.motion.placement import Placement
from runner.engine.motion.schedules import VertexMotion
from runner.engine.motion.standstill import steadied
from xodr.model.geometry import Arc, Line, PlanElement, Spiral, Start
from xosc.resolve import CLOCK
from xosc.rules.positions import TIMING_UID

if TYPE_CHECKING:
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Surroundings
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node

INTERPOLATION_UID = "xosc.toolchain:xosc:1.4.0:routing.interpolation_is_up_to_the_tool"
_GAP = 1e-3
"""Distance (m) from which the end of a closed shape is joined to its beginning by a line."""
_JUMP = 1e-6
"""Way (m) that may be covered in no time: vertices that coincide but for rounding."""
_FASTEST = 1e4
"""Speed (m/s) beyond which times are taken for a mistake."""
_LATEST = 1e9
"""Time (s) beyond which, or before whose negative, times are taken for a mistake. Those of a clock
are counted from its first."""
_LONGEST = 1e7
"""Length (m) beyond which a trajectory is taken for a mistake."""


class Rests(Enum):
    """Stretches of a track that lead nowhere, and on which a follower keeps its heading
    (`runner.engine.motion.standstill`)."""

    NONE = "none"
    SOME = "some"
    ALL = "all"


class TimedPath(NamedTuple):
    """A trajectory in the world: its path, and the times (s) that it gives at some s (m) along the
    path.

    grounded: whether its height is that of the road. motions: what is prescribed at each of these
    s. rests: where it stands.
    """

    path: Path
    times: Sequence[float | None]
    stations: Sequence[float]
    grounded: bool = True
    motions: Sequence[VertexMotion] = ()
    rests: Rests = Rests.NONE


class Timetable(NamedTuple):
    """The times (s, scaled) at which a follower is to be at stations (m) of a track; neither
    decreases."""

    times: Sequence[float]
    stations: Sequence[float]


class TrajectoryShape(ABC):
    """A trajectory's shape.

    Attributes:
        times: the times (s) of its vertices, control points or ends; None where it has none.
        timed: whether it says when it is where, from start to end.
        motions: speeds and accelerations at the places of the times.
    """

    times: Sequence[float | None] = ()
    timed: bool = False
    motions: Sequence[VertexMotion] = ()

    def __init__(self, positions: Sequence[Position], motions: Sequence[Node | None] = ()) -> None:
        self.positions = positions
        self._motions = motions
        self.motions = [_motion(node) for node in motions]
        self.fixed = all(position.fixed is not None for position in positions)
        self.grounded = all(position.grounded for position in positions)
        self.faces = False
        """Whether positions say how one faces along the track; the first one of clothoids says
        where the track leads."""

    def untimed_motions(self) -> list[Node]:
        """Motion elements at places without a time: a Timing leaves them out, unless the shape has
        no times at all."""
        return [
            node
            for node, time in zip(self._motions, self.times, strict=True)
            if node is not None and time is None
        ]

    @classmethod
    @abstractmethod
    def from_xml(cls, node: Node, context: Context) -> TrajectoryShape:
        """Read the shape's element."""

    @abstractmethod
    def build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """The track, with all positions where they are now."""


def _motion(node: Node | None) -> VertexMotion:
    """Read a Motion; an empty one prescribes nothing."""
    if node is None:
        return VertexMotion()
    motion = VertexMotion(
        node.finite("speed_longitudinal", None), node.finite("acceleration_longitudinal", None)
    )
    if motion == VertexMotion():
        raise node.invalid("speed_longitudinal or acceleration_longitudinal is expected")
    if motion.speed is not None and motion.speed < 0.0:
        raise node.unsupported(
            f"speed_longitudinal={motion.speed:g}: a trajectory is followed forwards"
        )
    return motion


class PolylineShape(TrajectoryShape):
    """Vertices joined by straight lines; with an Interpolation, by a smooth curve."""

    def __init__(
        self, node: Node, positions: Sequence[Position], times: Sequence[float | None]
    ) -> None:
        super().__init__(positions, [vertex.find("Motion") for vertex in node.children("Vertex")])
        self.curved = node.find("Interpolation") is not None
        self.faces = any(position.oriented for position in positions)
        self.node, self.times = node, times
        self.timed = times[0] is not None and times[-1] is not None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> PolylineShape:
        """Read the vertices."""
        vertices = node.children("Vertex")
        if len(vertices) < 2:
            raise node.invalid("a polyline needs two vertices or more")
        positions = [context.position(vertex.need("Position")) for vertex in vertices]
        interpolation = node.find("Interpolation")
        if interpolation is not None:
            text = (
                "the vertices are joined by a smooth curve: cubics whose tangents are those of "
                "parabolas through three vertices"
            )
            context.remarks.add(interpolation.remark(INTERPOLATION_UID, text))
        times = [vertex.finite("time", None) for vertex in vertices]
        for second in range(1, len(vertices)):
            first = second - 1
            # Two places at one time cannot both be meant; the last vertex keeps its time, since the
            # trajectory ends by it.
            if (
                times[first] is not None
                and times[first] == times[second]
                and _apart(positions[first], positions[second])
            ):
                text = f"the time {times[second]:g} is that of another place, too; it is left out"
                context.repair(vertices[second], TIMING_UID, text)
                times[first if second == len(vertices) - 1 and first else second] = None
        return cls(node, positions, times)

    def build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """Lines from vertex to vertex, or a curve through them."""
        corners = [_corner(position, position.resolve(run, actor)) for position in self.positions]
        # Prescribed headings are no noise, and a curve through the vertices gives its own.
        steady = corners if self.curved or self.faces else steadied(corners)
        path = smoothed(corners) if self.curved else Polyline(steady or corners)
        rests = Rests.ALL if steady is None else Rests.SOME if steady != corners else Rests.NONE
        return TimedPath(path, self.times, path.stations, motions=self.motions, rests=rests)


def _apart(one: Position, other: Position) -> bool:
    """Whether two positions are known to be so far from each other that no time is needed for a
    jump."""
    a, b = one.fixed, other.fixed
    return a is not None and b is not None and math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) > _JUMP


def _corner(position: Position, place: Placement) -> Corner:
    if not position.oriented:
        return Corner(place.x, place.y, place.z)
    return Corner(place.x, place.y, place.z, place.h, place.pitch, place.roll)


class _Bend(NamedTuple):
    """A piece of a clothoid: curvature (1/m) at both ends, length (m), and a turn (rad) before it
    begins."""

    start: float
    end: float
    length: float
    turn: float = 0.0


@lru_cache(maxsize=256)
def _bent(x: float, y: float, z: float, h: float, bends: tuple[_Bend, ...]) -> Segments:
    """Chain of pieces of clothoids from x, y (m) and heading h (rad)."""
    segments: list[PlanElement] = []
    for bend in bends:
        start = Start(x, y, h + bend.turn, bend.length)
        segment: PlanElement
        if bend.start != bend.end:
            segment = Spiral(start, bend.start, bend.end)
        else:
            segment = Arc(start, bend.start) if bend.start else Line(start)
        segments.append(segment)
        x, y, h = segment.at(bend.length)
    path = Segments(segments, z)
    path.knots()  # a curve that winds too often to be searched is refused now
    return path


class ClothoidShape(TrajectoryShape):
    """One clothoid: curvature that changes evenly along its length.

    `curvatureDot` of version 1.0 is read as what later versions call `curvaturePrime`, the change
    per metre: a shape does not depend on how fast it is driven.
    """

    def __init__(self, node: Node, position: Position) -> None:
        super().__init__([position], [node.find("MotionStart"), node.find("MotionEnd")])
        self.node = node
        length, curvature = node.finite("length"), node.finite("curvature")
        if length <= 0.0:
            raise node.invalid(f"length={length:g} must be positive")
        prime = node.finite("curvaturePrime", None)
        prime = node.finite("curvatureDot", 0.0) if prime is None else prime
        self.bend = _Bend(curvature, curvature + prime * length, length)
        self.times = [node.finite("startTime", None), node.finite("stopTime", None)]
        self.timed = None not in self.times

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ClothoidShape:
        """Read the attributes."""
        return cls(node, context.position(node.need("Position")))

    def build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """The clothoid from its start position."""
        place = self.positions[0].resolve(run, actor)
        path = _bent_at(self.node, place, (self.bend,))
        return TimedPath(path, self.times, path.stations, motions=self.motions)


def _bent_at(node: Node, place: Placement, bends: tuple[_Bend, ...]) -> Segments:
    try:
        return _bent(place.x, place.y, place.z, place.h, bends)
    except ValueError as error:
        raise node.invalid(f"the clothoid can't be followed: {error}") from None


class ClothoidSplineShape(TrajectoryShape):
    """Chain of clothoids; a segment with a start position begins there, the others at the end of
    the one before.

    Without a start position the first segment begins where the entity is that follows it.
    """

    def __init__(self, node: Node, context: Context) -> None:
        segments = node.children("ClothoidSplineSegment")
        if not segments:
            raise node.invalid("a clothoid spline needs a segment")
        starts = [(s, s.find("PositionStart")) for s in segments]
        found = [context.position(start) if start is not None else None for _, start in starts]
        motions = [*(segment.find("MotionStart") for segment in segments), node.find("MotionEnd")]
        super().__init__([position for position in found if position is not None], motions)
        # Without a start position it begins where its follower is.
        self.fixed = self.fixed and found[0] is not None
        self.node = node
        # runs of segments that continue each other, each with the position where it begins
        self.runs: list[tuple[Position | None, list[_Bend]]] = []
        for segment, position in zip(segments, found, strict=True):
            if position is not None or not self.runs:
                self.runs.append((position, []))
            self.runs[-1][1].append(_read_bend(segment))
        self.times = [
            *(segment.finite("timeStart", None) for segment in segments),
            node.finite("timeEnd", None),
        ]
        self.timed = self.times[0] is not None and self.times[-1] is not None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ClothoidSplineShape:
        """Read the segments."""
        return cls(node, context)

    def build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """The segments, gaps between them (if any) bridged by lines."""
        path: Path | None = None
        stations = [0.0]
        for position, bends in self.runs:
            place = (
                _own_place(self.node, actor) if position is None else position.resolve(run, actor)
            )
            piece = _bent_at(self.node, place, tuple(bends))
            path = piece if path is None else Chain(_to(path, place.x, place.y, place.z), piece)
            begin = path.length - piece.length
            # The end of a piece is the beginning of the next, after the line that bridges a gap.
            stations = [*stations[:-1], *(begin + station for station in piece.stations)]
        assert path is not None
        return TimedPath(path, self.times, stations, motions=self.motions)


def _read_bend(node: Node) -> _Bend:
    start, end, length = (
        node.finite(name) for name in ("curvatureStart", "curvatureEnd", "length")
    )
    bend = _Bend(start, end, length, node.finite("hOffset", 0.0))
    if bend.length <= 0.0:
        raise node.invalid(f"length={bend.length:g} must be positive")
    return bend


def _own_place(node: Node, actor: Entity | None) -> Placement:
    if actor is None or not actor.placed:
        raise node.invalid(
            "the first segment has no PositionStart, and there is no entity whose "
            "position could be meant"
        )
    return Placement(actor.x, actor.y, actor.z, actor.h)


class NurbsShape(TrajectoryShape):
    """A non-uniform rational B-spline."""

    def __init__(self, node: Node, context: Context) -> None:
        controls = node.children("ControlPoint")
        super().__init__(
            [context.position(control.need("Position")) for control in controls],
            [None] * len(controls),
        )
        self.node = node
        self.order = int(node.int("order"))
        self.times = [control.finite("time", None) for control in controls]
        self.weights = [control.finite("weight", 1.0) for control in controls]
        self.knots = tuple(float(knot.finite("value")) for knot in node.children("Knot"))
        self.timed = None not in self.times

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> NurbsShape:
        """Read order, control points and knots."""
        return cls(node, context)

    def build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """The curve that the control points shape."""
        points: list[ControlPoint] = []
        heading: float | None = None
        for position, weight, time in zip(self.positions, self.weights, self.times, strict=True):
            place = position.resolve(run, actor)
            # Headings are coordinates of the curve: a jump of 2π would spin the follower round.
            heading = _unwrapped(place.h, heading) if position.oriented else None
            points.append(ControlPoint(place.x, place.y, place.z, weight, time, heading))
        try:
            curve = sampled(self.order, tuple(points), self.knots)
        except ValueError as error:
            raise self.node.invalid(str(error)) from None
        return TimedPath(curve.path, curve.times, curve.stations)


def _unwrapped(angle: float, near: float | None) -> float:
    return angle if near is None else near + math.remainder(angle - near, math.tau)


def _to(path: Path, x: float, y: float, z: float) -> Path:
    """The path, with a line to a place (m) at its end where that is elsewhere."""
    end = path.at(path.length)
    if math.hypot(x - end.x, y - end.y) < _GAP:
        return path
    return Chain(path, Polyline([Corner(end.x, end.y, end.z), Corner(x, y, z)]))


class Trajectory:
    """A Trajectory of the standard.

    Attributes:
        name: its name.
        closed: whether its end leads back to its beginning, so that it can be followed round and
            round.
        timed: whether it says when it is where, from start to end.
        timeless: whether it has no times at all.
        clock: whether its times are those of a clock, such as UNIX seconds.
        base: time (s) that its times are counted from.
        moved: whether it prescribes speeds or accelerations.
        fixed: what it is throughout every run, where it is always the same.
    """

    SHAPES: ClassVar[dict[str, type[TrajectoryShape]]] = {
        "Polyline": PolylineShape,
        "Clothoid": ClothoidShape,
        "ClothoidSpline": ClothoidSplineShape,
        "Nurbs": NurbsShape,
    }

    def __init__(self, node: Node, shape: TrajectoryShape, closed: bool) -> None:
        self.node, self.shape, self.closed = node, shape, closed
        self.name: str = node.get("name", "")
        self.timed = shape.timed
        self.base = 0.0
        self.clock = any(time is not None and time > CLOCK for time in shape.times)
        self.moved = any(motion != VertexMotion() for motion in shape.motions)
        if self.moved and closed:
            raise node.unsupported(
                "speeds and accelerations along a closed trajectory are not known to the runner"
            )
        self.timeless = all(time is None for time in shape.times)
        self.fixed = self._build(None, None) if shape.fixed else None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> Trajectory:
        """Read a Trajectory element."""
        shape = node.need("Shape").only()
        if shape.tag not in cls.SHAPES:
            raise shape.unsupported("this trajectory shape is not known to the runner")
        return cls(node, cls.SHAPES[shape.tag].from_xml(shape, context), node.bool("closed"))

    def references(self) -> tuple[Entity, ...]:
        """Entities that the shape's positions refer to."""
        return tuple(
            entity for position in self.shape.positions for entity in position.references()
        )

    def track(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        """The trajectory in the world, with all positions where they are now.

        Args:
            actor: the entity that follows it.

        Raises:
            InvalidFile: it can't be followed.
        """
        return self.fixed or self._build(run, actor)

    def timetable(self, track: TimedPath, scale: float) -> Timetable:
        """Return the schedule of a follower on a track of this trajectory.

        Args:
            scale: what the times are multiplied by when they are used.

        Raises:
            InvalidFile: the times do not describe a motion.
        """
        known = [
            (time - self.base, station)
            for time, station in zip(track.times, track.stations, strict=True)
            if time is not None
        ]
        for (before, here), (after, there) in pairwise(known):
            if after < before or max(-before, after) > _LATEST:
                raise self.node.invalid(
                    f"the time {after:g} s follows {before:g} s, but times must grow "
                    "from one to the next"
                )
            duration = scale * (after - before)
            if there - here > _FASTEST * duration + _JUMP:
                raise self.node.invalid(
                    f"the trajectory covers {there - here:g} m in {duration:g} s, after "
                    f"{before:g} s"
                )
        return Timetable([scale * time for time, _ in known], [station for _, station in known])

    def _build(self, run: Surroundings | None, actor: Entity | None) -> TimedPath:
        track = self.shape.build(run, actor)
        path = track.path
        if self.closed:
            start = path.at(0.0)
            path = _to(path, start.x, start.y, start.z)
        # `not <=` refuses NaN as well.
        if not path.length <= _LONGEST:
            raise self.node.invalid(f"the trajectory {self.name!r} is {path.length:g} m long")
        return track._replace(path=path, grounded=self.shape.grounded)
