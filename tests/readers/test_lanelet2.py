"""Our Lanelet2 maps as the package `lanelet2` reads them: no complaint, lanes
where they are and linked as they are.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import xodr
from tests.readers.conftest import Read
from tests.runner.matrix_case import road
from xodr.formats.maps import files as maps
from xodr.formats.maps.lane_map import LaneMap
from xodr.formats.maps.projecting import Projector

LIBRARY = sorted((Path(xodr.__file__).parent / "library").glob("*.xodr"))

READ = """
import json, sys
import lanelet2
from lanelet2.projection import UtmProjector
answers = {}
for path in sys.argv[2:]:
    origin = lanelet2.io.Origin(*json.loads(sys.argv[1]))
    lanes, complaints = lanelet2.io.loadRobust(path, UtmProjector(origin))
    answer = {"complaints": list(complaints), "areas": len(lanes.areaLayer), "ends": {}, "ways": {}, "passable": {}}
    answer["rules"] = sorted(rule.attributes["subtype"] for rule in lanes.regulatoryElementLayer)
    for one in lanes.laneletLayer:
        if "name" in one.attributes:
            left, right = one.leftBound, one.rightBound
            answer["ends"][one.attributes["name"]] = [[p.x, p.y] for p in (left[0], left[-1], right[0], right[-1])]
    for user in ("Vehicle", "Pedestrian", "Bicycle"):
        rules = lanelet2.traffic_rules.create(lanelet2.traffic_rules.Locations.Germany, getattr(lanelet2.traffic_rules.Participants, user))
        graph = lanelet2.routing.RoutingGraph(lanes, rules)
        answer["complaints"] += list(graph.checkValidity(False))
        passable = [one for one in lanes.laneletLayer if rules.canPass(one)]
        answer["passable"][user] = [one.attributes["name"] for one in passable]
        answer["ways"][user] = [[one.attributes["name"], other.attributes["name"]] for one in passable for other in graph.following(one)]
    answers[path] = answer
print(json.dumps(answers))
"""
CARS = {"driving", "exit", "offRamp", "onRamp", "entry", "connectingRamp"}


def pairs(made: LaneMap, types: set[str]) -> list[list[str]]:
    """Connections between lanes of some types."""
    return sorted(
        [name, following]
        for name, lane in made.lanes.items()
        for following in lane.successors
        if {lane.type, made.lanes[following].type} <= types
    )


def test_lanes_of_the_library_are_where_they_are_and_linked(read: Read, tmp_path: Path) -> None:
    made = {
        str(tmp_path / f"{path.stem}.osm"): maps.convert(path, tmp_path / f"{path.stem}.osm")
        for path in LIBRARY
    }
    for path, answer in read(READ, "[0.0, 0.0]", *made).items():
        source = made[path].source
        assert answer["complaints"] == [], path
        assert sorted(answer["ways"]["Vehicle"]) == pairs(source, CARS), path
        for name, ends in answer["ends"].items():
            lane = source.lanes[name]
            ours = [lane.left[0], lane.left[-1], lane.right[0], lane.right[-1]]
            assert np.allclose(ends, np.array(ours)[:, :2], atol=0.03), (path, name)


def test_signs_lights_walks_and_areas_are_known_by_their_kinds(read: Read, tmp_path: Path) -> None:
    source = tmp_path / "source.xodr"
    source.write_text(road(), encoding="utf-8")
    made = maps.convert(source, tmp_path / "map.osm")
    projector = Projector.of(made.source)
    assert projector is not None
    longitude, latitude, _ = projector.to_geodetic(np.zeros((1, 3)))
    (answer,) = read(READ, json.dumps([latitude[0], longitude[0]]), made.path).values()
    kinds = {name: lane.type for name, lane in made.source.lanes.items()}
    assert answer["complaints"] == []
    assert answer["rules"] == ["traffic_light", "traffic_sign"]
    assert sorted(answer["passable"]["Pedestrian"]) == sorted(
        name for name, kind in kinds.items() if kind == "sidewalk"
    )
    assert set(answer["passable"]["Vehicle"]) == {
        name for name, kind in kinds.items() if kind in CARS
    }
