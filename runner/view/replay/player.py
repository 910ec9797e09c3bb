"""Replay pages, one HTML file each that needs no network: their data, their text, and their names
in folders of results.

Data are JSON-able values: roads, participants, timeline, curves, and previews of a run's worst
moment. Positions are counted
from an origin near the runs, in cm; times in samples of a fixed length. Arrays are packed as text
(differences of quantised neighbours, variable-length integers, base64), which `page/play/data.js`
reads.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from runner.batch.outputs.report import evidence_table
from runner.judging.measures.measure import GREATEST_DECELERATION
from runner.recording import signal_states
from runner.view.page import page, write_page
from runner.view.replay import account as timeline
from runner.view.replay import scene_roads
from runner.view.replay.account import Stretches, account, main_partner, partners, stretches
from runner.view.replay.scene_roads import Area, marks, surfaces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from runner.judging.measures.criticality import Criticality
    from runner.judging.result import RunResult
    from runner.recording import Track
    from xodr.graph.network import RoadNetwork

REPLAY = "replay.html"
"""A run's page, in the folder of its results"""
PAIR = "before-and-after.html"
"""The page of a run beside what it was in an earlier batch, in the folder of its results"""
REPORT = "report.html"
"""A batch's page, in its output folder"""
TO_REPORT = f"../{REPORT}"
"""The address of a batch's page, from the pages of its runs"""
STYLES = ("base.css", "play/colours.css", "play/replay.css")
_FLAT = ("data", "drawing", "pair", "view", "charts", "timeline", "account", "controls")
_SOLID = ("gl", "ground", "bodies", "space")
SCRIPTS = (
    "dom.js",
    *(f"play/{part}.js" for part in _FLAT),
    *(f"solid/{part}.js" for part in _SOLID),
    "play/player.js",
)
"""Files of pages that play runs, beside `runner.view.page`"""
_GROUP = 7
"""Bits of a number in each byte; the eighth says that more follow."""


def pack(values: ArrayLike, step: float, order: int = 1) -> str:
    """Return a series of numbers as text.

    Args:
        values: finite numbers.
        step: what they are rounded to a multiple of.
        order: how often differences of neighbours are taken: 1 suits values that change little, 2
            those that change steadily.
    """
    numbers = np.rint(np.asarray(values, np.float64) / step).astype(np.int64)
    for _ in range(order):
        numbers = np.diff(numbers, prepend=0)
    # Zigzag: the sign goes into the lowest bit, so that small negative numbers stay short.
    return base64.b64encode(_varints(np.where(numbers < 0, -2 * numbers - 1, 2 * numbers))).decode()


