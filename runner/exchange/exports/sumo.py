"""Target `sumo`: the network, the vehicles' routes, a configuration, and the run itself as FCD
output.

Frames: SUMO's positions are those of the middle of the front bumper, its angles degrees clockwise
from north. Times and places of the FCD file are those of the run; a simulation of the routes moves
the vehicles by SUMO's own drivers. What SUMO has no attribute for is in parameters (`param`) of the
vehicle types. Lights change as in the run, by a program of their own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from lxml import etree

from runner.engine.worlds.sumo_translation import KINDS, OBSTACLE, link_state
from runner.exchange.exports.moments import decimal, fixed_point, moments, unsupported
from runner.exchange.exports.osi_signals import VehicleLights
from runner.recording import signal_states
from schemas.common.fates import changed, kept, lost
from schemas.common.xml import parse
from xodr.formats import sumo_net
from xodr.formats.sumo_net import LaneTrack

if TYPE_CHECKING:
    from runner import recording
    from runner.judging.result import RunResult
    from xodr.formats.sumo_net import SumoNet
    from xosc.exports.draft import Folder

TARGETS = {"sumo": "SUMO: network, routes, and the run as FCD"}
_DARK = "O"
"""Link state of a light that is off"""
_AFTER = 3600.0
"""Time (s) that the last state of a light lasts on after the run"""
_UNFIT = re.compile(r"[^A-Za-z0-9_.-]")
"""Characters that SUMO's ids can't have, or had better not."""


class _Place(NamedTuple):
    """Position of a front bumper on SUMO's lanes, in m from the start of the lane."""

    lane: str
    position: float


_Places = Sequence[_Place | None]


class _Roads(NamedTuple):
    """Roads of a network file: length (m) and speed limit (m/s) of each lane, and successors of
    each edge."""

    lengths: dict[str, float]
    limits: dict[str, float]
    joined: set[tuple[str, str]]

    @classmethod
    def read(cls, net: SumoNet) -> _Roads:
        """Read lanes and connections of a network file."""
        root = parse(net.path).getroot()
        lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
        lengths, limits = (
            {name: float(lane.get(attribute, "0")) for name, lane in lanes.items()}
            for attribute in ("length", "speed")
        )
        return cls(
            lengths,
            limits,
            {
                (connection.get("from", ""), connection.get("to", ""))
                for connection in root.iter("connection")
            },
        )


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the files of a run.

    Returns:
        Vehicles without a route, which are in the FCD file only.

    Raises:
        Unsupported: there are no roads, or netconvert can't convert them.
        UsageError: a file is in the way.
    """
    network = result.recording.network
    if network is None:
        raise unsupported(result, None, "SUMO's vehicles are on roads, and this scenario has none")
    net = sumo_net.build(network.path)
    if net.fallback is not None:
        raise unsupported(
            result, None, f"SUMO's netconvert can't convert {network.path}: {net.fallback}"
        )
    tracks = list(result.recording.locate().tracks.values())
    ids = _ids(tracks)
    roads = _Roads.read(net)
    places = [_places(track, net, roads.lengths) for track in tracks]
    network_file = folder.name(net.path, f"{network.path.stem}.net.xml")
    converted = parse(net.path).getroot()
    georeferenced = sumo_net.georeference(converted, network)
    sumo_net.lift(converted, net.sumo_lanes, network)
    routes, remarks = _routes(tracks, ids, places, roads, result.ego)
    remarks += [georeferenced] if georeferenced is not None else []
    programs = _programs(result, net, converted)
    files = {f"{name}.rou.xml": routes, f"{name}.fcd.xml": _fcd(result, ids, places)}
    if len(programs):
        files[f"{name}.tll.xml"] = programs
    files[f"{name}.sumocfg"] = _configuration(
        network_file, [file for file in files if not file.endswith(".fcd.xml")], result
    )
    files[network_file] = converted
    for file, root in files.items():
        etree.indent(root)
        folder.write(file, etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n")
    return remarks


def _ids(tracks: Sequence[recording.Track]) -> list[str]:
    ids: list[str] = []
    for number, track in enumerate(tracks):
        plain = _UNFIT.sub("_", track.name) or "_"
        ids.append(plain if plain not in ids else f"{plain}.{number}")
    return ids


# places -------------------------------------------------------------------------------------


def _places(track: recording.Track, net: SumoNet, lengths: dict[str, float]) -> _Places:
    """Return the lane position of the front bumper in every row; None off SUMO's lanes."""
    columns, front = track.columns, track.box.x + track.box.length / 2
    places: list[_Place | None] = []
    for road, lane, s in zip(
        columns["road_id"], columns["lane_id"].tolist(), columns["s"].tolist(), strict=True
    ):
        here = _track(net, road, lane, s)
        # Along SUMO's lane, on which s may fall.
        ahead = s + (front if here is None or here[1].end > here[1].start else -front)
        there = _track(net, road, lane, ahead)
        if there is None:
            places.append(None)
            continue
        name, along = there
        share = (ahead - along.start) / (along.end - along.start)
        places.append(_Place(name, min(max(share, 0.0), 1.0) * lengths[name]))
    return places


