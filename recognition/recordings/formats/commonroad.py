"""CommonRoad XML scenarios (2018b, 2020a), as files or packed in a tar archive.

Source: CommonRoad "XML Format", 2018b and 2020a. Archives are read from front to back, without
unpacking them. A scenario brings its own map along, made of lanelets (`road_of`).
"""

from __future__ import annotations

import lzma
import math
import pickle
import re
import tarfile
import zlib
from collections.abc import Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from lxml import etree

from recognition.recordings.conditions import UNKNOWN, OddConditions
from recognition.recordings.intake import Exclusion, Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import keep_road, kept
from recognition.recordings.rows import Clock, columns_of, cut, in_order, rate
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import Table
from runner.recording import Recording
from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.storage import MAX_BYTES, digest
from schemas.common.xml import parse, parse_bytes
from xodr.formats.commonroad import (
    CommonRoadLanelet,
    child,
    invalid,
    lane_type,
    lanelets,
    measured,
    number,
    unsupported,
)
from xodr.formats.lanelet2 import Lanelet, build

_CATEGORIES = {
    "car": "car", "taxi": "car", "priorityVehicle": "car", "parkedVehicle": "car", "truck": "truck",
    "bus": "bus",
    "train": "tram", "motorcycle": "motorbike", "bicycle": "bicycle", "pedestrian": "pedestrian",
    "constructionZone": "obstacle", "roadBoundary": "obstacle", "building": "obstacle",
    "pillar": "obstacle",
    "median_strip": "obstacle", "unknown": "obstacle",
}  # fmt: skip
_ELEMENTS = (
    "obstacle",
    "dynamicObstacle",
    "staticObstacle",
    "environmentObstacle",
    "phantomObstacle",
)
_OTHERS = (
    "location",
    "scenarioTags",
    "tags",
    "lanelet",
    "trafficSign",
    "trafficLight",
    "intersection",
    "planningProblem",
)
"""Other elements of a scenario."""
_WEATHER = {
    "sunny": "clear", "cloudy": "cloudy", "light_rain": "rain", "mid_rain": "rain",
    "heavy_rain": "rain",
    "fog": "fog", "snow": "snow", "hail": "hail",
}  # fmt: skip
_TIMES = {"day": "day", "night": "night"}
_UNDERGROUND = {"wet": "wet", "snow": "snow", "ice": "icy", "dirty": "contaminated"}
"""Conditions by the words of the format (2020a, environment)"""
_MOMENTS = ("initialState", "state", "occupancy")
_LATEST = 100_000
"""Last time step that is read: hours, where scenarios last for seconds."""


class State(NamedTuple):
    """One state of an obstacle: time step, m, rad, m/s, m/s²; the acceleration is NaN where none is
    given."""

    step: int
    x: float
    y: float
    h: float
    speed: float
    acceleration: float


class _Obstacle(NamedTuple):
    who: TrackParticipant
    standing: bool
    states: list[State]


def recording_of(root: etree._Element) -> tuple[Recording, Report]:
    """The obstacles of a scenario.

    Raises:
        InvalidFile, Unsupported: an obstacle is malformed, or has uncertain states; names line and
            element.
    """
    step = measured(root.get("timeStepSize") or "", root)
    if step <= 0.0:
        raise invalid(root, f"timeStepSize {step:g} s is no time step")
    obstacles: list[_Obstacle] = []
    exclusions: list[Exclusion] = []
    for element, role in _obstacles(root):
        reason = _unusable(element, role)
        # An obstacle without a way is left out and reported; an obstacle that is malformed is an
        # error.
        if reason:
            exclusions.append(_left_out(element, reason))
        else:
            obstacles.append(_obstacle(element, role))
    exclusions += [
        _left_out(element, "there is no such element in CommonRoad") for element in _unknown(root)
    ]
    recording, report = _assembled(root, _to_the_end(obstacles), step)
    report.exclusions += exclusions
    return recording, report