def _varints(numbers: NDArray[np.int64]) -> bytes:
    """Natural numbers in groups of 7 bits, the lowest first."""
    count = max(1, -(-int(numbers.max(initial=0)).bit_length() // _GROUP))
    groups = numbers[:, None] >> (_GROUP * np.arange(count))
    used = groups > 0
    # 0 has one group, too.
    used[:, 0] = True
    groups &= 127
    groups[:, :-1] |= np.where(used[:, 1:], 128, 0)
    return groups[used].astype(np.uint8).tobytes()


def pack_lines(lines: Sequence[NDArray[np.float64]], step: float) -> list[str]:
    """Polylines as texts: their numbers of points, then x, y and, unless 0 everywhere, z of all
    points."""
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    lengths = [len(line) for line in lines]
    return [
        pack(lengths, 1.0, 0),
        # Flat roads need no heights: pages stay small.
        *(pack(axis, step) for n, axis in enumerate(points.T) if n < 2 or _matters(axis, step)),
    ]


def _matters(values: NDArray[np.float64], step: float) -> bool:
    return bool(np.any(np.abs(values) >= step / 2))


LENGTH_STEP, ANGLE_STEP, SPEED_STEP = 0.01, 0.002, 0.01
"""Rounding of positions (m), headings (rad) and speeds (m/s)"""
_SAMPLE = 0.05
"""Least time between samples, s"""
_SURROUNDINGS = 200.0
"""Margin (m) around the paths of entities in which roads are drawn"""
_HEIGHT_STEP = 0.1
"""Rounding of heights of objects, m"""
_GREATEST = 1000.0
"""Values of curves beyond this are cut off there"""


class SceneArea(NamedTuple):
    """Rectangle of the roads of a scene (m), and origin of its positions (m)."""

    area: Area
    origin: tuple[int, int]

    @classmethod
    def of(cls, results: Sequence[RunResult]) -> SceneArea:
        """SceneArea of the paths of all participants."""
        area = union(extent(result.recording.tracks.values()) for result in results)
        # In whole metres, so that rounded coordinates are those of the recording.
        origin = (round((area.west + area.east) / 2), round((area.south + area.north) / 2))
        return cls(area.wider(_SURROUNDINGS), origin)

    def hold(self, results: Sequence[RunResult]) -> bool:
        """Whether the paths of all participants lie within, with half of the margin."""
        area = union(extent(result.recording.tracks.values()) for result in results)
        west, south, east, north = area.wider(_SURROUNDINGS / 2)
        own = self.area
        return own.west <= west and own.south <= south and own.east >= east and own.north >= north


def scene(results: Sequence[RunResult]) -> dict[str, Any]:
    """One run, or two to be compared: roads that both are on are there once."""
    around = SceneArea.of(results)
    return {
        "steps": steps(),
        "roads": roads_of(results, around),
        "runs": runs_of_scene(results, around),
    }


def roads_of(results: Sequence[RunResult], around: SceneArea) -> list[dict[str, Any]]:
    """The roads of runs within their surroundings, each once."""
    return [road_of(network, around.area, around.origin) for network in _networks(results)]


def runs_of_scene(results: Sequence[RunResult], around: SceneArea) -> list[dict[str, Any]]:
    """Runs counted from an origin; `road` is the index of a run's among `roads_of`, or None."""
    places = {network.path: index for index, network in enumerate(_networks(results))}
    found = []
    for result in results:
        network = result.recording.network
        road = None if network is None else places[network.path]
        found.append(_run(result, around.origin) | {"road": road})
    return found


def _networks(results: Sequence[RunResult]) -> list[RoadNetwork]:
    by_path = {
        network.path: network
        for result in results
        if (network := result.recording.network) is not None
    }
    return list(by_path.values())


def steps() -> dict[str, float]:
    """Return the rounding of numbers, and the deceleration (m/s²) that no vehicle exceeds."""
    return {
        "length": LENGTH_STEP,
        "angle": ANGLE_STEP,
        "speed": SPEED_STEP,
        "braking": GREATEST_DECELERATION,
    }


def extent(tracks: Iterable[Track]) -> Area:
    """Bounding rectangle of all paths; around the origin without entities."""
    columns = [track.columns for track in tracks if len(track.columns["time"])]
    if not columns:
        return Area(0.0, 0.0, 0.0, 0.0)
    x, y = (np.concatenate([column[axis] for column in columns]) for axis in ("x", "y"))
    return Area(float(x.min()), float(y.min()), float(x.max()), float(y.max()))


def union(areas: Iterable[Area]) -> Area:
    """Rectangle around several rectangles."""
    west, south, east, north = zip(*areas, strict=True)
    return Area(min(west), min(south), max(east), max(north))


def road_of(
    network: RoadNetwork, area: Area, origin: tuple[int, int], heights: bool = True
) -> dict[str, Any]:
    """The roads within an area, counted from an origin; without `heights`, no more than a view from
    above needs."""
    axes = 3 if heights else 2
    # Steps from a near origin are short numbers: pages stay small.
    base = np.array([*origin, 0.0])

    def packed(lines: Sequence[NDArray[np.float64]]) -> list[str]:
        return pack_lines([(line - base)[:, :axes] for line in lines], LENGTH_STEP)

    blocks = scene_roads.objects(network, area)
    return {
        "surfaces": [
            {"look": look, "lines": packed(rings)}
            for look, rings in surfaces(network, area).items()
        ],
        "marks": [
            look._asdict() | {"lines": packed(lines)}
            for look, lines in marks(network, area).items()
        ],
        "objects": [
            {"look": look, "lines": packed([block.ring for block in those])}
            | (
                {"heights": pack([block.height for block in those], _HEIGHT_STEP)}
                if heights
                else {}
            )
            for look, those in blocks.items()
        ],
        "signals": [
            _signal(signal, origin, heights) for signal in scene_roads.signals(network, area)
        ],
    }


_ABOVE = ("id", "x", "y", "name", "dynamic")
"""Values of a signal that a view from above needs"""


def _signal(signal: dict[str, Any], origin: tuple[int, int], heights: bool) -> dict[str, Any]:
    found = {
        name: round(value, 2) if isinstance(value, float) else value
        for name, value in signal.items()
    }
    found |= {"x": round(signal["x"] - origin[0], 2), "y": round(signal["y"] - origin[1], 2)}
    return found if heights else {name: found[name] for name in _ABOVE}


def _run(result: RunResult, origin: tuple[int, int]) -> dict[str, Any]:
    dt = result.settings["timestep"]
    stride = max(1, round(_SAMPLE / dt))
    ego = result.recording.tracks.get(result.ego) if result.ego is not None else None
    return {
        "name": result.name,
        "account": account(result),
        "verdict": result.verdict.outcome,
        "reasons": _reasons(result),
        "remarks": list(result.remarks),
        "evidence": evidence_table(result.verdict),
        "status": result.status,
        "end": result.end_time,
        "sut": result.sut,
        "ego": result.ego,
        "parameters": result.parameters,
        "settings": {name: str(value) for name, value in result.settings.items()},
        "sample": stride * dt,
        "tracks": [
            track_of(track, dt, stride, origin) for track in result.recording.tracks.values()
        ],
        "rows": [
            [row.level, row.label, row.subject, row.bars, row.who]
            for row in timeline.rows(result.events, result.actors, result.recording.tracks)
        ],
        "actors": result.actors,
        "events": [list(entry) for entry in result.events if timeline.is_shown(entry)],
        "signals": signal_states(result.events),
        "curves": [] if ego is None else _curves(ego, result.criticality, dt, stride),
        **_pairs(result.criticality, dt, stride),
    }


def _reasons(result: RunResult) -> list[str]:
    """Reasons for a failed or inconclusive run, without the contact that the
    account begins with.
    """
    impact = result.criticality.impact if result.criticality is not None else None
    # As `runner.judging.verdict.judge` words it.
    first = f"collision with {impact.other} at {impact.time:.2f} s" if impact is not None else ""
    return [reason for reason in result.verdict.reasons if reason != first]


def _pairs(measures: Criticality | None, dt: float, stride: int) -> dict[str, Stretches]:
    """Return partners and leads over time, each with the sample from which it applies."""
    if measures is None:
        return {"partners": [], "leads": []}
    return {
        "partners": partners(measures, dt, stride),
        "leads": stretches(measures.time, measures.lead, dt, stride),
    }


# participants -------------------------------------------------------------------------------


def track_of(
    track: Track, dt: float, stride: int, origin: tuple[int, int], heights: bool = True
) -> dict[str, Any]:
    """Participant at every `stride`-th step of `dt` (s), relative to an origin; `heights` as in
    `road_of`."""
    columns, box = track.columns, track.box
    # Differences of neighbours stay small over ±π.
    heading = np.unwrap(columns["h"])
    return {
        "name": track.name,
        "kind": track.kind,
        "category": track.category,
        "box": [
            round(value, 3) for value in (box.x, box.y, box.length, box.width, box.z, box.height)
        ],
        "parts": [
            {
                "start": start,
                "x": pack(columns["x"][rows] - origin[0], LENGTH_STEP, 2),
                "y": pack(columns["y"][rows] - origin[1], LENGTH_STEP, 2),
                "h": pack(heading[rows], ANGLE_STEP, 2),
                "v": pack(columns["speed"][rows], SPEED_STEP, 2),
            }
            | {
                name: pack(columns[name][rows], step, 2)
                for name, step in (("z", LENGTH_STEP), ("pitch", ANGLE_STEP), ("roll", ANGLE_STEP))
                if heights and _matters(columns[name], step)
            }
            for start, rows in _parts(columns["time"], np.ones(len(heading), bool), dt, stride)
        ],
    }


def _parts(
    time: NDArray[np.float64], there: NDArray[np.bool_], dt: float, stride: int
) -> list[tuple[int, NDArray[np.int64]]]:
    """Stretches of consecutive samples with a value: number of the first sample, and rows."""
    # Times are rounded: the nearest step is meant.
    ticks = np.rint(time / dt).astype(np.int64)
    rows = np.flatnonzero(there & (ticks % stride == 0))
    samples = ticks[rows] // stride
    stretches = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(samples) != 1) + 1)
    return [(int(samples[stretch[0]]), rows[stretch]) for stretch in stretches if len(stretch)]