def _track(net: SumoNet, road: str | None, lane: int, s: float) -> tuple[str, LaneTrack] | None:
    """SUMO lane of a lane at s, and its kind on the road; None if there is none."""
    name = net.sumo_lane(road, lane, s) if road is not None else None
    along = net.track(name) if name is not None else None
    return (
        (name, along)
        if name is not None and along is not None and along.end != along.start
        else None
    )


def _edges(places: _Places) -> list[str]:
    """Edges passed, without edges inside junctions, which routes leave out."""
    edges = [place.lane.rpartition("_")[0] for place in places if place is not None]
    outside = [edge for edge in edges if not edge.startswith(":")]
    return [
        edge for number, edge in enumerate(outside) if number == 0 or edge != outside[number - 1]
    ]


_MOTION, _NETWORK = "SUMO's outputs are of motion", "SUMO's networks have none"
FATES = {
    "name": kept("`param`"), "kind": kept("`param`"), "category": kept("`param`"),
    "role": kept("`param`, `vClass`"),
    "length and width": kept("`vType`"), "height of the box": kept("`vType`"),
    "box about the reference point": kept("`param`"), "front axle": kept("`param`"),
    "mass": kept("`vType`"),
    "ego": kept("`param`"), "time": kept("FCD"), "position": kept("FCD, front bumper"),
    "height": kept("FCD"),
    "heading": kept("FCD"), "pitch": kept("FCD, `slope`"),
    "roll": lost("SUMO's vehicles do not roll"),
    "speed": changed("without the sign of going backwards"), "acceleration": kept("FCD"),
    "place on the road": changed("lane and position of SUMO's network"),
    "lights": changed("bits of `signals`: lit or not; no licence plate, daytime running light"),
    "events": lost(_MOTION),
    "verdict": lost(_MOTION), "criticality": lost(_MOTION), "tags": lost(_MOTION),
    "projection": kept("`projParameter`"),
    "offset": changed("`netOffset`; not height and turn, which lose the projection"),
    "lane borders": changed("centre lines are exact, a lane of an edge has one width"),
    "road heights": kept("z of shapes"), "lane heights": kept("z of shapes"),
    "lane types": kept("`type`"),
    "speed limits": kept("`speed`"), "road marks": lost(_NETWORK),
    "lane links": kept("connections"),
    "neighbours": changed("lanes of one edge; opposite ones are other edges"),
    "junctions": changed("one node each, with netconvert's right of way"), "signs": lost(_NETWORK),
    "traffic lights": changed("the links that they hold, without their place"),
    "light states": kept("program `scenario`"),
    "objects": lost(_NETWORK),
}  # fmt: skip
"""Fates of `runner.exchange.exports.RUN_FIELDS`; participants of those that have a route"""

