"""The road of an OSI trace: attached, named, beside it, or drawn from its lanes; and a trace with
it, for replays.

Source: ASAM OSI 3.8, Lane and LaneBoundary. Left, right, antecessor and successor of a lane go by
the order of its centre line; `centerline_is_driving_direction` says whether traffic goes that way.
Roads are flat: OSI's heights are left out, with a remark.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from runner.exchange.traces.reading import TraceRecording, read
from runner.judging.result import Cause, RunResult, Verdict
from runner.recording import Recording
from schemas.common.array_types import FloatArray
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.policy import current
from schemas.common.storage import cache_folder, digest, keep, writing
from schemas.osi.traces import SUFFIXES, AttachedMap, Trace
from xodr.formats.lanelet2 import Lanelet, LaneletNeighbour, build
from xodr.formats.lanelet2.lanelet import (
    between,
    direction,
    frame_at,
    joined,
    lengths,
    middle,
    resampled,
)
from xodr.reader import load

_WIDTH = 3.5
"""Width (m) of lanes without boundaries"""
_NEAR = 1.0
"""Greatest distance (m) of lane ends that continue each other"""
_BESIDE = (1.5, 7.0)
"""Distances (m) of the centre lines of neighbouring lanes"""
_LEAST_LENGTH, _LEAST_WIDTH = 0.5, 0.3
"""Length and width (m) below which a lane is left out"""
_OVER = 2.0
"""Length (m) by which boundaries go beyond a lane's centre line before they are cut"""
_HIGH = 0.5
"""Heights (m) that are worth a remark"""
_TURN = 12
"""Points of a way through an intersection"""
_TYPES = {
    "BIKING": "biking", "SIDEWALK": "sidewalk", "PARKING": "parking", "STOP": "stop",
    "RESTRICTED": "restricted",
    "BORDER": "border", "SHOULDER": "shoulder", "EXIT": "exit", "ENTRY": "entry",
    "ONRAMP": "onRamp", "OFFRAMP": "offRamp",
    "CONNECTINGRAMP": "connectingRamp",
}  # fmt: skip
"""OpenDRIVE's lane types by OSI's subtype"""
_MARKS = {
    "SOLID_LINE": "solid",
    "DASHED_LINE": "broken",
    "BOTTS_DOTS": "botts dots",
    "CURB": "curb",
    "GRASS_EDGE": "grass",
}
"""OpenDRIVE's road marks by OSI's boundary type; all others are none"""


@dataclass
class Drawn:
    """Road map made of lanes: content of the OpenDRIVE file, and inferences."""

    content: bytes
    notes: list[str] = field(default_factory=list)


def drawn(truth: Any, name: str) -> Drawn | None:
    """The road map of the lanes of a GroundTruth; None where it has no lane that can be used.

    Raises:
        UsageError: the lanes make no road map.
    """
    lanes = _TraceLanes(truth)
    if not lanes.made:
        return None
    try:
        built = build(list(lanes.made.values()), name)
    except ToolchainError as error:
        raise UsageError(f"the lanes of this trace make no road map: {error.message}") from None
    return Drawn(built.map.to_xml(), [*lanes.notes(), *built.notes])


