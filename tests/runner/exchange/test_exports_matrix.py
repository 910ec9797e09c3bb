"""The matrix of exports: each target of runs declares the fate of each field,
and each field that it keeps is read back.

Readers are packages of others where they are installed with this project (OSI's own, sumolib,
pyarrow), else the plain content of the file; tests/readers lets more packages read the same.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import sumolib
from lxml import etree
from shapely import LineString, Point

import runner
import xodr
from runner.exchange.exports import RUN_FIELDS, TARGETS
from runner.exchange.exports.moments import box_centre
from runner.recording import LogEntry, light_states, signal_states
from schemas.common import fates
from tests.runner.matrix_case import case, write
from xodr.lookup.geo import GeoReference
from xosc.exports.draft import Folder
from xosc.writing.tags import tags_of

OF_RUNS = [target for target in TARGETS.values() if target.of_run]
TOLERANCES = {"speed": 1e-5, "acceleration": 1e-5, "projection": 1e-9, "offset": 1e-4}
CLOSE = 0.05
"""m by which borders and heights may be off"""
Read = dict[str, Any]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> runner.RunResult:
    return case(tmp_path_factory.mktemp("case"))


def motion(result: runner.RunResult, *columns: str) -> dict[str, Any]:
    return {
        name: np.column_stack([track.columns[column].astype(float) for column in columns])
        for name, track in result.recording.tracks.items()
    }


def of_tracks(result: runner.RunResult, value: Callable[[Any], Any]) -> dict[str, Any]:
    return {name: value(track) for name, track in result.recording.tracks.items()}


def lanes_of(network: xodr.RoadNetwork) -> dict[tuple[str, int], Any]:
    return {
        (road.id, lane.id): (road, lane)
        for road in network.roads.values()
        for lane in road.sections[0].lanes.values()
        if lane.id
    }


def limit(road: xodr.Road, lane: int) -> float | None:
    return road.speed_limit(0.0, lane)


def original(result: runner.RunResult) -> Read:
    """Every field as the run and its roads have it."""
    result.recording.locate()
    network = result.recording.network
    assert network is not None and result.criticality is not None
    lanes = lanes_of(network)
    driving = {key: pair for key, pair in lanes.items() if pair[1].type == "driving"}
    times = next(iter(result.recording.tracks.values())).columns["time"].tolist()
    colours = {"green": "green", "red": "red"}
    changes = signal_states(result.events)["7"]
    return {
        "name": list(result.recording.tracks),
        "kind": of_tracks(result, lambda track: track.kind),
        "category": of_tracks(result, lambda track: track.category),
        "role": of_tracks(result, lambda track: track.role),
        "length and width": of_tracks(result, lambda track: [track.box.length, track.box.width]),
        "height of the box": of_tracks(result, lambda track: track.box.height),
        "box about the reference point": of_tracks(result, lambda track: list(track.box[:3])),
        "front axle": of_tracks(result, lambda track: track.front_axle),
        "mass": of_tracks(result, lambda track: track.mass),
        "ego": result.ego,
        "time": times,
        "position": motion(result, "x", "y"),
        "height": motion(result, "z"),
        **{
            name: motion(result, column)
            for name, column in (("heading", "h"), ("pitch", "pitch"), ("roll", "roll"))
        },
        **{name: motion(result, name) for name in ("speed", "acceleration")},
        "place on the road": {
            name: (
                track.columns["road_id"].tolist(),
                track.columns["lane_id"].tolist(),
                track.columns["s"],
                track.columns["t"],
            )
            for name, track in result.recording.tracks.items()
        },
        "lights": light_states(result.events),
        "events": [tuple(entry) for entry in result.events],
        "verdict": str(result.verdict),
        "criticality": result.criticality.table()["distance"],
        "tags": sorted((tag.type, str(tag.value)) for tag in tags_of(result.scenario)),
        "projection": GeoReference(network).to_geodetic(0.0, 0.0)[:2],
        "offset": list(network.header.offset),
        "lane borders": network,
        "road heights": network,
        "lane heights": network,
        "lane types": {key: lane.type for key, (_, lane) in lanes.items()},
        "speed limits": {
            key: limit(road, key[1]) for key, (road, _) in lanes.items() if limit(road, key[1])
        },
        "road marks": None,
        "lane links": {
            (("1", lane), ("2", lane)) if lane < 0 else (("2", lane), ("1", lane))
            for _, lane in lanes
        },
        "neighbours": {
            (key, (key[0], key[1] + step or step)) for key in driving for step in (1, -1)
        },
        "junctions": [],
        "signs": [("274", 50.0, *network.road("1").pose(20, -6)[:2])],
        "traffic lights": [
            "7",
            *network.road("1").pose(100, -6)[:2],
            [("1", -3), ("1", -2), ("1", -1)],
        ],
        "light states": [
            colours[[state for since, state in changes if since <= time + 1e-9][-1]]
            for time in times
        ],
        "objects": [(each.id, each.s, each.t) for each in network.road("1").objects],
    }


def check_lines(network: xodr.RoadNetwork, lines: list[np.ndarray], what: str) -> None:
    """Each border of each lane runs along one of the lines, in the plane or in height; lane
    heights: those of raised lanes.
    """
    for (_, lane_id), (road, lane) in lanes_of(network).items():
        raised = 0.15 if lane.type == "sidewalk" else 0.0
        if (what == "lane heights") != bool(raised):
            continue
        for s in np.linspace(0.5, road.length - 0.5, 60).tolist():
            x, y, z, *_ = road.pose(s, lane.outer(s))
            z = road.elevation(s) + lane.outer(s) * math.sin(road.superelevation(s)) + raised
            near = [each for each in map(LineString, lines) if each.distance(Point(x, y)) < CLOSE]
            assert near, (what, road.id, lane_id, s)
            heights = (
                [each.interpolate(each.project(Point(x, y))).z for each in near]
                if what != "lane borders"
                else [z]
            )
            assert min(abs(height - z) for height in heights) < CLOSE, (
                what,
                road.id,
                lane_id,
                s,
                heights,
                z,
            )


def same(field: str, expected: Any, got: Any) -> None:
    """Compare a field that was read back."""
    if field in ("lane borders", "road heights", "lane heights"):
        if callable(got):
            got(expected, field)
        else:
            check_lines(expected, got, field)
    elif isinstance(expected, dict):
        assert expected.keys() == got.keys(), field
        for key, value in expected.items():
            same(field, value, got[key])
    elif field == "heading":
        assert np.allclose(np.cos(np.asarray(got) - expected), 1.0, atol=1e-9), field
    elif isinstance(expected, np.ndarray | float) or (
        isinstance(expected, list | tuple) and _numbers(expected)
    ):
        assert np.allclose(
            np.asarray(got, float),
            np.asarray(expected, float),
            rtol=0.0,
            atol=TOLERANCES.get(field, 1e-3),
        ), field
    elif isinstance(expected, list | tuple):
        assert len(expected) == len(got), (field, got)
        for one, other in zip(expected, got, strict=True):
            same(field, one, other)
    else:
        assert expected == got, field


def _numbers(values: Any) -> bool:
    return bool(values) and all(isinstance(value, int | float | np.number) for value in values)


def _on_lines(lines: list[np.ndarray]) -> Read:
    return dict.fromkeys(("lane borders", "road heights", "lane heights"), lines)


# readers -------------------------------------------------------------------------------------


def read_osi(result: runner.RunResult, folder: Path) -> Read:
    utilities = pytest.importorskip("osi_utilities", reason="the extra `osi` is not installed")
    import pyproj

    (path,) = folder.glob("*.osi")
    kind = utilities.ChannelSpecification(path, message_type=utilities.MessageType.GROUND_TRUTH)
    with utilities.open_channel(kind) as reader:
        messages = list(reader)
    first = messages[0]
    names = {each.id.value: each.source_reference[0].identifier[0] for each in first.moving_object}
    things = {name: [each for message in messages for each in message.moving_object if names[each.id.value] == name] for name in
              names.values()}  # fmt: skip
    poses = {name: np.array([_reference(each) for each in rows]) for name, rows in things.items()}
    heads = {name: rows[0] for name, rows in things.items()}
    logical = {each.id.value: each for each in first.logical_lane}
    keys = {number: (each.source_reference[0].identifier[0],
        int(each.source_reference[0].identifier[2])) for number, each in
            logical.items()}  # fmt: skip
    physical = {ref.physical_lane_id.value: keys[number] for number,
        each in logical.items() for ref in
                each.physical_lane_reference}  # fmt: skip
    transformer = pyproj.Transformer.from_crs(
        "EPSG:4326", pyproj.CRS(first.proj_string), always_xy=True
    )
    offset = first.proj_frame_offset
    lit = [[lamp for lamp in message.traffic_light if lamp.classification.mode == lamp.classification.MODE_CONSTANT] for message
           in messages]  # fmt: skip
    enum = heads["Ego"].vehicle_classification.Role.Name
    return {
        "name": list(names.values()),
        "kind": {name: {each.TYPE_VEHICLE: "vehicle"}[each.type] for name, each in heads.items()},
        "role": {name: enum(each.vehicle_classification.role).removeprefix("ROLE_").lower() for name, each in heads.items()},
        "length and width": {name: [each.base.dimension.length, each.base.dimension.width] for name,
            each in heads.items()},
        "height of the box": {name: each.base.dimension.height for name, each in heads.items()},
        "box about the reference point": {
            name: [-getattr(each.vehicle_attributes.bbcenter_to_rear,
                axis) for axis in "xyz"] for name, each in heads.items()
        },
        "front axle": {
            name: each.vehicle_attributes.bbcenter_to_front.x - each.vehicle_attributes.bbcenter_to_rear.x
            for name, each in heads.items()
        },
        "ego": names[first.host_vehicle_id.value],
        "time": [message.timestamp.seconds + message.timestamp.nanos / 1e9 for message in messages],
        "position": {name: rows[:, :2] for name, rows in poses.items()},
        **{
            field: {name: rows[:, column : column + 1] for name, rows in poses.items()}
            for field, column in (("height", 2), ("heading", 3), ("pitch", 4), ("roll", 5))
        },
        "projection": transformer.transform(offset.position.x, offset.position.y,
            direction="INVERSE")[::-1],
        "offset": [offset.position.x, offset.position.y, offset.position.z, offset.yaw],
        **_on_lines([np.array([[p.position.x, p.position.y,
            p.position.z] for p in each.boundary_line]) for each in
                     first.lane_boundary]),
        "lane types": {
            keys[number]: {each.TYPE_NORMAL: "driving", each.TYPE_SIDEWALK: "sidewalk"}[each.type]
            for number, each in logical.items()
        },
        "speed limits": {
            keys[number]: rule.speed_limit.speed_limit_value.value / 3.6
            for number, each in logical.items()
            for rule in each.traffic_rule
        },
        "lane links": {
            (keys[number], keys[link.other_lane_id.value])
            for number, each in logical.items()
            for link in (
                each.successor_lane if each.move_direction == each.MOVE_DIRECTION_INCREASING_S else each.predecessor_lane
            )
        },
        "neighbours": {
            (keys[number], keys[link.other_lane_id.value])
            for number, each in logical.items()
            for link in (*each.left_adjacent_lane, *each.right_adjacent_lane)
            if each.type == each.TYPE_NORMAL
        },
        "signs": [
            (sign.main_sign.classification.code, sign.main_sign.classification.value.value,
             sign.main_sign.base.position.x, sign.main_sign.base.position.y)
            for sign in first.traffic_sign
        ],
        "traffic lights": [
            first.traffic_light[0].source_reference[0].identifier[0],
            first.traffic_light[0].base.position.x, first.traffic_light[0].base.position.y,
            sorted(physical[each.value] for each in first.traffic_light[0].classification.assigned_lane_id),
        ],
        "light states": ["+".join(lamp.source_reference[0].identifier[1] for lamp in lamps) for lamps in lit],
    }  # fmt: skip


def _reference(each: Any) -> list[float]:
    """Reference point and angles of a moving object."""
    from scipy.spatial.transform import Rotation

    angles = each.base.orientation
    turn = Rotation.from_euler("ZYX", [angles.yaw, angles.pitch, angles.roll])
    rear = each.vehicle_attributes.bbcenter_to_rear
    position = np.array([each.base.position.x, each.base.position.y, each.base.position.z])
    return [
        *(position + turn.apply([rear.x, rear.y, rear.z])),
        angles.yaw,
        angles.pitch,
        angles.roll,
    ]


def read_sumo(result: runner.RunResult, folder: Path) -> Read:
    net = sumolib.net.readNet(str(folder / "matrix.net.xml"), withPrograms=True)
    kinds = {
        kind.get("id").removeprefix("type."): (
            kind,
            {each.get("key"): each.get("value") for each in kind.iter("param")},
        )
        for kind in etree.parse(folder / "run.rou.xml").iter("vType")
    }
    steps = list(sumolib.xml.parse(str(folder / "run.fcd.xml"), "timestep"))
    rows = {
        name: [vehicle for step in steps for vehicle in step.vehicle if vehicle.id == name]
        for name in kinds
    }
    heading = {
        name: np.radians([[90.0 - float(row.angle)] for row in each]) for name, each in rows.items()
    }
    pitch = {name: -np.radians([[float(row.slope)] for row in each]) for name, each in rows.items()}
    fronts = {
        name: np.array([[float(row.x), float(row.y), float(row.z)] for row in each])
        for name, each in rows.items()
    }
    points = {
        name: fronts[name] - (float(params["box_x"]) + float(kind.get("length")) / 2)
        * _ahead(heading[name], pitch[name])
        for name, (kind, params) in kinds.items()
    }  # fmt: skip
    lanes = {lane: each for edge in net.getEdges() if not edge.getID().startswith("dock") for lane in edge.getLanes()
             for each in [lane.getParam("origId")]}  # fmt: skip
    keys = {
        lane: (text.rpartition("_")[0], int(text.rpartition("_")[2]))
        for lane, text in lanes.items()
    }
    shapes = [np.array(lane.getShape3D()) for lane in keys]

    def heights(network: xodr.RoadNetwork, what: str) -> None:
        """Centre lines of lanes at their heights."""
        for (road_id, lane_id), shape in zip(keys.values(), shapes, strict=True):
            road, lane = lanes_of(network)[road_id, lane_id]
            raised = 0.15 if lane.type == "sidewalk" else 0.0
            if (what == "lane heights") == bool(raised):
                for x, y, z in shape:
                    there = network.locate(x, y)
                    end = 0.0 if road_id == "2" else road.length
                    s, t = (
                        (there.s, there.t) if there.road_id == road_id else (end, lane.center(end))
                    )
                    assert (
                        abs(road.elevation(s) + t * math.sin(road.superelevation(s)) + raised - z)
                        < CLOSE
                    ), (what, lane_id, s)

    (program,) = etree.parse(folder / "run.tll.xml").getroot()
    phases = [(float(phase.get("duration")), phase.get("state")) for phase in program]
    switched = np.cumsum([0.0, *(duration for duration, _ in phases)])
    letters = {"G": "green", "g": "green", "r": "red"}
    shown = [
        phases[int(np.searchsorted(switched, float(step.time) + 1e-6)) - 1][1] for step in steps
    ]
    return {
        "name": [params["name"] for _, params in kinds.values()],
        "ego": next(params["name"] for _, params in kinds.values() if params.get("ego") == "true"),
        **{field: {name: params[field] for name, (_, params) in kinds.items()} for field in ("kind",
            "category", "role")},
        "length and width": {name: [float(kind.get("length")), float(kind.get("width"))] for name,
            (kind, _) in kinds.items()},
        "height of the box": {name: float(kind.get("height")) for name, (kind, _) in kinds.items()},
        "box about the reference point": {
            name: [float(params[f"box_{axis}"]) for axis in "xyz"] for name,
            (_, params) in kinds.items()
        },
        "front axle": {name: float(params["front_axle"]) for name, (_, params) in kinds.items()},
        "mass": {name: float(kind.get("mass")) for name, (kind, _) in kinds.items()},
        "time": [float(step.time) for step in steps],
        "position": {name: values[:, :2] for name, values in points.items()},
        "height": {name: values[:, 2:] for name, values in points.items()},
        "heading": heading,
        "pitch": pitch,
        "acceleration": {name: [[float(row.acceleration)] for row in each] for name,
            each in rows.items()},
        "projection": net.convertXY2LonLat(0.0, 0.0)[::-1],
        "road heights": heights,
        "lane heights": heights,
        "lane types": _types(folder / "matrix.net.xml"),
        "speed limits": {
            key: lane.getSpeed() for lane,
            key in keys.items() if limit(result.recording.network.road(key[0]), key[1])
        },
        "lane links": {
            (keys[lane], keys[link.getToLane()]) for lane in keys for link in lane.getOutgoing()
            if keys.get(link.getToLane(), keys[lane]) != keys[lane]
        },
        "light states": [letters[next(letter for letter in state if letter in letters)] for state in shown],
    }  # fmt: skip


def _ahead(heading: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    return np.hstack(
        [np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), -np.sin(pitch)]
    )


def _types(path: Path) -> dict[tuple[str, int], str]:
    found = {}
    for lane in etree.parse(path).iter("lane"):
        origin = lane.find("param[@key='origId']")
        if origin is not None:
            road, _, number = origin.get("value").rpartition("_")
            found[road, int(number)] = lane.get("type")
    return found


def read_commonroad(result: runner.RunResult, folder: Path) -> Read:
    root = etree.parse(folder / "run.xml").getroot()
    (obstacle,) = root.iter("dynamicObstacle")
    problem = root.find("planningProblem")
    states = [obstacle.find("initialState"), *obstacle.iter("state")]

    def exact(tag: str) -> list[list[float]]:
        return [[float(state.findtext(f"{tag}/exact"))] for state in states]

    place = root.find("location")
    more = place.find("geoTransformation/additionalTransformation")
    lanelets = {each.get("id"): each for each in root.iter("lanelet")}
    network = result.recording.network
    keys = {}
    for number, each in lanelets.items():
        middle = [
            _bound(each, side)[len(_bound(each, side)) // 2, :2]
            for side in ("leftBound", "rightBound")
        ]
        there = network.locate(*np.mean(middle, axis=0))
        keys[number] = (there.road_id, there.lane_id)
    limits = {sign.get("id"): float(sign.findtext("trafficSignElement/additionalValue")) for sign in root.iter("trafficSign")
              if sign.findtext("virtual") == "true"}  # fmt: skip
    light = root.find("trafficLight")
    shown = [
        each.findtext("color")
        for each in light.iter("cycleElement")
        for _ in range(int(each.findtext("duration")))
    ]
    others = [name for name in result.recording.tracks if name != result.ego]
    dt = float(root.get("timeStepSize"))
    driven = dict(zip(others, [obstacle], strict=True))
    size = {name: [float(each.findtext(f"shape/rectangle/{side}")) for side in ("length",
        "width")] for name, each in
            driven.items()}  # fmt: skip
    goal = problem.find("goalState/position/rectangle")
    start = [float(problem.findtext(f"initialState/position/point/{axis}")) for axis in "xy"]
    centre = box_centre(result.recording.tracks[result.ego])[0, :2]
    return {
        "length and width": {result.ego: [float(goal.findtext(side)) for side in ("length",
            "width")], **size},
        "ego": result.ego if np.allclose(start, centre, atol=1e-4) else None,
        "time": [dt * time for (time,) in exact("time")],
        "heading": {"Other": exact("orientation")},
        "speed": {"Other": exact("velocity")},
        "acceleration": {"Other": exact("acceleration")},
        "projection": [float(place.findtext("gpsLatitude")), float(place.findtext("gpsLongitude"))],
        "offset": [float(more.findtext("xTranslation")), float(more.findtext("yTranslation")),
            500.0,
                   float(more.findtext("zRotation"))],
        **_on_lines([_bound(each, side) for each in lanelets.values() for side in ("leftBound",
            "rightBound")]),
        "speed limits": {
            keys[number]: limits[ref.get("ref")]
            for number, each in lanelets.items()
            for ref in each.iter("trafficSignRef")
            if ref.get("ref") in limits
        },
        "lane links": {
            (keys[number], keys[ref.get("ref")]) for number,
            each in lanelets.items() for ref in each.iter("successor")
        },
        "neighbours": {
            (keys[number], keys[ref.get("ref")])
            for number, each in lanelets.items()
            if each.findtext("laneletType") != "sidewalk"
            for ref in (*each.iter("adjacentLeft"), *each.iter("adjacentRight"))
        },
        "traffic lights": [
            "7", *(float(light.findtext(f"position/point/{axis}")) for axis in "xy"),
            sorted(keys[number] for number,
                each in lanelets.items() if each.find("trafficLightRef") is not None),
        ],
        "light states": shown,
    }  # fmt: skip


def _bound(lanelet: Any, side: str) -> np.ndarray:
    return np.array(
        [
            [float(point.findtext(axis)) for axis in "xyz"]
            for point in lanelet.find(side).iter("point")
        ]
    )


def read_openlabel(result: runner.RunResult, folder: Path) -> Read:
    import pyproj

    content = json.loads((folder / "run.openlabel.json").read_text())["openlabel"]
    names = {uid: each["name"] for uid, each in content["objects"].items()}
    told = {each["name"]: each["object_data"] for each in content["objects"].values()}
    frames = list(content["frames"].values())
    rows = {
        name: [frame["objects"][uid]["object_data"] for frame in frames]
        for uid, name in names.items()
    }
    boxes = {
        name: np.array([row["cuboid"][0]["val"] for row in each]) for name, each in rows.items()
    }

    def value(data: Any, kind: str, name: str) -> Any:
        return next(each["val"] for each in data[kind] if each["name"] == name)

    geo, world = (
        content["coordinate_systems"]["geo"],
        content["coordinate_systems"]["world"]["pose_wrt_parent"],
    )
    transformer = pyproj.Transformer.from_crs(
        "EPSG:4326", pyproj.CRS(geo["proj_string"]), always_xy=True
    )
    centres = {name: value(data, "vec", "box_centre") for name, data in told.items()}
    points = {
        name: np.array([_origin(row, centres[name]) for row in each])
        for name, each in boxes.items()
    }
    lights: dict[str, list[Any]] = {}
    for name, each in rows.items():
        before: dict[str, str] = {}
        for frame, row in zip(frames, each, strict=True):
            texts = {entry["name"]: entry["val"] for entry in row.get("text", [])}
            now = {light: mode for light, mode in texts.items() if light != "road"}
            for light in now.items() - before.items():
                lights.setdefault(name, []).append((frame["frame_properties"]["timestamp"], light))
            before = now
    return {
        "name": list(names.values()),
        "kind": {name: value(data, "text", "kind") for name, data in told.items()},
        "category": {each["name"]: each["type"] for each in content["objects"].values()},
        "role": {name: value(data, "text", "role") for name, data in told.items()},
        "length and width": {name: each[0, 6:8].tolist() for name, each in boxes.items()},
        "height of the box": {name: float(each[0, 8]) for name, each in boxes.items()},
        "box about the reference point": centres,
        "front axle": {name: value(data, "num", "front_axle") for name, data in told.items()},
        "mass": {name: value(data, "num", "mass") for name, data in told.items()},
        "ego": next(name for name, data in told.items() if value(data, "boolean", "ego")),
        "time": [frame["frame_properties"]["timestamp"] for frame in frames],
        "position": {name: each[:, :2] for name, each in points.items()},
        "height": {name: each[:, 2:] for name, each in points.items()},
        **{field: {name: each[:, column : column + 1] for name, each in boxes.items()} for field,
            column in
           (("heading", 5), ("pitch", 4), ("roll", 3))},
        **{field: {name: [[value(row, "num", field)] for row in each] for name,
            each in rows.items()} for field in
           ("speed", "acceleration")},
        "lights": lights,
        "place on the road": {
            name: tuple(
                [value(row, kind, field) for row in each]
                for kind, field in (("text", "road"), ("num", "lane"), ("num", "s"), ("num", "t"))
            )
            for name, each in rows.items()
        },
        "events": [
            (value(each["event_data"], "num", "time"), each["type"], each["name"],
                value(each["event_data"], "text", "text"))
            for each in content["events"].values()
        ],
        "verdict": value(content["contexts"]["0"]["context_data"], "text", "verdict"),
        "criticality": np.array([value(frame["contexts"]["0"]["context_data"], "num",
            "distance") for frame in frames]),
        "tags": sorted((each["type"],
            str(each["tag_data"]["text"][0]["val"])) for each in content["tags"].values()),
        "projection": transformer.transform(*world["translation"][:2], direction="INVERSE")[::-1],
        "offset": [*world["translation"], world["euler_angles"][0]],
    }  # fmt: skip


def _origin(cuboid: np.ndarray, centre: list[float]) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return cuboid[:3] - Rotation.from_euler("ZYX", cuboid[[5, 4, 3]]).apply(centre)


def read_parquet(result: runner.RunResult, folder: Path) -> Read:
    table = pq.read_table(folder / "run.participants.parquet")
    who = {row["name"]: row for row in table.to_pylist()}
    about = {key.decode(): text.decode() for key, text in table.schema.metadata.items()}
    rows = pq.read_table(folder / "run.parquet").to_pylist()
    of = {name: [row for row in rows if row["entity"] == name] for name in who}
    events = [
        tuple(row.values()) for row in pq.read_table(folder / "run.events.parquet").to_pylist()
    ]
    network = xodr.load(folder / about["road_file"])
    assert network.path.read_bytes() == result.recording.network.path.read_bytes()
    log = [LogEntry(*event) for event in events]
    shown = signal_states(log)["7"]
    times = [row["time"] for row in of["Ego"]]

    def columns(*names: str) -> dict[str, Any]:
        return {
            who_: np.array([[row[name] for name in names] for row in each])
            for who_, each in of.items()
        }

    lanes = lanes_of(network)
    return {
        "name": list(who),
        **{field: {name: row[field] for name, row in who.items()} for field in ("kind", "category",
            "role", "mass")},
        "length and width": {name: [row["box_length"], row["box_width"]] for name,
            row in who.items()},
        "height of the box": {name: row["box_height"] for name, row in who.items()},
        "box about the reference point": {name: [row[f"box_{axis}"] for axis in "xyz"] for name,
            row in who.items()},
        "front axle": {name: row["front_axle"] for name, row in who.items()},
        "ego": next(name for name, row in who.items() if row["ego"]),
        "time": times,
        "position": columns("x", "y"),
        **{field: columns(column) for field, column in
           (("height", "z"), ("heading", "h"), ("pitch", "pitch"), ("roll", "roll"),
               ("speed", "speed"),
            ("acceleration", "acceleration"))},
        "place on the road": {
            name: tuple([row[field] for row in each] for field in ("road_id", "lane_id", "s",
                "t")) for name, each in of.items()
        },
        "lights": light_states(log),
        "events": events,
        "verdict": about["verdict"],
        "criticality": pq.read_table(folder / "run.criticality.parquet")["distance"].to_numpy(zero_copy_only=False),
        "tags": sorted((row["type"], row["value"]) for row in pq.read_table(folder / "run.tags.parquet").to_pylist()),
        "projection": GeoReference(network).to_geodetic(0.0, 0.0)[:2],
        "offset": json.loads(about["geo_offset"]),
        "lane types": {key: lane.type for key, (_, lane) in lanes.items()},
        "light states": [[state for since,
            state in shown if since <= time + 1e-9][-1] for time in times],
        **{field: original(result)[field] for field in _OF_ROAD_FILE},
        **dict.fromkeys(("lane borders", "road heights", "lane heights"), _as_there),
    }  # fmt: skip


def _as_there(network: xodr.RoadNetwork, field: str) -> None:
    """The same bytes have the same lines."""


_OF_ROAD_FILE = (
    "speed limits", "road marks", "lane links", "neighbours", "junctions",
    "signs", "traffic lights", "objects",
)  # fmt: skip
"""Fields of a road file: the same bytes have the same ones"""

READERS = {
    "osi": read_osi, "sumo": read_sumo, "commonroad": read_commonroad, "openlabel": read_openlabel,
    "parquet": read_parquet,
}  # fmt: skip


@pytest.mark.parametrize("target", OF_RUNS, ids=lambda target: target.name)
def test_each_target_declares_the_fate_of_each_field(target: Any) -> None:
    assert fates.undeclared(RUN_FIELDS, import_module(target.module).FATES) == []


@pytest.mark.parametrize("target", OF_RUNS, ids=lambda target: target.name)
def test_what_is_kept_is_read_back(target: Any, result: runner.RunResult, tmp_path: Path) -> None:
    module = import_module(target.module)
    module.export(result, "run", Folder(tmp_path))
    got, expected = READERS[target.name](result, tmp_path), original(result)
    if target.name == "commonroad":  # the ego's way is its solution, and not in the file
        expected = {
            field: _without_ego(value, field, result.ego) for field, value in expected.items()
        }
    for field, fate in module.FATES.items():
        if fate.outcome == fates.KEPT:
            assert field in got, f"{field} is not read back"
            same(field, expected[field], got[field])


def _without_ego(value: Any, field: str, ego: str | None) -> Any:
    if field in ("heading", "speed", "acceleration"):
        return {name: rows for name, rows in value.items() if name != ego}
    return value


def test_a_turned_offset_is_kept_or_named(tmp_path: Path) -> None:
    result = runner.run(
        write(tmp_path / "case", turn=0.5), world="kinematic", timestep=0.1, sut="none", ego="Ego"
    )
    network = result.recording.network
    assert network is not None
    remarks = {
        name: import_module(TARGETS[name].module).export(result, "run", Folder(tmp_path / name))
        for name in READERS
    }
    assert [
        name for name, said in remarks.items() if any("SUMO can't turn" in each for each in said)
    ] == ["sumo"]
    expected = GeoReference(network).to_geodetic(0.0, 0.0)
    for name in READERS.keys() - {"sumo"}:
        got = READERS[name](result, tmp_path / name)
        same("projection", expected[:2], got["projection"])
        same("offset", [690000.0, 5330000.0, 500.0, 0.5], got["offset"])


def test_lane_borders_are_dense_enough_for_sensors(
    result: runner.RunResult, tmp_path: Path
) -> None:
    for name in ("osi", "commonroad"):
        import_module(TARGETS[name].module).export(result, "run", Folder(tmp_path / name))
        assert result.recording.network is not None
        check_lines(
            result.recording.network,
            READERS[name](result, tmp_path / name)["lane borders"],
            "lane borders",
        )
