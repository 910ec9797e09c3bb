"""Items of a draw as files: page, pictures, numbers, a table for answers; and the key that tells
where they are from."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.judging.draws import CLASSES, Item, Library
from recognition.catalogue.writing.page import FILM_STEP, film, lanes
from recognition.scenes.cut import SceneCutter, Scope
from runner.view.page import page
from schemas.common.terminal.text import csv_text
from xodr.lookup.arrays import sample, stations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from runner.recording import Recording, Track
    from schemas.common.array_types import FloatArray
    from xodr.graph.network import RoadNetwork

COLUMNS = ("item", "answer", "class", "time", "reason")
"""Columns of a table of answers"""
_FOLDER = Path(__file__).parent
_AROUND = 6.0
"""Time (s) before and after a finding that is shown"""
_MOMENTS = (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0)
_PANELS = 8
_NEAR, _OTHERS = 0.1, 4
"""Rows count as of a time within so much (s); number of other participants in the numbers"""
_SIGHT = 150.0
"""Distance (m) within which the next vehicle ahead is named"""
_CLOSE, _FAR, _FILMED = 35.0, 90.0, 20
"""Least and greatest reach (m) of a moment's picture, which shows the partner; most participants
beside the ego in a film"""


def write_items(items: Sequence[Item], library: Library, out: Path, key: Path) -> None:
    """Write the page, pictures, texts and the table for answers of a draw into a folder, and its
    key beside it."""
    import matplotlib as mpl

    mpl.use("Agg")
    out.mkdir(parents=True, exist_ok=True)
    films: dict[int, list[Any]] = {}
    roads: dict[str, list[list[int]]] = {}
    texts: dict[int, str] = {}
    for number in sorted(range(len(items)), key=lambda index: items[index].recording):
        item = items[number]
        recording, network = library.recording(item.recording), library.network(item.recording)
        start, end = _shown(item)
        texts[number] = _text(number, item, recording, network)
        (out / f"{number:03}.txt").write_text(texts[number], encoding="utf-8")
        _picture(out / f"{number:03}.png", number, item, recording, network)
        scene = SceneCutter(recording, Scope()).cut(item.vehicle, start, end)
        middle = item.finding.time if item.finding else start
        partner = item.finding.partner if item.finding else None
        films[number] = film(scene, middle, partner, max(middle - start, end - middle), _FILMED)
        if item.recording not in roads:
            roads[item.recording] = lanes(network)
    listed = [*roads]
    rows = [(number, "", "", "", "") for number in range(len(items))]
    (out / "answers.csv").write_text(csv_text([COLUMNS, *rows]), encoding="utf-8", newline="\n")
    data = {
        "films": [films[number] for number in range(len(items))],
        "roads": [roads[name] for name in listed],
        "coded": {"road": [listed.index(item.recording) for item in items]},
        "step": FILM_STEP,
        "times": [item.finding.time if item.finding else item.start for item in items],
        "items": [
            {
                "title": item.finding.title if item.finding and not item.hidden else None,
                "text": texts[n],
            }
            for n, item in enumerate(items)
        ],
        "classes": list(CLASSES),
        "columns": list(COLUMNS),
    }
    styles = ("base.css", "report.css", str(_FOLDER / "judging.css"))
    films_script = _FOLDER.parents[1] / "recognition" / "catalogue" / "writing" / "page" / "film.js"
    scripts = ("dom.js", "axes.js", str(films_script), str(_FOLDER / "judging.js"))
    (out / "ITEMS.md").write_bytes((_FOLDER / "ITEMS.md").read_bytes())
    (out / "index.html").write_text(
        page("Label recorded manoeuvres", styles, scripts, data), encoding="utf-8"
    )
    told = [{**asdict(item), "set": library.sets[item.recording]} for item in items]
    key.parent.mkdir(parents=True, exist_ok=True)
    key.write_text(
        json.dumps({"items": told}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )


def _shown(item: Item) -> tuple[float, float]:
    """Stretch of the recording that is shown, s."""
    return (
        (item.start, item.end)
        if item.finding is None
        else (item.start - _AROUND, item.end + _AROUND)
    )


# numbers ------------------------------------------------------------------------------------


def _text(number: int, item: Item, recording: Recording, network: RoadNetwork) -> str:
    """Describe an item second by second: places on the map, motion, and positions of others
    relative to the ego."""
    ego = recording.tracks[item.vehicle]
    finding = item.finding
    size = f"{ego.category}, {ego.box.length:.1f} m long"
    if finding is None:
        head = (
            f"item {number}: list all events of vehicle {ego.name} ({size}) from {item.start:.1f} "
            f"to {item.end:.1f} s"
        )
        times, partner = np.arange(item.start, item.end + 1e-6, 1.0), None
    else:
        head = (
            f"item {number}: {'which event is this' if item.hidden else f'is this {finding.title}'}"
            f"? ego {ego.name} ({size}), at {finding.time:.1f} s"
        )
        head += f", partner {finding.partner}" if finding.partner else ""
        times, partner = (
            np.arange(-5.0, 5.1, 1.0) + finding.time,
            recording.tracks.get(finding.partner or ""),
        )
    kinds = {each.category for each in recording.tracks.values()}
    start = min(float(each.columns["time"][0]) for each in recording.tracks.values())
    end = max(float(each.columns["time"][-1]) for each in recording.tracks.values())
    lines = [
        head,
        (
            f"recorded each {recording.timestep:g} s from {start:.1f} to {end:.1f} s: "
            f"{', '.join(sorted(kinds))}"
        ),
    ]
    for time in times.tolist():
        at = _at(ego, time)
        if at is None:
            continue
        told = [f"ego {_place(network, at)} {at['speed']:.1f} m/s {at['acceleration']:+.1f} m/s²"]
        if partner is not None:
            told.append(f"partner {_seen(network, ego, at, partner, time)}")
        others = [each for each in recording.tracks.values() if each not in (ego, partner)]
        nearest = _nearest(at, others, time)
        told += [_seen(network, ego, at, each, time) for each in nearest]
        leader = _leader(network, at, [partner, *others] if partner else others, time)
        if leader is None:
            told.append(f"nobody ahead in its lane within {_SIGHT:g} m")
        elif leader not in (partner, *nearest):
            told.append(f"next in its lane: {_seen(network, ego, at, leader, time)}")
        lines.append(f"{time:.1f} s  " + "\n         ".join(told))
    return "\n".join(lines) + "\n"


def _at(track: Track, time: float) -> dict[str, float] | None:
    """Values of a track at the row nearest to a time; None without a row within `_NEAR`."""
    columns = track.columns
    row = int(np.abs(columns["time"] - time).argmin())
    if abs(columns["time"][row] - time) > _NEAR:
        return None
    return {name: float(columns[name][row]) for name in ("x", "y", "h", "speed", "acceleration")}


def _place(network: RoadNetwork, at: dict[str, float]) -> str:
    """Road, lane, place and heading, with what the map says of the road there."""
    point = network.locate(at["x"], at["y"], None, at["h"])
    road = network.roads[point.road_id]
    left = road.direction(point.lane_id, point.s) * point.offset if point.lane_id else point.offset
    limit = road.speed_limit(point.s, point.lane_id)
    of_map = (
        ("junction", road.junction_id),
        ("", road.road_type(point.s)),
        ("limit", limit and f"{limit:.0f}"),
    )
    said = " ".join(
        f"{name} {value}".strip() for name, value in of_map if value not in (None, "unknown")
    )
    width, heading = road.lane_width(point.s, point.lane_id), np.degrees(at["h"]) % 360.0
    lane = f"road {road.id} lane {point.lane_id} ({said}) s {point.s:.0f} of {road.length:.0f}"
    return f"{lane} left {left:+.1f} of width {width:.1f} heading {heading:.0f}°"


def _seen(network: RoadNetwork, ego: Track, at: dict[str, float], other: Track, time: float) -> str:
    """Describe another participant: offset ahead and to the left of the ego, gap between the boxes,
    speed, lane."""
    there = _at(other, time)
    if there is None:
        return f"{other.name} not there"
    ahead, left = _from(at, there)
    point = network.locate(there["x"], there["y"], None, there["h"])
    turned = np.degrees(there["h"] - at["h"] + np.pi) % 360.0 - 180.0
    gap = max(abs(ahead) - 0.5 * (ego.box.length + other.box.length), 0.0)
    lane = f"{point.road_id}/{point.lane_id}"
    where = f"{ahead:+.0f} ahead {left:+.1f} left gap {gap:.0f} {turned:+.0f}°"
    return f"{other.name} ({other.category}) {where} {there['speed']:.1f} m/s on {lane}"


def _nearest(at: dict[str, float], others: Iterable[Track], time: float) -> list[Track]:
    there = [(each, place) for each in others if (place := _at(each, time)) is not None]
    return [
        each
        for each, place in sorted(there, key=lambda one: float(np.hypot(*_from(at, one[1]))))[
            :_OTHERS
        ]
    ]


def _leader(
    network: RoadNetwork, at: dict[str, float], others: Iterable[Track], time: float
) -> Track | None:
    """The next participant ahead on the ego's lane, or straight ahead of it within half a lane."""
    mine = network.locate(at["x"], at["y"], None, at["h"])
    found = []
    for each in others:
        there = _at(each, time)
        ahead, left = _from(at, there) if there is not None else (0.0, 0.0)
        if (
            there is None
            or not 0.0 < ahead < _SIGHT
            or abs(left) > 0.5 * ahead + 4.0
            or np.cos(there["h"] - at["h"]) < 0.0
        ):
            continue
        point = network.locate(there["x"], there["y"], None, there["h"])
        if (point.road_id, point.lane_id) == (mine.road_id, mine.lane_id) or abs(left) < 1.5:
            found.append((ahead, each.name, each))
    return min(found)[2] if found else None