def _obstacles(root: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    """Obstacles and their roles: static, dynamic, environment, phantom."""
    ids: set[str | None] = set()
    for element in root.iterchildren(*_ELEMENTS):
        tag, id_ = str(element.tag), element.get("id")
        if not id_ or id_ in ids:
            raise invalid(element, f"there is another obstacle {id_}" if id_ else "there is no id")
        ids.add(id_)
        yield (
            element,
            (element.findtext("role") or "").strip()
            if tag == "obstacle"
            else tag.removesuffix("Obstacle"),
        )


def _unknown(root: etree._Element) -> list[etree._Element]:
    return [
        element
        for element in root.iterchildren(etree.Element)
        if element.tag not in (*_ELEMENTS, *_OTHERS)
    ]


def _left_out(element: etree._Element, reason: str) -> Exclusion:
    return Exclusion(
        f"{element.tag} {element.get('id', '')}".strip(),
        sum(1 for _ in element.iter(*_MOMENTS)),
        reason,
    )


def _unusable(element: etree._Element, role: str) -> str | None:
    """Reason for which an obstacle is left out; None where it is not."""
    if role not in ("static", "dynamic"):
        return f"an obstacle of role {role!r} has no way of its own"
    if element.find("occupancySet") is not None:
        return "its way is only a set of possible places"
    return None


def _obstacle(element: etree._Element, role: str) -> _Obstacle:
    kind = (child(element, "type").text or "").strip()
    category = _CATEGORIES.get(kind)
    if category is None:
        raise invalid(element, f"{kind!r} is none of the types {', '.join(_CATEGORIES)}")
    corners = [
        corner
        for part in child(element, "shape").iterchildren(etree.Element)
        for corner in _corners(part)
    ]
    if not corners:
        raise invalid(element, "the shape is empty")
    (west, east), (south, north) = (
        (min(values), max(values)) for values in zip(*corners, strict=True)
    )
    if east <= west or north <= south:
        raise invalid(element, "the shape has no size")
    who = participant(element.get("id") or "", category, east - west, north - south)
    # Positions are of the frame's origin, which need not be the middle of the shape.
    return _Obstacle(
        who, role == "static", _states(element, 0.5 * (west + east), 0.5 * (south + north))
    )


def _corners(shape: etree._Element) -> list[tuple[float, float]]:
    """Points that bound a shape in the obstacle's frame, along its axes."""
    if shape.tag == "polygon":
        return [(number(point, "x"), number(point, "y")) for point in shape.iterchildren("point")]
    centre = shape.find("center")
    x, y = (number(centre, "x"), number(centre, "y")) if centre is not None else (0.0, 0.0)
    if shape.tag == "circle":
        radius = _size(shape, "radius")
        return [(x - radius, y - radius), (x + radius, y + radius)]
    if shape.tag != "rectangle":
        raise unsupported(shape, "this shape")
    angle = number(shape, "orientation") if shape.find("orientation") is not None else 0.0
    half_length, half_width = 0.5 * _size(shape, "length"), 0.5 * _size(shape, "width")
    ends = [(a * half_length, b * half_width) for a in (-1, 1) for b in (-1, 1)]
    return [(x + u, y + v) for u, v in (_turned(*end, angle) for end in ends)]


def _size(shape: etree._Element, name: str) -> float:
    value = number(shape, name)
    if value <= 0.0:
        raise invalid(child(shape, name), f"{value:g} m is no size")
    return value


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)


def _states(element: etree._Element, x: float, y: float) -> list[State]:
    """The states of the point (x, y) of an obstacle's frame, in ascending time."""
    states: list[State] = []
    for state in (child(element, "initialState"), *element.iterfind("trajectory/*")):
        if state.tag not in _MOMENTS:
            raise invalid(state, "a trajectory consists of states")
        one = _state(state, x, y)
        if (
            len(states) == 1 and one[:-1] == states[0][:-1]
        ):  # some trajectories begin with the initial state
            states = []
        if states and one.step <= states[-1].step:
            raise invalid(state, f"the time {one.step} comes after {states[-1].step}")
        states.append(one)
    return states


def _state(state: etree._Element, x: float, y: float) -> State:
    values = {str(value.tag): value for value in state.iterchildren(etree.Element)}
    position = child(state, "position")
    point = position.find("point")
    if point is None:
        raise unsupported(position, "an uncertain position")
    h, step = _exact(state, values, "orientation"), _exact(state, values, "time")
    if step != int(step) or not 0 <= step <= _LATEST:
        raise invalid(state, f"the time {step:g} is not a whole number from 0 to {_LATEST}")
    ahead, aside = _turned(x, y, h)
    speed = _exact(state, values, "velocity", 0.0)
    acceleration = _exact(state, values, "acceleration", math.nan)
    return State(
        int(step), number(point, "x") + ahead, number(point, "y") + aside, h, speed, acceleration
    )


def _exact(
    state: etree._Element, values: dict[str, etree._Element], name: str, absent: float | None = None
) -> float:
    """The exact value of a quantity of a state."""
    element = values.get(name)
    if element is None:
        if absent is None:
            raise invalid(state, f"there is no {name}")
        return absent
    if element.find("intervalStart") is not None:
        raise unsupported(element, "a value given as an interval")
    return number(element, "exact")


