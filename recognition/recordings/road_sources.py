"""Roads of recordings without an OpenDRIVE file: highD's markings, lateral positions of traffic,
Lanelet2 maps."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import xodr
from recognition.recordings.source import SiteRoad
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import scratch
from schemas.common.storage import digest, keep, read_object, write_object, writing
from xodr.builders.elements import LaneDesign, PlanPose, RoadDesign, RoadMap, SectionDesign, line
from xodr.model.geometry import Cubic

if TYPE_CHECKING:
    from xodr.formats.lanelet2.lanelet import Lanelet
    from xodr.formats.lanelet2.reader import Crosswalk


def keep_road(content: bytes, site: str, folder: Path) -> Path:
    """Write the OpenDRIVE file of a site; named by its own content, so that roles that a person
    edited stay with it."""
    name = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in site)
    return keep(content, folder / f"{name}-{digest(content)}.xodr")


def converted(osm: Path, origin: tuple[float, float] | None, folder: Path) -> SiteRoad:
    """The road of a Lanelet2 map, made once for each content of the map.

    Args:
        origin: latitude and longitude (degrees) of the origin of its coordinates, where they are
            known.
    """
    return _converted(osm, osm.stat().st_mtime_ns, origin, folder)


@lru_cache(maxsize=64)
def _converted(
    osm: Path, _version: int, origin: tuple[float, float] | None, folder: Path
) -> SiteRoad:
    from xodr.formats.lanelet2 import convert

    key = digest(osm.read_bytes() + repr(origin).encode())

    def make() -> SiteRoad:
        with scratch("xosc-roads-") as drafts:
            made = convert(osm, origin, drafts / "road.xodr")
            path = keep(made.path.read_bytes(), folder / f"{osm.stem}-{key}.xodr")
        return SiteRoad(path, notes=tuple(f"{osm.name}: {note}" for note in made.notes))

    return kept(f"{osm.name}-{key}", folder, make)


def kept(name: str, folder: Path, make: Callable[[], SiteRoad]) -> SiteRoad:
    """A road that was made before by the same code, in this process or another one; else made now.

    Args:
        name: changes with all that the road is made from.
    """
    record = folder / f"{name}-{_code()}.json"
    try:
        about = read_object(record)
        path = folder / str(about["road"])
        if digest(path.read_bytes()) == about["digest"]:
            return SiteRoad(path, frozenset(about["lights"]), notes=tuple(about["notes"]))
    except (InvalidFile, KeyError, OSError, TypeError):
        pass  # not there, or damaged: the road is made again
    made = make()
    about = {"road": made.path.name, "digest": digest(made.path.read_bytes())}
    write_object(about | {"lights": sorted(made.lights), "notes": list(made.notes)}, record)
    return made


@cache
def _code() -> str:
    """Digest of the code that makes roads."""
    parts = (Path(__file__), *sorted(Path(str(xodr.__file__)).parent.rglob("*.py")))
    return digest(b"".join(part.read_bytes() for part in parts))


def drawn(
    lanelets: Sequence[Lanelet],
    site: str,
    folder: Path,
    crosswalks: Sequence[Crosswalk] = (),
    notes: Sequence[str] = (),
) -> SiteRoad:
    """The road of the lanes of a data set's own map.

    Args:
        lanelets: see `xodr.formats.lanelet2.Lanelet`; roads of lanelets with lights have lights.
        crosswalks: outlines on the road.
        notes: what was assumed to get the lanelets, one sentence each.
    """
    from xodr.formats.lanelet2 import write

    def make() -> SiteRoad:
        with scratch("xosc-roads-") as drafts:
            made = write(lanelets, site, drafts / "road.xodr", crosswalks)
            path = keep_road(made.path.read_bytes(), site, folder)
        lit = frozenset(made.lanelets[one.id][0] for one in lanelets if one.lights)
        return SiteRoad(path, lit, notes=(*notes, *made.notes))

    # Only the digest of the pickled lanelets is kept; nothing is ever unpickled.
    key = digest(pickle.dumps((lanelets, site, crosswalks, notes)))
    return kept(key, folder, make)


ROAD_ID = "1"


@dataclass(frozen=True)
class Highway:
    """Two straight carriageways.

    Attributes:
        upper, lower: y of the markings in the image, ascending, two or more each (m).
        start, end: x of the road's ends, m.
        speed_limit: m/s, infinite for none.
    """

    upper: tuple[float, ...]
    lower: tuple[float, ...]
    start: float
    end: float
    speed_limit: float

    @property
    def middle(self) -> float:
        """y of the reference line in the world, m."""
        return -0.5 * (self.upper[-1] + self.lower[0])

    @property
    def median(self) -> bool:
        """Whether there is ground between the carriageways."""
        return self.upper[-1] < self.lower[0]

    def borders(self, side: int) -> list[float]:
        """Distances of a side's lane borders from the reference line, ascending from 0; side is 1
        (left) or -1 (right)."""
        markings = reversed(self.upper) if side > 0 else self.lower
        away = [side * (-y - self.middle) for y in markings]
        return [0.0, *away] if self.median else away

    def road_map(self, name: str) -> RoadMap:
        """The road, to be written as a file."""
        lanes: dict[int, LaneDesign] = {}
        for side in (1, -1):
            borders = self.borders(side)
            for number, (inner, outer) in enumerate(pairwise(borders), 1):
                kind = "median" if self.median and number == 1 else "driving"
                edge = kind == "median" or number == len(borders) - 1
                lanes[side * number] = LaneDesign(
                    kind, (Cubic(0.0, outer - inner),), mark="solid" if edge else "broken"
                )
        start = PlanPose(self.start, self.middle, 0.0)
        plan = (line(self.end - self.start),)
        road = RoadDesign(
            ROAD_ID,
            name,
            start,
            plan,
            (SectionDesign(0.0, lanes, "solid"),),
            "motorway",
            self.speed_limit,
        )
        return RoadMap(name, (road,))

    def places(self, x: FloatArray, y: FloatArray) -> dict[str, NDArray[Any]]:
        """Road coordinates of world positions: columns road_id, lane_id, s, t and lane_offset of a
        recording.

        As `xodr.model.road.Road.point` has it: beside the road the nearest lane counts, on a border
        the inner one.
        """
        t = y - self.middle
        lane = np.zeros(len(t), np.int64)
        centre = np.zeros(len(t))
        for side, mine in ((1, t > 0.0), (-1, t <= 0.0)):
            borders = np.array(self.borders(side))
            number = np.clip(np.searchsorted(borders, side * t[mine]), 1, len(borders) - 1)
            lane[mine] = side * number
            centre[mine] = side * 0.5 * (borders[number - 1] + borders[number])
        road = np.full(len(t), ROAD_ID, dtype=object)
        return {
            "road_id": road,
            "lane_id": lane,
            "s": x - self.start,
            "t": t,
            "lane_offset": t - centre,
        }

    def write(self, name: str, folder: Path) -> Path:
        """Write the road into a folder, under a name that differs for roads of other content; the
        file's path.

        Raises:
            UsageError: the folder can't be written.
        """
        content = self.road_map(name).to_xml()
        with writing("the road", folder):
            return keep(content, folder / f"{name}-{digest(content)}.xodr")


_STRAIGHT = 0.95
"""Least share of the way within `_ALONG` of the x axis."""
_ALONG = math.radians(20.0)
_MOVING = 1.0
_NEAREST = 2.5
"""Lanes whose middles are less than this apart (m) are one."""
_BIN, _SMOOTH = 0.1, 0.5
_LEAST_SHARE = 0.02
"""Least height of a peak over the highest, for it to be a lane."""
_USUAL_WIDTH = 3.66
_ROUND = 10.0
_KINDS = {7: "onRamp", 8: "offRamp"}


def straight_road(recording: Recording, name: str) -> RoadMap:
    """A one-way road in the direction of x with the lanes that a recording shows.

    Raises:
        UsageError: the recording does not go straight along x, or is empty.
    """
    columns = [track.columns for track in recording.tracks.values()]
    x, y, h, speed = (
        np.concatenate([np.zeros(0), *(one[key] for one in columns)])
        for key in ("x", "y", "h", "speed")
    )
    moving = speed > _MOVING
    if (
        not moving.any()
        or np.average(np.abs(h[moving]) < _ALONG, weights=speed[moving]) < _STRAIGHT
    ):
        raise UsageError(
            f"no file has the roads of {name}, and its traffic does not go straight along x"
        )
    numbers = [one["source_lane"] for one in columns if "source_lane" in one]
    middles = _numbered(y, np.concatenate(numbers)) if len(numbers) == len(columns) else _densest(y)
    start, end = (
        _ROUND * math.floor(x.min() / _ROUND),
        _ROUND * math.ceil(x.max() / _ROUND) + _ROUND,
    )
    return _road(name, start, end, middles)


def _numbered(y: FloatArray, number: IntArray) -> dict[float, str]:
    """Middle of each lane from left to right with its type; of lanes at the same place the one with
    most rows counts."""
    lanes, counts = np.unique(number, return_counts=True)
    kept: dict[float, str] = {}
    for index in np.argsort(-counts, kind="stable").tolist():
        middle = float(np.median(y[number == lanes[index]]))
        if all(abs(middle - other) >= _NEAREST for other in kept):
            kept[middle] = _KINDS.get(int(lanes[index]), "driving")
    return dict(sorted(kept.items(), reverse=True))


def _densest(y: FloatArray) -> dict[float, str]:
    """Lateral positions with most vehicles, from left to right."""
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    edges = np.arange(y.min() - 4.0 * _SMOOTH, y.max() + 4.0 * _SMOOTH + _BIN, _BIN)
    density = gaussian_filter1d(np.histogram(y, edges)[0].astype(np.float64), _SMOOTH / _BIN)
    peaks, _ = find_peaks(
        density, distance=max(1, round(_NEAREST / _BIN)), prominence=_LEAST_SHARE * density.max()
    )
    return {float(edges[peak] + 0.5 * _BIN): "driving" for peak in peaks[::-1].tolist()}


def _road(name: str, start: float, end: float, middles: dict[float, str]) -> RoadMap:
    centres = np.array(list(middles))
    between = 0.5 * (centres[:-1] + centres[1:])
    half = 0.5 * (float(np.median(-np.diff(centres))) if len(centres) > 1 else _USUAL_WIDTH)
    borders = [centres[0] + half, *between.tolist(), centres[-1] - half]
    lanes = {
        -number: LaneDesign(
            kind,
            (Cubic(0.0, borders[number - 1] - borders[number]),),
            mark="broken" if number < len(centres) else "solid",
        )
        for number, kind in enumerate(middles.values(), 1)
    }
    section = SectionDesign(0.0, lanes, "solid")
    road = RoadDesign(
        "1",
        name,
        PlanPose(start, float(borders[0]), 0.0),
        (line(end - start),),
        (section,),
        "motorway",
        math.inf,
    )
    return RoadMap(name, (road,))