# curves -------------------------------------------------------------------------------------

_MEASURES = (
    ("ttc", "Time to collision", "s"),
    ("thw", "Time headway", "s"),
    ("rss_margin_ad_rss", "RSS margin", "m"),
    ("distance", "Distance to the nearest", "m"),
    ("drac", "Deceleration to avoid a crash", "m/s²"),
)


def _curves(
    ego: Track, criticality: Criticality | None, dt: float, stride: int
) -> list[dict[str, Any]]:
    columns = ego.columns
    always = np.ones(len(columns["time"]), bool)
    curves = [
        ("speed", "Ego speed", "m/s", columns["speed"], always),
        ("acceleration", "Ego acceleration", "m/s²", columns["acceleration"], always),
    ]
    if criticality is not None:
        table = criticality.table()
        curves += [
            (name, label, unit, table[name], table[f"{name}_valid"])
            for name, label, unit in _MEASURES
        ]
    return [
        {
            "id": name,
            "label": label,
            "unit": unit,
            "parts": [
                {
                    "start": start,
                    "values": pack(np.clip(values[rows], -_GREATEST, _GREATEST), SPEED_STEP),
                }
                for start, rows in _parts(columns["time"], valid, dt, stride)
            ],
        }
        for name, label, unit, values, valid in curves
    ]