def _to_the_end(obstacles: list[_Obstacle]) -> list[_Obstacle]:
    """The obstacles, with standing ones there to the end."""
    # Static obstacles have one state: they are there as long as any other one.
    end = max((one.states[-1].step for one in obstacles), default=0)

    def still(state: State) -> list[State]:
        return [state._replace(step=step) for step in range(state.step, end + 1)]

    return [one._replace(states=still(one.states[0])) if one.standing else one for one in obstacles]


def _assembled(
    root: etree._Element, obstacles: list[_Obstacle], step: float
) -> tuple[Recording, Report]:
    if not obstacles:
        return Recording([], step, None), Report(remarks=["there is no obstacle with a way"])
    states = [state for one in obstacles for state in one.states]
    time = np.array([state.step for state in states])
    x, y, h, speed, acceleration = np.array([state[1:] for state in states]).T
    track = np.repeat(np.arange(len(obstacles)), [len(one.states) for one in obstacles])
    rows = in_order(
        Table(Path(root.getroottree().docinfo.URL or ""), {"time": time}, lines=False),
        track,
        Clock("time", time, 1.0 / step, step),
    )
    who = [one.who for one in obstacles]
    report = rows.report([one.name for one in who])
    absent = np.isnan(acceleration)
    if absent.any():
        report.remarks.append("accelerations that are not given are derived from the speeds")
        acceleration = np.where(absent, rate(speed, rows), acceleration)
    columns = columns_of(rows, who, x, y, h, speed, acceleration)
    return Recording(cut(*smoothed(rows, who, columns, report)), step, None), report


FORMAT = "CommonRoad"
TITLE = "CommonRoad"
BY_CONTENT = True
_VERSIONS = ("2018b", "2020a")
_ARCHIVES = (".tar", ".tar.xz", ".tar.gz", ".tar.bz2", ".tgz", ".txz")
_ENDING = ".xml"
_HEAD = 4096
_ID = re.compile(r"(?P<site>[^_]+_[^_]+)_.*")
_BROKEN = (tarfile.TarError, lzma.LZMAError, zlib.error, EOFError, OSError, ValueError, KeyError)


def claims(path: Path) -> bool:
    """Whether a file is a CommonRoad scenario, or an archive that may hold some."""
    if path.name.endswith(_ARCHIVES):
        return True
    if path.suffix != _ENDING:
        return False
    try:
        with path.open("rb") as file:
            return b"<commonRoad" in file.read(_HEAD)
    except OSError:
        return False


def sources(path: Path, roads: Path) -> list[Source]:
    """The scenario of a file, or those of an archive in its order."""
    if not path.name.endswith(_ARCHIVES):
        return [_source(path, None)]
    return [_source(path, member) for member in _members(path) if member.endswith(_ENDING)]


def _source(path: Path, member: str | None) -> Source:
    """A scenario; those of one map number, as in USA_US101-9_1_T-1, have one site."""
    name = (member or path.name).removesuffix(_ENDING)
    named = _ID.fullmatch(Path(name).name)
    site = named["site"] if named else name
    read, map_ = partial(_read, path, member), None if member else path
    road, odd = partial(_road, path, member, site), partial(_conditions, path, member)
    return Source(name, site, FORMAT, path, read, map_, road=road, odd=odd)


def _conditions(path: Path, member: str | None) -> OddConditions:
    """The environment of a scenario's location."""
    root = document(path, member)

    def told(name: str, values: Mapping[str, str]) -> str:
        text = (root.findtext(f"location/environment/{name}") or "").strip()
        return values.get(text, UNKNOWN)

    return OddConditions(
        told("weather", _WEATHER), told("timeOfDay", _TIMES), told("underground", _UNDERGROUND)
    )


def _read(path: Path, member: str | None) -> tuple[Recording, Report]:
    return recording_of(document(path, member))


def _road(
    path: Path, member: str | None, site: str, _recording: Recording, folder: Path
) -> SiteRoad:
    return road_of(document(path, member), site, folder)


def document(path: Path, member: str | None = None) -> etree._Element:
    """The root element of a scenario, which is a file or a member of an archive.

    Raises:
        InvalidFile: it can't be read, or is not CommonRoad.
        Unsupported: it has another version than 2018b and 2020a.
    """
    tree = parse(path) if member is None else parse_bytes(_content(path, member), path / member)
    root = tree.getroot()
    if root.tag != "commonRoad":
        raise invalid(root, "the root element of a scenario is commonRoad")
    version = root.get("commonRoadVersion")
    if version not in _VERSIONS:
        raise unsupported(root, f"version {version!r} is none of {', '.join(_VERSIONS)}")
    return root


