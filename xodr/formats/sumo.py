"""SUMO networks: written with exact centre lines and heights, read into lanes.

Source: SUMO documentation, "Networks/SUMO Road Networks". Lanes of SUMO have one width; their
shapes are centre lines.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from lxml import etree

from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.xml import line_of, parse
from xodr.formats.maps.lane_map import LANE_TYPES, LaneMap, MapLane, MapSignal, heights_on, shifted
from xodr.formats.sumo_net import DOCK, build, georeference, lift
from xodr.graph.network import RoadNetwork

_WIDTH = 3.2
"""Width (m) of lanes that name none."""
_TYPES = {
    "pedestrian": "sidewalk", "bicycle": "biking", "bus": "bus", "tram": "tram", "rail": "rail", "rail_urban": "rail",
    "emergency": "shoulder",
}  # fmt: skip
"""Lane types by the first vehicle class that a lane allows alone."""


def write(network: RoadNetwork) -> tuple[bytes, list[str]]:
    """The network file of OpenDRIVE roads, and what is changed, one sentence each.

    Raises:
        Unsupported: netconvert can't convert the roads.
    """
    net = build(network.path)
    if net.fallback is not None:
        raise Unsupported(
            f"SUMO's netconvert can't convert these roads: {net.fallback}", path=network.path
        )
    root = parse(net.path).getroot()
    notes = [note for note in (georeference(root, network),) if note is not None]
    height = network.header.offset[2]
    if height and network.geo_reference is not None and not notes:
        notes.append(f"the height of the offset, {height:g} m, is left out: SUMO has none")
    lift(root, net, network)
    for element in [element for element in root if DOCK in (element.get("id", ""), element.get("from", ""), element.get("to", ""))
                    or element.get("id", "").startswith((f"{DOCK}/", f":{DOCK}/"))]:  # fmt: skip
        root.remove(element)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True), notes


def read(path: Path) -> LaneMap:
    """The lanes of a network file.

    Raises:
        InvalidFile: it is no SUMO network, or a lane has no shape; names file and line.
    """
    root = parse(path).getroot()
    if root.tag != "net":
        raise InvalidFile(
            "the root element of a SUMO network is net",
            path=path,
            line=line_of(root),
            element=str(root.tag),
        )
    left_hand = root.get("lefthand") in ("true", "1")
    lanes: dict[str, MapLane] = {}
    for edge in root.iterchildren("edge"):
        if edge.get("function") in ("crossing", "walkingarea", "connector"):
            continue
        row = sorted(edge.iterchildren("lane"), key=lambda lane: int(lane.get("index", "0")))
        made = [_lane(lane, edge, path) for lane in row]
        internal = edge.get("function") == "internal"
        if not internal:
            _lean(made, -1 if left_hand else 1)
        for number, lane in enumerate(made):
            lane.in_junction = internal
            inner, outer = (
                made[n].id if 0 <= n < len(made) and not internal else None
                for n in (number + 1, number - 1)
            )
            sides = [
                (name, True) if name is not None else None
                for name in ((outer, inner) if left_hand else (inner, outer))
            ]
            lane.beside = (sides[0], sides[1])
            lanes[lane.id] = lane
    lights = _connect(root, lanes)
    location = root.find("location")
    projection, offset = _location(location)
    notes = ["the network says nothing of its place on Earth"] if projection is None else []
    return LaneMap(path.name.split(".")[0], lanes, lights, projection, offset, left_hand, notes)


def _lane(lane: etree._Element, edge: etree._Element, path: Path) -> MapLane:
    points = []
    for text in lane.get("shape", "").split():
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
            raise InvalidFile(
                f"shape={text!r} is no point x,y or x,y,z",
                path=path,
                line=line_of(lane),
                element="lane",
            )
        points.append([*numbers, 0.0][:3])
    line = np.array(points).reshape(-1, 3)
    line = (
        line[np.append(True, np.hypot(*np.diff(line[:, :2], axis=0).T) > 1e-4)]
        if len(line)
        else line
    )
    if len(line) == 1:  # a way without length, between edges that meet
        line = np.vstack([line, line + np.array([1e-3, 0.0, 0.0])])
    if len(line) < 2:
        raise InvalidFile(
            "the lane has no shape", path=path, line=line_of(lane), element=f"lane {lane.get('id')}"
        )
    half = 0.5 * float(lane.get("width", _WIDTH))
    return MapLane(
        lane.get("id", ""), shifted(line, half), shifted(line, -half), _type(lane, edge),
        limit=float(lane.get("speed", "13.89")),
    )  # fmt: skip


def _lean(row: list[MapLane], leftwards: int) -> None:
    """Tilt lanes beside each other by the heights of their centre lines: a network has no other
    cross slope.

    Args:
        row: lanes of an edge by index.
        leftwards: 1 where the index grows to the left, -1 where to the right.
    """
    centres = [lane.centre for lane in row]
    if len(row) < 2 or not any(line[:, 2].any() for line in centres):
        return
    halves = [float(np.hypot(*(lane.left - lane.right)[0, :2])) / 2 for lane in row]
    for number, lane in enumerate(row):
        line = centres[number]
        slopes = [
            (heights_on(line[:, :2], [centres[n]]) - line[:, 2])
            / ((n - number) * leftwards * (halves[n] + halves[number]))
            for n in (number - 1, number + 1)
            if 0 <= n < len(row)
        ]
        rise = np.mean(slopes, axis=0) * halves[number]
        lane.left[:, 2] += rise
        lane.right[:, 2] -= rise


def _type(lane: etree._Element, edge: etree._Element) -> str:
    named = lane.get("type") or edge.get("type") or ""
    if named in LANE_TYPES or named == "none":
        return named
    allowed = (lane.get("allow") or "").split()
    if allowed and "passenger" not in allowed:
        return next((_TYPES[user] for user in allowed if user in _TYPES), "restricted")
    return "none" if lane.get("disallow") == "all" else "driving"


def _connect(root: etree._Element, lanes: dict[str, MapLane]) -> list[MapSignal]:
    """Link the lanes; the lights at connections, one for each light and lane."""
    held: dict[str, dict[str, None]] = {}
    for connection in root.iterchildren("connection"):
        source = f"{connection.get('from')}_{connection.get('fromLane')}"
        target = connection.get("via") or f"{connection.get('to')}_{connection.get('toLane')}"
        if source in lanes and target in lanes and target not in lanes[source].successors:
            lanes[source].successors.append(target)
        if connection.get("tl") and source in lanes and not source.startswith(":"):
            held.setdefault(str(connection.get("tl")), {})[source] = None
    signals = []
    for light, names in held.items():
        end = lanes[next(iter(names))].right[-1]
        place = (float(end[0]), float(end[1]), float(end[2]))
        signals.append(
            MapSignal(
                light, "light", ("1000001", "-1", "OpenDRIVE", None, ""), place, 0.0, tuple(names)
            )
        )
    return signals


def _location(
    location: etree._Element | None,
) -> tuple[str | None, tuple[float, float, float, float]]:
    """Projection and offset, as OpenDRIVE has them."""
    projection = location.get("projParameter", "!") if location is not None else "!"
    if location is None or projection in ("!", "-", ""):
        return None, (0.0, 0.0, 0.0, 0.0)
    x, y, *_ = (float(part) for part in location.get("netOffset", "0,0").split(","))
    return projection, (0.0 - x, 0.0 - y, 0.0, 0.0)