_CLASSES = {
    "ambulance": "emergency", "fire": "emergency", "police": "authority", "military": "army",
    "publicTransport": "bus",
}  # fmt: skip
"""SUMO's vehicle classes by OpenSCENARIO role; other roles have that of their category."""
_LIGHTS = {
    "indicatorRight": 1, "indicatorLeft": 2, "warningLights": 4, "brakeLights": 8, "lowBeam": 16,
    "fogLights": 32,
    "highBeam": 64, "reversingLights": 128, "specialPurposeLights": 2048,
}  # fmt: skip
"""Bits of SUMO's vehicle signals by OpenSCENARIO's light."""


def _programs(result: RunResult, net: SumoNet, network: etree._Element) -> etree._Element:
    """A program for each traffic light that the run has switched: its phases are the states between
    two changes.

    Links without a state are off: the junction's right of way holds.
    """
    root = etree.Element("additional")
    links = {
        program.get("id", ""): len(program.findall("phase")[0].get("state", ""))
        for program in network.iter("tlLogic")
    }
    changes: dict[str, dict[float, dict[int, str]]] = {}
    for signal, history in signal_states(result.events).items():
        for time, state in history:
            for light, link in net.signals.get(signal, ()):
                changes.setdefault(light, {}).setdefault(time, {})[link] = (
                    link_state(state) or _DARK
                )
    for light, times in changes.items():
        program = etree.SubElement(
            root, "tlLogic", id=light, type="static", programID="scenario", offset="0"
        )
        letters = [_DARK] * links[light]
        ends = [
            # States at the beginning are those of the first phase.
            *sorted(time for time in times if time > 0.0),
            max(result.end_time, *times) + _AFTER,
        ]
        for begin, end in pairwise([0.0, *ends]):
            for link, letter in times.get(begin, {}).items():
                letters[link] = letter
            etree.SubElement(
                program, "phase", duration=decimal(end - begin), state="".join(letters)
            )
    return root


# files --------------------------------------------------------------------------------------


def _routes(
    tracks: Sequence[recording.Track],
    ids: Sequence[str],
    places: Sequence[_Places],
    roads: _Roads,
    ego: str | None,
) -> tuple[etree._Element, list[str]]:
    """Vehicle types, and the vehicles in the order of departure, as SUMO requires; vehicles without
    a route."""
    root, remarks, vehicles = etree.Element("routes"), [], []
    for track, name, way in zip(tracks, ids, places, strict=True):
        edges, first = _edges(way), way[0]
        walks = KINDS.get(track.category, OBSTACLE).vehicle_class == "pedestrian"
        # SUMO's routes begin on an edge outside of junctions, and are not for persons.
        if walks or first is None or first.lane.startswith(":"):
            why = "walks" if walks else "does not start on a lane"
            remarks.append(f"{track.name!r} {why}: it is in the FCD file, and has no route")
            continue
        broken = next((pair for pair in pairwise(edges) if pair not in roads.joined), None)
        if broken is not None:
            remarks.append(
                f"{track.name!r} leaves {broken[0]} for {broken[1]}, to which SUMO knows no way: "
                "its route ends there"
            )
            edges = edges[: edges.index(broken[0]) + 1]
        root.append(_type(track, f"type.{name}", _hurry(track, way, roads), ego))
        vehicles.append(_vehicle(track, name, first, edges))
    root.extend(sorted(vehicles, key=lambda vehicle: float(vehicle.get("depart", "0"))))
    return root, remarks


def _hurry(track: recording.Track, way: _Places, roads: _Roads) -> float:
    """Return the speed-limit factor, at least 1, that lets a vehicle depart at its speed."""
    speeds = zip(track.columns["speed"].tolist(), way, strict=True)
    return max(
        [1.0, *(speed / roads.limits[place.lane] for speed, place in speeds if place is not None)]
    )