class _TraceLanes:
    """Lanelets of the lanes of a GroundTruth, by their ids."""

    def __init__(self, truth: Any) -> None:
        self._boundaries = {boundary.id.value: boundary for boundary in truth.lane_boundary}
        self._directed = any(
            lane.classification.HasField("centerline_is_driving_direction") for lane in truth.lane
        )
        self._counts: Counter[str] = Counter()
        self._heights = [point.z for lane in truth.lane for point in lane.classification.centerline]
        self.made: dict[str, Lanelet] = {}
        self._sides: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {}
        areas: list[Any] = []
        lanes: list[Any] = []
        for lane in truth.lane:
            # OSI's intersections are areas with many ways: one pair and a line make a lane.
            is_area = lane.classification.type == lane.classification.TYPE_INTERSECTION and (
                len(lane.classification.lane_pairing) > 1 or not lane.classification.centerline
            )
            (areas if is_area else lanes).append(lane)
        for lane in lanes:
            self._add(lane)
        for lane in lanes:
            self._link(lane, truth)
        for lane in areas:
            self._cross(lane)

    def notes(self) -> list[str]:
        """Inferred facts, one sentence each."""
        words = {
            "width": (
                "lanes have no boundaries: they are taken {width:g} m wide, or "
                "half-way to their neighbours"
            ),
            "centre": "lanes have no centre line: they run as their boundaries do",
            "short": "lanes are shorter or narrower than any vehicle, or have no line: left out",
            "way": "ways through intersections are drawn between the lanes that are paired",
            "apart": "lane pairs end apart from each other: not linked",
        }
        found = [
            f"{self._counts[key]} {text.format(width=_WIDTH)}"
            for key, text in words.items()
            if self._counts[key]
        ]
        if self._heights and max(map(abs, self._heights)) > _HIGH:
            found.append("the roads are flat at height 0, without the heights of the lanes")
        return ["the roads are drawn from the lanes of the trace", *found]

    # lanes ----------------------------------------------------------------------------------

    def _add(self, lane: Any) -> None:
        kind = lane.classification
        centre = _points(kind.centerline)
        # A trace that never sets the field is read as driven along its centre lines.
        forward = kind.centerline_is_driving_direction or not self._directed
        ids = [
            tuple(identifier.value for identifier in side)
            for side in (kind.left_lane_boundary_id, kind.right_lane_boundary_id)
        ]
        lines = [self._line(side, centre) for side in ids]
        if len(centre) < 2 and all(len(line) >= 2 for line in lines):
            self._counts["centre"] += 1
            centre = middle(_alike(lines[0], lines[1]), lines[1])
        if len(centre) < 2 or lengths(centre)[-1] < _LEAST_LENGTH:
            self._counts["short"] += 1
            return
        left, right = self._both(centre, lines)
        marks = [self._mark(side) for side in ids]
        # Against the centre line left and right change places.
        if not forward:
            left, right, ids, marks = right[::-1], left[::-1], ids[::-1], marks[::-1]
        if not self._wide(left, right):
            self._counts["short"] += 1
            return
        name = str(lane.id.value)
        subtype = _short(kind, "subtype", "SUBTYPE_")
        usual = "driving" if kind.type in (kind.TYPE_DRIVING, kind.TYPE_INTERSECTION) else "none"
        self._sides[name] = ids[0], ids[1]
        self.made[name] = Lanelet(
            name, left, right, type=_TYPES.get(subtype, usual), road_type="unknown",
            speed_limit=float("inf"),
            left_mark=marks[0], right_mark=marks[1],
        )  # fmt: skip

    def _line(self, ids: Sequence[int], centre: FloatArray) -> FloatArray:
        """The boundaries of one side as one line, in the order of the centre line."""
        lines = []
        for key in ids:
            found = self._boundaries.get(key)
            points = (
                _points(point.position for point in found.boundary_line)
                if found is not None
                else np.zeros((0, 2))
            )
            if len(points) >= 2:
                lines.append(_along(points, centre))
        if len(centre) >= 2:
            start, heading = centre[0], centre[-1] - centre[0]
            lines.sort(key=lambda line: float((line.mean(axis=0) - start) @ heading))
        return joined(lines) if lines else np.zeros((0, 2))

    def _both(
        self, centre: FloatArray, lines: Sequence[FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """The left and the right bound over the length of the centre line."""
        cut = [_cut(line, centre) if len(line) >= 2 else None for line in lines]
        count = max(len(centre), 2)
        left, right = cut
        if left is None and right is None:
            self._counts["width"] += 1
            return _offset(centre, 0.5 * _WIDTH), _offset(centre, -0.5 * _WIDTH)
        if left is None or right is None:
            self._counts["width"] += 1
            other = right if left is None else left
            assert other is not None
            # The known boundary is mirrored about the centre line.
            mirrored = 2.0 * resampled(centre, count) - resampled(other, count)
            return (mirrored, other) if left is None else (other, mirrored)
        return left, right

    def _mark(self, ids: Iterable[int]) -> str:
        kinds = [
            _short(self._boundaries[key].classification, "type", "TYPE_")
            for key in ids
            if key in self._boundaries
        ]
        return _MARKS.get(kinds[0], "none") if kinds else "none"

    def _wide(self, left: FloatArray, right: FloatArray) -> bool:
        widths = np.hypot(*(resampled(left, 9) - resampled(right, 9)).T)
        return bool(
            widths.max() >= _LEAST_WIDTH and lengths(left)[-1] > 0.0 and lengths(right)[-1] > 0.0
        )

    # links ----------------------------------------------------------------------------------

    def _link(self, lane: Any, truth: Any) -> None:
        name = str(lane.id.value)
        mine = self.made.get(name)
        if mine is None:
            return
        kind = lane.classification
        paired = {
            str(identifier.value)
            for pair in kind.lane_pairing
            for field_name in ("antecessor_lane_id", "successor_lane_id")
            if pair.HasField(field_name)
            for identifier in (getattr(pair, field_name),)
        }
        before, after = [], []
        for other in sorted(paired & self.made.keys()):
            to, at = _meets(mine, self.made[other]), _meets(self.made[other], mine)
            if to:
                after.append(other)
            if at:
                before.append(other)
            if not to and not at:
                self._counts["apart"] += 1
        adjacent = [
            str(identifier.value)
            for side in (kind.left_adjacent_lane_id, kind.right_adjacent_lane_id)
            for identifier in side
        ]
        right = next(
            (
                neighbour
                for neighbour in adjacent
                if neighbour in self.made and neighbour != name and self._is_right(name, neighbour)
            ),
            None,
        )
        beside = None
        # Neighbours to the left follow from those to the right of the others.
        if right is not None:
            beside = LaneletNeighbour(right, True)
            self._share(name, right)
        self.made[name] = replace(
            self.made[name],
            predecessors=tuple(before),
            successors=tuple(after),
            beside_right=beside,
        )

    def _is_right(self, name: str, other: str) -> bool:
        """Whether another lane lies to the right of a lane over its whole length, leading the same
        way."""
        one, two = self.made[name], self.made[other]
        shared = self._sides[name][1] and self._sides[name][1] == self._sides[other][0]
        a, b = middle(one.left, one.right), middle(two.left, two.right)
        least, most = _BESIDE
        for at in (0, -1):
            heading = direction(a, at == -1)
            dx, dy = (b[at] - a[at]).tolist()
            ahead, aside = (
                dx * np.cos(heading) + dy * np.sin(heading),
                dy * np.cos(heading) - dx * np.sin(heading),
            )
            if aside >= 0.0 or abs(ahead) > _OVER or not (shared or least <= -aside <= most):
                return False
        return True

    def _share(self, name: str, right: str) -> None:
        """Give two neighbours one bound between them where each was given its own by the usual
        width."""
        if self._sides[name][1] or self._sides[right][0]:
            return
        line = middle(self.made[name].right, self.made[right].left)
        self.made[name], self.made[right] = (
            replace(self.made[name], right=line),
            replace(self.made[right], left=line),
        )

    # intersections --------------------------------------------------------------------------

    def _cross(self, area: Any) -> None:
        """Ways through an intersection: one for each pair of lanes."""
        pairs = dict.fromkeys(
            (str(pair.antecessor_lane_id.value), str(pair.successor_lane_id.value))
            for pair in area.classification.lane_pairing
            if pair.HasField("antecessor_lane_id") and pair.HasField("successor_lane_id")
        )
        for start, end in pairs:
            # Pairs may name lanes that were left out; only ways of vehicles are drawn.
            if (
                start == end
                or start not in self.made
                or end not in self.made
                or self.made[start].type != "driving"
            ):
                continue
            one, two = self.made[start], self.made[end]
            self._counts["way"] += 1
            name = f"{area.id.value}.{start}.{end}"
            self.made[name] = Lanelet(
                name, _turn(one.left, two.left), _turn(one.right, two.right), (start,), (end,),
                type="driving",
                road_type="unknown", speed_limit=float("inf"),
            )  # fmt: skip


def _points(points: Iterable[Any]) -> FloatArray:
    """Points of a line, (n, 2), m, without those that repeat."""
    found = np.array([(point.x, point.y) for point in points], dtype=float).reshape(-1, 2)
    found = found[np.isfinite(found).all(axis=1)]
    return joined([found]) if len(found) > 1 else found


def _short(message: Any, name: str, prefix: str) -> str:
    value = message.DESCRIPTOR.fields_by_name[name].enum_type.values_by_number.get(
        getattr(message, name)
    )
    return value.name.removeprefix(prefix) if value is not None else ""


def _along(line: FloatArray, centre: FloatArray) -> FloatArray:
    """A line in the order of another one, where there is one."""
    if len(centre) < 2:
        return line
    # Nearer ends decide: a boundary may be written in either direction.
    ways = [np.hypot(*(points[[0, -1]] - centre[[0, -1]]).T).sum() for points in (line, line[::-1])]
    return line if ways[0] <= ways[1] else line[::-1]


def _alike(line: FloatArray, other: FloatArray) -> FloatArray:
    """Line cut to the length of another one beside it."""
    return _cut(line, other)


def _cut(line: FloatArray, centre: FloatArray) -> FloatArray:
    """The part of a line beside a centre line."""
    start, end = frame_at(centre[::-1], lengths(centre)[-1]), frame_at(centre, lengths(centre)[-1])
    # The start of a line is the end of its reverse, which faces the other way.
    start = start._replace(heading=start.heading + np.pi)
    over = -start.local(line[:1])[0, 0], end.local(line[-1:])[0, 0]
    return between(line, start, end) if max(over) > _OVER else line


def _offset(line: FloatArray, distance: float) -> FloatArray:
    """A line that far to the left of a line, m."""
    tangents = np.gradient(line, axis=0)
    tangents /= np.maximum(np.hypot(*tangents.T), 1e-9)[:, None]
    return line + distance * np.column_stack([-tangents[:, 1], tangents[:, 0]])


def _meets(one: Lanelet, other: Lanelet) -> bool:
    """Whether a lanelet begins where another one ends."""
    end, start = 0.5 * (one.left[-1] + one.right[-1]), 0.5 * (other.left[0] + other.right[0])
    return bool(np.hypot(*(end - start)) <= _NEAR)


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """A bound from the end of one line to the start of another one, in their directions (cubic
    Hermite)."""
    start, end = before[-1], after[0]
    reach = float(np.hypot(*(end - start)))
    ways = [
        reach * np.array([np.cos(angle), np.sin(angle)])
        for angle in (direction(before, True), direction(after, False))
    ]
    s = np.linspace(0.0, 1.0, _TURN)[:, None]
    return (
        (2 * s**3 - 3 * s**2 + 1) * start
        + (s**3 - 2 * s**2 + s) * ways[0]
        + (3 * s**2 - 2 * s**3) * end
        + (s**3 - s**2) * ways[1]
    )


_ENDINGS = (".xodr", ".odr")


class TraceRoad(NamedTuple):
    """OpenDRIVE file of a trace, and remarks on it."""

    path: Path
    notes: tuple[str, ...]


def road_of(path: Path, found: TraceRecording, folder: Path) -> TraceRoad | None:
    """The road of a trace; None where it has none.

    A map inside the file comes first, then the file that `map_reference` names beside the trace,
    then one with the trace's own name, then the lanes. Only the last part of a reference counts:
    traces name files of the machines that wrote them.

    Args:
        found: what the trace records.
        folder: for roads that are made, or taken out of the trace.

    Raises:
        InvalidFile: the map inside the file is no OpenDRIVE.
        UsageError: the lanes make no road map, or the folder can't be written.
    """
    reference = found.truth.map_reference
    attached = _attached(Trace(path).contents.maps, reference)
    if attached is not None:
        made = keep(
            attached.content, folder / f"{_plain(path.stem)}-{digest(attached.content)}.xodr"
        )
        _load(made, f"the map {attached.name!r} in the {attached.where} of {path.name}")
        return TraceRoad(
            made, (f"the road is the one in the trace's {attached.where} {attached.name!r}",)
        )
    for name in dict.fromkeys((_last(reference), f"{path.stem}.xodr")):
        beside = path.with_name(name) if name else None
        # The reference is a text of the trace: under a policy it must not open any file.
        if beside is not None and current().allows(beside) and beside.is_file():
            return TraceRoad(beside, (f"the road is {name} beside the trace",))
    lanes = drawn(found.truth, path.stem)
    if lanes is None:
        return None
    absent = (
        f"{_last(reference)}, which map_reference names, is not beside the trace: "
        if _last(reference)
        else ""
    )
    made = keep(lanes.content, folder / f"{_plain(path.stem)}-{digest(lanes.content)}.xodr")
    return TraceRoad(made, (f"{absent}{lanes.notes[0]}", *lanes.notes[1:]))


def _attached(maps: list[AttachedMap], reference: str) -> AttachedMap | None:
    """The map that a trace's reference names, else the first."""
    # Several maps may be attached: that of the reference is the one that was driven.
    named = [file for file in maps if _last(file.name) and _last(file.name) == _last(reference)]
    return next(iter([*named, *maps]), None)


def _load(path: Path, what: str) -> None:
    from xodr.reader import load

    try:
        load(path)
    except ToolchainError as error:
        error.message = f"{what}: {error.message}"
        raise


def _last(reference: str) -> str:
    """The file name in a reference to an OpenDRIVE file; empty for anything else."""
    name = PurePosixPath(reference.replace("\\", "/")).name
    return name if name.lower().endswith(_ENDINGS) and name.isprintable() else ""


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


def is_trace(path: Path) -> bool:
    """Whether a path is that of a trace, by its name."""
    return path.suffix.lower() in SUFFIXES and not path.is_dir()


def load_trace(path: Path, road: Path | None = None) -> RunResult:
    """Load the recording of an OSI trace as a run that tested nothing.

    Args:
        road: the OpenDRIVE file; by default what the trace has
            (`runner.exchange.traces.maps.road_of`). A trace without one has a plane.

    Raises:
        InvalidFile: the trace is damaged, or its map is no OpenDRIVE.
        Unsupported: its messages hold no ground truth.
        UsageError: its lanes make no road map.
    """
    found, folder = read(path), cache_folder("roads")
    remarks = list(found.remarks)
    if road is None:
        with writing("the road", folder):
            made = road_of(path, found, folder)
        remarks += made.notes if made is not None else ["the trace has no road: a plane"]
        road = made.path if made is not None else None
    recording = found.recording
    tracks = list(recording.tracks.values())
    ends = [float(track.columns["time"][-1]) for track in tracks]
    return RunResult(
        scenario=path,
        parameters={},
        status="completed",
        end_time=max(ends, default=0.0),
        verdict=Verdict(causes=(Cause("no-event", "a recorded trace: nothing was tested"),)),
        remarks=tuple(f"remark: {remark}" for remark in remarks),
        ego=found.ego,
        sut="none",
        settings={"timestep": recording.timestep, "seed": 0, "world": "recorded", "max_time": None},
        events=[],
        recording=Recording(tracks, recording.timestep, load(road) if road is not None else None),
    )