class _ArchiveMember(tarfile.TarInfo):
    """An entry of an archive. Python takes a damaged header for the end of the archive; here it is
    an error."""

    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> Self:
        """An entry from a block of an archive, as in the base class."""
        try:
            return super().frombuf(buf, encoding, errors)
        except tarfile.HeaderError as error:
            if buf and not any(buf):
                raise  # a block of zeros is how an archive ends
            raise tarfile.ReadError(str(error)) from None


@lru_cache(maxsize=1)
def _archive(path: Path, _version: int) -> dict[str, tuple[tarfile.TarFile, tarfile.TarInfo]]:
    """The files of an archive by name; it stays open, so that reading them one after the other
    unpacks it once."""
    current().admit(path)
    # Compressed archives can only be read forwards: opening them for each member would unpack them
    # from the beginning each time.
    archive = tarfile.open(path, tarinfo=_ArchiveMember)  # noqa: SIM115 - it stays open
    return {member.name: (archive, member) for member in archive.getmembers() if member.isfile()}


def _members(path: Path) -> list[str]:
    try:
        return list(_archive(path, path.stat().st_mtime_ns))
    except tarfile.ReadError:
        raise InvalidFile("this is no tar archive, or a damaged one", path=path) from None
    except _BROKEN as error:
        raise InvalidFile(f"the archive can't be read: {error}", path=path) from None


def _content(path: Path, member: str) -> bytes:
    try:
        archive, entry = _archive(path, path.stat().st_mtime_ns)[member]
        # Before extraction: a member may be far larger than the compressed archive.
        if entry.size > MAX_BYTES:
            raise InvalidFile(
                f"the file has {entry.size} bytes, at most {MAX_BYTES} are read", path=path / member
            )
        file = archive.extractfile(entry)
        return file.read() if file is not None else b""
    except _BROKEN as error:
        raise InvalidFile(f"the archive can't be read: {error}", path=path / member) from None


# the road ----------------------------------------------------------------------------------

_MOTORWAY = {"highway", "interstate", "mainCarriageWay", "accessRamp", "exitRamp"}
_TAGS = {"interstate": "motorway", "highway": "motorway", "urban": "town"}
"""Tags of scenarios that say what kind of road they are on, the more telling first"""


def road_of(root: etree._Element, site: str, folder: Path) -> SiteRoad:
    """The road that a scenario brings along, written into a folder.

    Types of lanelets seldom tell motorways: in NGSIM's scenarios all are "urban". Where they don't,
    the scenario's tags do. Where these are silent too, speed limits decide; without limits one
    "urban" lanelet makes a town of all that say nothing else.

    Raises:
        InvalidFile: it has no lanelets, or malformed ones.
    """
    found = lanelets(root)
    if not found:
        raise invalid(root, "there is no lanelet, so its roads are unknown")

    tagged = _tagged(root)
    unlimited = (
        # See the docstring: lanelets, then tags, then limits.
        "town" if tagged == "unknown" and any("urban" in one.types for one in found) else tagged
    )

    def kind(one: CommonRoadLanelet) -> str:
        if set(one.types) & _MOTORWAY:
            return "motorway"
        return unlimited if math.isinf(one.limit) else tagged

    made_of = [
        Lanelet(
            one.id, one.left, one.right, one.predecessors, one.successors, one.beside_left,
            one.beside_right,
            lane_type(one.types), kind(one), one.limit,
        )
        for one in found
    ]  # fmt: skip
    lit = [
        str(element.get("id"))
        for element in root.iterchildren("lanelet")
        if element.find("trafficLightRef") is not None
    ]

    def make() -> SiteRoad:
        built = build(made_of, site)
        lights = frozenset(built.lanelets[one][0] for one in lit if one in built.lanelets)
        path = keep_road(built.map.to_xml(), site, folder)
        return SiteRoad(path, lights, notes=tuple(built.notes))

    # Only the digest of the pickled lanelets is kept; nothing is ever unpickled.
    return kept(digest(pickle.dumps((made_of, site, lit))), folder, make)


def _tagged(root: etree._Element) -> str:
    """Type of roads, as in OpenDRIVE, from the tags of a scenario: elements from 2020a on, words of
    an attribute before."""
    tags = {str(tag.tag) for tag in root.iterfind("scenarioTags/*")} | set(
        (root.get("tags") or "").split()
    )
    return next((kind for tag, kind in _TAGS.items() if tag in tags), "unknown")