def _type(track: recording.Track, name: str, hurry: float, ego: str | None) -> etree._Element:
    kind = KINDS.get(track.category, OBSTACLE)
    size = {"length": track.box.length, "width": track.box.width, "height": track.box.height}
    limits = {"accel": kind.acceleration, "decel": kind.deceleration, "maxSpeed": kind.speed}
    # 1.001: a rounded factor must not refuse a departure at the vehicle's speed.
    numbers = {
        key: decimal(max(value, 0.1))
        for key, value in {**size, **limits, "speedFactor": 1.001 * hurry}.items()
    }
    vehicle_class = _CLASSES.get(track.role, kind.vehicle_class)
    # Without chance: the same files give the same simulation.
    element = etree.Element(
        "vType", {"id": name, "vClass": vehicle_class, "sigma": "0", "speedDev": "0", **numbers}
    )
    if track.mass > 0.0:
        element.set("mass", decimal(track.mass))
    texts = {"name": track.name, "kind": track.kind, "category": track.category, "role": track.role}
    texts["ego"] = "true" if track.name == ego else ""
    box = {f"box_{axis}": decimal(getattr(track.box, axis)) for axis in "xyz"}
    for key, value in {**texts, **box, "front_axle": decimal(track.front_axle)}.items():
        if value:
            etree.SubElement(element, "param", key=key, value=value)
    return element


def _vehicle(
    track: recording.Track, name: str, first: _Place, edges: Sequence[str]
) -> etree._Element:
    vehicle = etree.Element(
        "vehicle", id=name, type=f"type.{name}", depart=decimal(track.columns["time"][0])
    )
    vehicle.set("departLane", first.lane.rpartition("_")[2])
    vehicle.set("departPos", decimal(first.position))
    # SUMO's vehicles can't depart backwards.
    vehicle.set("departSpeed", decimal(max(track.columns["speed"][0], 0.0)))
    etree.SubElement(vehicle, "route", edges=" ".join(edges))
    return vehicle


def _fcd(result: RunResult, ids: Sequence[str], places: Sequence[_Places]) -> etree._Element:
    root, lights = etree.Element("fcd-export"), VehicleLights(result.events)
    tracks = list(result.recording.tracks.values())
    fronts = [
        fixed_point(track, track.box.x + track.box.length / 2, track.box.y, 0.0) for track in tracks
    ]
    walks = [KINDS.get(track.category, OBSTACLE).vehicle_class == "pedestrian" for track in tracks]
    for time, there in moments(result.recording):
        step = etree.SubElement(root, "timestep", time=decimal(time))
        for number, row in sorted(
            there, key=lambda pair: walks[pair[0]]
        ):  # persons come after vehicles
            columns, place = tracks[number].columns, places[number][row]
            element = etree.SubElement(
                step, "person" if walks[number] else "vehicle", id=ids[number]
            )
            for axis, value in zip("xyz", fronts[number][row], strict=True):
                element.set(axis, decimal(value))
            element.set(
                "angle", decimal(float(np.mod(90.0 - np.degrees(columns["h"][row]), 360.0)))
            )
            element.set("speed", decimal(abs(columns["speed"][row])))
            # OpenSCENARIO's pitch is positive nose down, SUMO's slope uphill.
            element.set("slope", decimal(-math.degrees(columns["pitch"][row])))
            if not walks[number]:
                element.set("acceleration", decimal(columns["acceleration"][row]))
                if modes := lights.at(tracks[number].name, time):
                    element.set(
                        "signals",
                        str(
                            sum(
                                bit
                                for light, bit in _LIGHTS.items()
                                if modes.get(light, "off") != "off"
                            )
                        ),
                    )
            if place is not None:
                element.set("pos", decimal(place.position))
                element.set(
                    *(
                        ("edge", place.lane.rpartition("_")[0])
                        if walks[number]
                        else ("lane", place.lane)
                    )
                )
    return root


def _configuration(network: str, names: Sequence[str], result: RunResult) -> etree._Element:
    routes, *programs = names
    root = etree.Element("configuration")
    files, time = etree.SubElement(root, "input"), etree.SubElement(root, "time")
    etree.SubElement(files, "net-file", value=network)
    etree.SubElement(files, "route-files", value=routes)
    if programs:
        etree.SubElement(files, "additional-files", value=",".join(programs))
    for tag, value in (
        ("begin", 0.0),
        ("end", result.end_time),
        ("step-length", result.recording.timestep),
    ):
        etree.SubElement(time, tag, value=decimal(value))
    return root
