"""GeoJSON of a map for geographic information systems: lanes as areas, borders with their marks,
centre lines, crosswalks, stop lines, signals, poles.

Source: RFC 7946. Coordinates are longitude, latitude (WGS 84) and height where the map has a
projection, else those of the map in metres, which `properties.coordinates` of the collection says.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_bytes
from xodr.formats.maps.lane_map import (
    LaneMap,
    MapCrosswalk,
    MapLane,
    MapPole,
    MapSignal,
    MapStopLine,
)
from xodr.formats.maps.projecting import Projector

_DEGREES, _METRES = 10, 4
"""Decimals: 1e-10° are 10 µm."""


def write(lane_map: LaneMap) -> tuple[bytes, list[str]]:
    """The content of a file, and what is changed."""
    projector = Projector.of(lane_map)

    def placed(line: FloatArray) -> list[list[float]]:
        if projector is None:
            return np.round(line, _METRES).tolist()
        # Longitude first, as RFC 7946 has it.
        longitude, latitude, height = projector.to_geodetic(line)
        return np.column_stack(
            [np.round(longitude, _DEGREES), np.round(latitude, _DEGREES), np.round(height, _METRES)]
        ).tolist()

    features = list(_features(lane_map, placed))
    about = {
        "name": lane_map.name,
        "coordinates": "WGS 84" if projector is not None else "metres of the map",
        "projection": lane_map.projection, "offset": list(lane_map.offset),
        "left_hand": lane_map.left_hand,
        "priorities": [list(pair) for pair in lane_map.priorities],
    }  # fmt: skip
    content = {"type": "FeatureCollection", "properties": about, "features": features}
    notes = (
        []
        if projector is not None
        else ["the map has no projection: coordinates are its own, in metres"]
    )
    return (
        json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":")) + "\n"
    ).encode(), notes


def _features(
    lane_map: LaneMap, placed: Callable[[FloatArray], list[list[float]]]
) -> Iterator[dict[str, Any]]:
    for lane in lane_map.lanes.values():
        left, right = placed(lane.left), placed(lane.right)
        about = {
            "kind": "lane", "id": lane.id, "type": lane.type, "road_type": lane.road_type,
            "speed_limit": lane.limit,
            "in_junction": lane.in_junction, "successors": lane.successors,
            "left": lane.beside[0], "right": lane.beside[1],
        }  # fmt: skip
        # Counterclockwise and closed, as GeoJSON wants outer rings (RFC 7946, 3.1.6).
        ring = [*right, *left[::-1], right[0]]
        yield _feature("Polygon", [ring], about)
        for side, line, (mark, color, width) in zip(
            ("left", "right"), (left, right), lane.marks, strict=True
        ):
            yield _feature(
                "LineString", line,
                {"kind": "border", "lane": lane.id, "side": side, "mark": mark, "color": color,
                    "width": width},
            )  # fmt: skip
        yield _feature("LineString", placed(lane.centre), {"kind": "centre", "lane": lane.id})
    for area in lane_map.crosswalks:
        ring = placed(area.outline)
        yield _feature("Polygon", [[*ring, ring[0]]], {"kind": "crosswalk", "id": area.id})
    for stop in lane_map.stop_lines:
        about = {"kind": "stop line", "id": stop.id, "lanes": list(stop.lanes)}
        yield _feature("LineString", placed(stop.line), about)
    for pole in lane_map.poles:
        (place,) = placed(np.array([pole.place]))
        yield _feature("Point", place, {"kind": "pole", "id": pole.id, "height": pole.height})
    for signal in lane_map.signals:
        (place,) = placed(np.array([signal.place]))
        about = {
            "kind": signal.kind, "id": signal.id, "type": signal.type, "subtype": signal.subtype,
            "country": signal.country,
            "value": signal.value, "unit": signal.unit, "heading": signal.heading,
            "lanes": list(signal.lanes),
        }  # fmt: skip
        yield _feature("Point", place, about)


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": kind, "coordinates": coordinates},
        "properties": properties,
    }


def read(path: Path) -> LaneMap:
    """The map in a file that `write` has written.

    Raises:
        InvalidFile: it is no such file.
    """
    try:
        content = json.loads(read_bytes(path), parse_constant=_no_number)
        about = content["properties"]
        offset = tuple(float(part) for part in about["offset"])
        made = LaneMap(about["name"], {}, [], about["projection"], offset, about["left_hand"])  # type: ignore[arg-type]
        made.priorities = [(str(high), str(low)) for high, low in about.get("priorities", [])]
        projector = Projector.of(made) if about["coordinates"] == "WGS 84" else None
        for feature in content["features"]:
            _take(feature["properties"], feature["geometry"]["coordinates"], made, projector)
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        message = (
            "this is no GeoJSON of lanes as this project writes them "
            f"({type(error).__name__}: {error})"
        )
        raise InvalidFile(message, path=path) from None
    return made


def _no_number(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _take(
    about: dict[str, Any], coordinates: Any, made: LaneMap, projector: Projector | None
) -> None:
    if about["kind"] == "lane":
        sides = tuple(
            (neighbour[0], neighbour[1]) if neighbour is not None else None
            for neighbour in (about["left"], about["right"])
        )
        if about["id"] in made.lanes:
            raise ValueError(f"the id {about['id']!r} is used twice")
        empty = np.zeros((0, 3))
        made.lanes[about["id"]] = MapLane(
            about["id"], empty, empty, about["type"], about["road_type"], about["speed_limit"],
            in_junction=about["in_junction"], successors=list(about["successors"]),
            beside=(sides[0], sides[1]),
        )  # fmt: skip
    elif about["kind"] == "border":
        line = np.array(coordinates, dtype=float)
        lane = made.lanes[about["lane"]]
        mark = (about["mark"], about["color"], about["width"])
        there = projector.to_map(line) if projector is not None else line
        if about["side"] == "left":
            lane.left, lane.marks = there, (mark, lane.marks[1])
        else:
            lane.right, lane.marks = there, (lane.marks[0], mark)
    elif about["kind"] == "crosswalk":
        line = np.array(coordinates[0][:-1], dtype=float)
        area = projector.to_map(line) if projector is not None else line
        made.crosswalks.append(MapCrosswalk(about["id"], area))
    elif about["kind"] == "stop line":
        line = np.array(coordinates, dtype=float)
        there = projector.to_map(line) if projector is not None else line
        made.stop_lines.append(MapStopLine(about["id"], there, tuple(about["lanes"])))
    elif about["kind"] == "pole":
        height = float(about["height"])
        made.poles.append(MapPole(about["id"], _place(coordinates, projector), height))
    elif about["kind"] in ("light", "sign"):
        what = (about["type"], about["subtype"], about["country"], about["value"], about["unit"])
        heading = math.remainder(about["heading"], math.tau)
        made.signals.append(
            MapSignal(
                about["id"], about["kind"], what, _place(coordinates, projector), heading,
                tuple(about["lanes"]),
            )
        )  # fmt: skip


def _place(coordinates: Any, projector: Projector | None) -> tuple[float, float, float]:
    line = np.array([coordinates], dtype=float)
    x, y, z = (projector.to_map(line) if projector is not None else line)[0].tolist()
    return x, y, z
