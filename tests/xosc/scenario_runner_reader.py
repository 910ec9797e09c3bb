"""Reads scenarios with CARLA scenario_runner's own parser, on CARLA's own map, without a server.

For a Python that has `carla` and what scenario_runner needs, started by
tests/xosc/test_exports_carla.py as

    python scenario_runner_reader.py FOLDER-WITH-SRUNNER FILE…

Prints a line of JSON for each file: what it stops at, or its egos, where everyone starts (x, y,
heading, speed, in the world frame of OpenDRIVE), and how many actions and conditions were made.
"""

import json
import math
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from unittest.mock import MagicMock

sys.path.insert(0, sys.argv[1])
for _name in ("", ".navigation", ".tools", ".tools.misc", *(
    f".navigation.{each}" for each in ("global_route_planner", "basic_agent", "local_planner",
        "controller", "behavior_agent",
                                       "constant_velocity_agent")
)):  # fmt: skip
    sys.modules[f"agents{_name}"] = (
        MagicMock()
    )  # drives, and is no part of what is installed by pip

import carla  # noqa: E402
from srunner.scenarioconfigs.openscenario_configuration import OpenScenarioConfiguration  # noqa: E402
from srunner.scenariomanager.carla_data_provider import CarlaDataProvider  # noqa: E402
from srunner.tools.openscenario_parser import OpenScenarioParser  # noqa: E402


def read(path):
    """What scenario_runner makes of a file."""
    logic = ElementTree.parse(path).find("RoadNetwork/LogicFile").get("filepath")
    road = (path.parent / logic).read_text(encoding="utf-8")
    town = carla.Map("map", road[road.find("<OpenDRIVE") :])
    client = MagicMock()
    client.get_world().get_map.return_value = town
    CarlaDataProvider.set_world = staticmethod(lambda _world: None)
    CarlaDataProvider.get_map = staticmethod(lambda _world=None: town)
    CarlaDataProvider.is_sync_mode = staticmethod(lambda: True)
    config = OpenScenarioConfiguration(str(path), client, {})
    everyone = config.other_actors + config.ego_vehicles
    actors = [MagicMock(attributes={"role_name": each.rolename}) for each in everyone]
    made = 0
    for story in config.stories:
        for group in story.iter("ManeuverGroup"):
            names = [each.get("entityRef") for each in group.find("Actors")]
            doing = [actor for actor in actors if actor.attributes["role_name"] in names]
            for action in group.iter("Action"):
                OpenScenarioParser.convert_maneuver_to_atomic(
                    action, (doing or [None])[0], [*actors, None], config.catalogs, config
                )
                made += 1
        for condition in story.iter("Condition"):
            OpenScenarioParser.convert_condition_to_atomic(condition, actors)
            made += 1
    starts = {each.rolename: place(each.transform, each.speed) for each in everyone}
    return {"egos": [each.rolename for each in config.ego_vehicles], "starts": starts, "made": made}


def place(transform, speed):
    """CARLA's axes are left-handed."""
    return [
        transform.location.x,
        -transform.location.y,
        -math.radians(transform.rotation.yaw),
        speed,
    ]


def outcome(path):
    """What scenario_runner makes of a file, or what it stops at."""
    try:
        return read(path)
    except Exception as error:  # whatever its parser does not expect
        return {"error": f"{type(error).__name__}: {error}"}


for _file in map(Path, sys.argv[2:]):
    print(json.dumps({"file": _file.name, **outcome(_file)}))