_BEFORE, _AFTER = 3.5, 1.0
"""Time (s) played before and after the worst moment"""
_AROUND = 30.0
"""Margin (m) around the ego and the other entity in which roads and entities are drawn"""
_PREVIEW_STEP = 0.1
"""Least time between samples, s"""


def preview(result: RunResult) -> dict[str, Any] | None:
    """Return the data of `page/play/preview.js`; None for runs without an encounter."""
    measures = result.criticality
    if measures is None or measures.conflict is None or result.ego is None:
        return None
    begin, end = (
        max(0.0, measures.conflict - _BEFORE),
        min(result.end_time, measures.conflict + _AFTER),
    )
    # A preview is a few seconds: whole tracks would make tables of runs large.
    tracks = {name: _during(track, begin, end) for name, track in result.recording.tracks.items()}
    pair = [
        name
        for name in (result.ego, main_partner(measures))
        if name in tracks and len(tracks[name].columns["time"])
    ]
    area = union(extent([tracks[name]]) for name in pair).wider(_AROUND)
    origin = (round((area.west + area.east) / 2), round((area.south + area.north) / 2))
    dt = result.settings["timestep"]
    stride = max(1, round(_PREVIEW_STEP / dt))
    network = result.recording.network
    return {
        "steps": steps(),
        "road": road_of(network, area, origin, heights=False) if network is not None else None,
        "sample": stride * dt,
        "from": begin,
        "to": end,
        "ego": result.ego,
        "pair": pair,
        "told": account(result)[0].text,
        "tracks": [
            track_of(track, dt, stride, origin, heights=False)
            for track in tracks.values()
            if len(track.columns["time"]) and area.meets(extent([track]))
        ],
    }


def _during(track: Track, begin: float, end: float) -> Track:
    """A participant from one instant to another (s)."""
    time = track.columns["time"]
    rows = (time >= begin - 1e-6) & (time <= end + 1e-6)
    columns = {name: values[rows] for name, values in track.columns.items()}
    return replace(track, read=lambda: columns)


def replay_page(results: Sequence[RunResult], report: str | None = None) -> str:
    """The page of one run, or of two side by side: the same runs give the same text.

    Args:
        report: where the report lies that the page leads back to, as a relative address; None where
            there is none.
    """
    title = " and ".join(result.name for result in results)
    return page(f"{title} – replay", STYLES, SCRIPTS, {**scene(results), "report": report})


def keep_replay(result: RunResult, out: Path | None) -> None:
    """Write the page of a run into the folder of its results below `out`, or into the working
    directory."""
    write_replay([result], kept_replay(result.name, out), None if out is None else TO_REPORT)


def kept_replay(name: str, out: Path | None) -> Path:
    """The page of a run by its name: in the folder of its results below `out`, or in the working
    directory."""
    return Path(f"{name}.html") if out is None else out / name / REPLAY


def write_replay(results: Sequence[RunResult], path: Path, report: str | None = None) -> None:
    """Write the page of one run, or of two side by side; arguments as in `replay_page`.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> xt.replay([result], Path("replay.html"))
        >>> Path("replay.html").is_file()
        True
    """
    write_page(path, replay_page(results, report))
