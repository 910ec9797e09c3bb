"""Page of a catalogue: filters, distributions, exposure, and films of all scenarios in one HTML
file without network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from recognition.catalogue.exposure import EVERYWHERE
from recognition.scenes.cut import Excerpt, Part
from runner.view.page import page
from schemas.common.array_types import FloatArray
from xodr.graph.network import RoadNetwork
from xodr.lookup.arrays import sample, stations

_FOLDER = Path(__file__).parent
_STYLES = ("base.css", "report.css", str(_FOLDER / "catalogue.css"))
_SCRIPTS = (
    "dom.js",
    "axes.js",
    "question.js",
    str(_FOLDER / "film.js"),
    str(_FOLDER / "catalogue.js"),
)
MEASURES = {
    "ego_speed": "m/s", "partner_speed": "m/s", "closing_speed": "m/s", "gap": "m", "pair_thw": "s",
    "pair_ttc": "s",
    "pair_drac": "m/s²", "min_ttc": "s", "min_thw": "s", "min_distance": "m", "limit": "m/s",
    "severity": "", "confidence": "", "time": "s",
}  # fmt: skip
"""Columns of the index that the page filters, orders and counts by, with their units"""
_NAMES = ("class", "site", "trust", "road_kind", "weather", "daylight", "surface", "road", "state")
"""Columns with few different values"""
_TEXTS = ("file", "maneuver", "vehicle", "partner", "why", "critical")
FILM_STEP = 0.5
"""Time (s) between samples of a film"""
_AROUND = 5.0
"""Time (s) before and after the event in a film of a catalogue"""
_MOST, _REACH = 6, 70.0
"""Participants beside the ego in a film of a catalogue, and distance (m) from it within which they
appear"""
_TOLERANCE = 0.1
"""Tolerance (m) of simplified borders of lanes"""

Film = list[Any]
"""Place of the ego (x, y, m), first sample (s before the event), then per participant: length and
width (dm), number of the first sample, and x (dm), y (dm), heading (0.01 rad) of each sample, the
first as it is, the others as differences"""


def film(
    scene: Excerpt, time: float, partner: str | None, around: float = _AROUND, most: int = _MOST
) -> Film:
    """Return the motion about an event: of the ego, of its partner, and of the nearest others.

    Args:
        time: of the event, s.
        partner: name of its track, if any.
        around: time before and after the event, s.
        most: participants beside the ego.
    """
    times = np.arange(
        max(scene.start, time - around), min(scene.end, time + around) + 1e-6, FILM_STEP
    )
    ego, *others = ((part, *_moved(part, times)) for part in scene.parts)
    x, y, _ = ego[2][:, int(np.abs(times - time).argmin()) - ego[1]].tolist()
    near = []
    for one in others:
        part, first, moved = one
        both = slice(max(first, ego[1]), min(first + moved.shape[1], ego[1] + ego[2].shape[1]))
        if moved.shape[1] < 2 or both.start >= both.stop:
            continue
        mine, theirs = (
            track[2][:2, both.start - track[1] : both.stop - track[1]] for track in (ego, one)
        )
        apart = float(np.hypot(*(mine - theirs)).min())
        near.append((part.track.name != partner, apart, part.name, one))
    chosen = [
        ego,
        *(
            one
            for other, apart, _, one in sorted(near, key=lambda candidate: candidate[:3])[:most]
            if not other or apart <= _REACH
        ),
    ]
    paired = partner is not None and len(chosen) > 1 and chosen[1][0].track.name == partner
    films = [_drawn(part, first, moved, x, y) for part, first, moved in chosen]
    return [round(x, 1), round(y, 1), round(float(times[0]) - time, 2), int(paired), *films]


def _moved(part: Part, times: FloatArray) -> tuple[int, FloatArray]:
    """Number of the first sample at which a participant is there; x, y (m) and heading (rad) of its
    samples (3, n)."""
    columns = part.track.columns
    own = columns["time"]
    first, last = np.searchsorted(times, own[0] - 1e-6), np.searchsorted(times, own[-1] + 1e-6)
    inside = times[first:last]
    if not len(inside):
        return int(first), np.zeros((3, 0))
    rows = slice(
        max(int(np.searchsorted(own, inside[0])) - 1, 0), int(np.searchsorted(own, inside[-1])) + 1
    )
    heading = np.unwrap(columns["h"][rows])
    x, y, h = (
        np.interp(inside, own[rows], values)
        for values in (columns["x"][rows], columns["y"][rows], heading)
    )
    box = part.track.box
    return int(first), np.stack(
        [x + box.x * np.cos(h) - box.y * np.sin(h), y + box.x * np.sin(h) + box.y * np.cos(h), h]
    )


def _drawn(part: Part, first: int, moved: FloatArray, x: float, y: float) -> list[int]:
    box = part.track.box
    whole = np.round((moved - [[x], [y], [0.0]]) * [[10.0], [10.0], [100.0]]).astype(np.int64)
    steps = np.diff(whole, axis=1, prepend=0)
    return [round(10 * box.length), round(10 * box.width), first, *steps.T.ravel().tolist()]


def lanes(network: RoadNetwork) -> list[list[int]]:
    """Return the borders of all lanes: x and y (dm) of each point, the first as it is, the others
    as differences."""
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
            for lane in section.lanes.values():
                line = shapely.LineString(
                    sample(road, s, [lane.outer(one) for one in s.tolist()])[:, :2]
                )
                points = np.round(
                    10.0 * shapely.get_coordinates(shapely.simplify(line, _TOLERANCE))
                ).astype(np.int64)
                found.append(np.diff(points, axis=0, prepend=0).ravel().tolist())
    return found


def catalogue_page(
    rows: Sequence[Mapping[str, Any]],
    films: Mapping[str, Film],
    roads: Mapping[str, list[list[int]]],
    exposure: Iterable[Mapping[str, Any]],
) -> str:
    """Return the page.

    Args:
        rows: of the index.
        films: by the scenario's file (`film`).
        roads: borders of lanes by the road's file (`lanes`).
        exposure: rows of `exposure.rates`.
    """
    names = {
        name: sorted({str(row[name]) for row in rows if row[name] is not None}) for name in _NAMES
    }
    codes = {
        name: {value: code for code, value in enumerate(values)} for name, values in names.items()
    }
    data = {
        "names": names,
        "coded": {name: [codes[name].get(row[name], -1) for row in rows] for name in _NAMES},
        "texts": {name: [row[name] for row in rows] for name in _TEXTS},
        "partial": [int(bool(row["partial"])) for row in rows],
        "units": MEASURES,
        "measures": {name: [row[name] for row in rows] for name in MEASURES},
        "films": [films.get(row["file"]) for row in rows],
        "step": FILM_STEP,
        "roads": [roads[name] for name in names["road"]],
        "everywhere": EVERYWHERE,
        "exposure": list(exposure),
    }
    return page("Catalogue of recorded scenarios", _STYLES, _SCRIPTS, data)