def _from(at: dict[str, float], there: dict[str, float]) -> tuple[float, float]:
    """Return the offset of one vehicle ahead and to the left of another, m."""
    x, y, sin, cos = there["x"] - at["x"], there["y"] - at["y"], np.sin(at["h"]), np.cos(at["h"])
    return float(cos * x + sin * y), float(cos * y - sin * x)


# pictures -----------------------------------------------------------------------------------


def _picture(
    path: Path, number: int, item: Item, recording: Recording, network: RoadNetwork
) -> None:
    """Draw paths in the first panel and moments in the others; the ego is blue, its partner red."""
    from matplotlib.figure import Figure

    finding, (start, end) = item.finding, _shown(item)
    own = recording.tracks[item.vehicle].columns["time"]
    if finding is not None:
        moments = [finding.time + each for each in _MOMENTS]
    else:
        moments = np.linspace(start, end, _PANELS - 1).tolist()
    figure = Figure(figsize=(20, 10.4))
    first, *others = figure.subplots(2, _PANELS // 2).ravel()
    figure.subplots_adjust(0.005, 0.005, 0.995, 0.93, 0.02, 0.06)
    borders = _borders(network)
    _paths(first, item, recording, borders, max(start, own[0]), min(end, own[-1]))
    for axes, time in zip(others, moments, strict=False):
        _moment(axes, item, recording, borders, time)
    question = "all events" if not finding else "which event" if item.hidden else finding.title
    figure.suptitle(
        f"item {number}: {question}, ego {item.vehicle} (blue)"
        + (f", partner {finding.partner} (red)" if finding and finding.partner else "")
    )
    figure.savefig(path, dpi=65)


def _borders(network: RoadNetwork) -> list[FloatArray]:
    """Outer borders of all lanes, m."""
    found = []
    for road in network.roads.values():
        everywhere = stations(road)
        for section in road.sections:
            s = np.array(
                [
                    section.s,
                    *everywhere[(everywhere > section.s) & (everywhere < section.end)],
                    section.end - 1e-6,
                ]
            )
            found += [
                sample(road, s, [lane.outer(one) for one in s.tolist()])[:, :2]
                for lane in section.lanes.values()
            ]
    return found


def _paths(
    axes: Axes,
    item: Item,
    recording: Recording,
    borders: list[FloatArray],
    start: float,
    end: float,
) -> None:
    """Draw the ways of all participants in a stretch, with times along that of the ego."""
    columns = recording.tracks[item.vehicle].columns
    rows = (columns["time"] >= start) & (columns["time"] <= end)
    x, y = columns["x"][rows], columns["y"][rows]
    reach = max(_CLOSE, 0.6 * float(max(np.ptp(x), np.ptp(y))))
    middle = 0.5 * float(x.min() + x.max()), 0.5 * float(y.min() + y.max())
    _draw(axes, borders, *middle, reach)
    for track in recording.tracks.values():
        theirs = track.columns
        seen = (theirs["time"] >= start) & (theirs["time"] <= end)
        seen &= np.hypot(theirs["x"] - middle[0], theirs["y"] - middle[1]) < 1.5 * reach
        if seen.any():
            color, width = _colour(item, track)
            axes.plot(theirs["x"][seen], theirs["y"][seen], color=color, linewidth=width)
    for time in np.arange(np.ceil(start), end, 2.0):
        row = int(np.abs(columns["time"] - time).argmin())
        axes.plot(columns["x"][row], columns["y"][row], "b.", markersize=4)
        axes.annotate(f"{time:.0f}", (columns["x"][row], columns["y"][row]), fontsize=7)
    _view(axes, *middle, reach)
    axes.set_title(f"paths {start:.1f} to {end:.1f} s", fontsize=9)


def _moment(
    axes: Axes, item: Item, recording: Recording, borders: list[FloatArray], time: float
) -> None:
    """Draw all participants around the ego at a time, with their names and speeds."""
    from matplotlib.patches import Polygon

    ego = _at(recording.tracks[item.vehicle], time)
    if ego is None:
        axes.set_axis_off()
        axes.set_title(f"{time:.1f} s: ego not recorded", fontsize=9)
        return
    partner = recording.tracks.get(item.finding.partner or "") if item.finding else None
    met = _at(partner, time) if partner is not None else None
    apart = float(np.hypot(met["x"] - ego["x"], met["y"] - ego["y"])) if met is not None else 0.0
    reach = float(np.clip(apart + 8.0, _CLOSE, _FAR))
    _draw(axes, borders, ego["x"], ego["y"], reach)
    for track in recording.tracks.values():
        there = _at(track, time)
        if there is None or np.hypot(there["x"] - ego["x"], there["y"] - ego["y"]) > 1.4 * reach:
            continue
        color, _ = _colour(item, track)
        ahead, left = (
            np.array([np.cos(there["h"]), np.sin(there["h"])]),
            np.array([-np.sin(there["h"]), np.cos(there["h"])]),
        )
        middle = np.array([there["x"], there["y"]]) + track.box.x * ahead
        long, wide = 0.5 * track.box.length * ahead, 0.5 * track.box.width * left
        nose = middle + 1.3 * long
        axes.add_patch(
            Polygon(
                [
                    middle - long - wide,
                    middle + long - wide,
                    nose,
                    middle + long + wide,
                    middle - long + wide,
                ],
                color=color,
                alpha=0.7,
            )
        )
        axes.annotate(f"{track.name}  {there['speed']:.0f}", middle, fontsize=6, clip_on=True)
    _view(axes, ego["x"], ego["y"], reach)
    axes.set_title(f"{time:.1f} s, {ego['speed']:.1f} m/s", fontsize=9)


def _colour(item: Item, track: Track) -> tuple[str, float]:
    if track.name == item.vehicle:
        return "tab:blue", 2.5
    return (
        ("tab:red", 2.0) if item.finding and track.name == item.finding.partner else ("0.55", 0.8)
    )


def _draw(axes: Axes, borders: list[FloatArray], x: float, y: float, reach: float) -> None:
    """Draw the borders of lanes that may be in a view."""
    from matplotlib.collections import LineCollection

    low, high = np.array([x - reach, y - reach]), np.array([x + reach, y + reach])
    near = [
        line
        for line in borders
        if (line.max(axis=0) >= low).all() and (line.min(axis=0) <= high).all()
    ]
    axes.add_collection(LineCollection(near, colors="0.75", linewidths=0.7), autolim=False)


def _view(axes: Axes, x: float, y: float, reach: float) -> None:
    axes.set(
        xlim=(x - reach, x + reach),
        ylim=(y - reach, y + reach),
        aspect="equal",
        xticks=[],
        yticks=[],
    )
    axes.plot(
        [x - 0.95 * reach, x - 0.95 * reach + 10.0], [y - 0.95 * reach] * 2, "k-", linewidth=2
    )
    axes.annotate("10 m", (x - 0.95 * reach, y - 0.93 * reach), fontsize=7)
