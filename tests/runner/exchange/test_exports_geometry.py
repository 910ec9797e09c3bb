"""Exports of documents that need the roads: routes and trajectories, first
positions, what then moves as before.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import runner
import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from runner.judging.settings import RunSettings
from tests.runner.files import car, place, scenario, speed_action, story
from tests.xosc.scenario_runner_grammar import stops_at
from xosc.exports.draft import Folder
from xosc.exports.starts import actors

SCENARIOS = Path(__file__).parents[2] / "conformance" / "scenarios"
LIBRARY = Path(xosc.__file__).parent / "library"
SETTINGS = RunSettings(world="kinematic", sut="none", max_time=15.0)
CLOSE = 0.2
"""m: lane changes by distance instead of time, and the runner's steps along
bends, make that much
"""


def exported(path: Path, target: str, folder: Path) -> tuple[Path, list[str]]:
    """The file that an export makes of a scenario, and the remarks."""
    (done,) = export_documents([path], TARGETS[target], Folder(folder))
    assert done.exit_code == 0, done.remarks
    return folder / path.name, list(done.remarks)


def distance(path: Path, copy: Path, but: float = -1.0) -> float:
    """The greatest distance (m) between the same participants at the same times,
    but for one (s), until the original ends.
    """
    tracks, others = (runner.run(each, SETTINGS).recording.tracks for each in (path, copy))
    greatest = 0.0
    for name, track in tracks.items():
        other = others[name if name in others else "hero"].columns
        rows = len(track.columns["time"])
        assert np.array_equal(other["time"][:rows], track.columns["time"])
        apart = np.hypot(
            other["x"][:rows] - track.columns["x"], other["y"][:rows] - track.columns["y"]
        )
        apart[np.isclose(track.columns["time"], but)] = 0.0
        greatest = max(greatest, float(apart.max()))
    return greatest


@pytest.mark.parametrize(
    "name",
    sorted(path.stem for path in LIBRARY.glob("roundabout*.xosc") if "variation" not in path.stem),
)
def test_routes_for_carla_are_trajectories_that_lead_the_same_way(
    name: str, tmp_path: Path
) -> None:
    path = LIBRARY / f"{name}.xosc"
    assert list(xosc.load(path).root.iter("AssignRouteAction"))
    copy, remarks = exported(path, "carla", tmp_path)
    root = xosc.load(copy).root
    assert any("written as a trajectory" in remark for remark in remarks)
    assert not list(root.iter("AssignRouteAction")) and stops_at(root) == []
    controlled = {
        each.getparent().getparent().getparent().getparent().get("entityRef")
        for each in root.iter("Controller")
        if each.find("Properties/Property[@value='simple_vehicle_control']") is not None
    }
    assert controlled, "its default controller drives by the times of all trajectories"
    assert distance(path, copy) < CLOSE


def test_a_route_that_the_lanes_lead_anyway_is_left_out_for_carla(tmp_path: Path) -> None:
    point = (
        '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" '
        's="{}"/></Position></Waypoint>'
    )
    route = f'<Route name="r" closed="false">{point.format(110)}{point.format(300)}</Route>'
    assign = f"<PrivateAction><RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction></PrivateAction>"
    path = scenario(tmp_path, stories=story("Lead", [(0.5, assign), (1.0, speed_action(5))]))
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any("the lanes lead that way" in remark for remark in remarks)
    assert not list(xosc.load(copy).root.iter("RoutingAction")) and distance(path, copy) < 1e-6


def test_a_route_is_refused_for_carla_where_another_action_would_end_its_trajectory(
    tmp_path: Path,
) -> None:
    path = LIBRARY / "roundabout_exiting.xosc"
    copy = tmp_path / "library" / path.name
    shutil.copytree(LIBRARY / "catalogs", copy.parent / "catalogs")
    (assigned,) = xosc.load(path).node.iter("AssignRouteAction")
    offset = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
        <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.5"/>
        </LaneOffsetTarget></LaneOffsetAction></LateralAction>
        </PrivateAction>"""
    more = story(actors(assigned)[0], [(1.0, offset)])
    copy.write_text(
        path.read_text(encoding="utf-8").replace("<Story ", f"{more}<Story ", 1), encoding="utf-8"
    )
    settings = RunSettings(road_path=(str(LIBRARY.parents[1] / "xodr" / "library"),))
    (done,) = export_documents([copy], TARGETS["carla"], Folder(tmp_path / "out"), settings)
    assert done.exit_code == 4 and "which LateralAction in line" in done.remarks[0]


INITS = {
    "relative speed": '<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics '
                      'dynamicsShape="step" value="0" '
    'dynamicsDimension="time"/><SpeedActionTarget><RelativeTargetSpeed entityRef="Ego" value="-5" '
    'speedTargetValueType="delta" '
    'continuous="false"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>',
    "gradual speed": speed_action(15, 'dynamicsShape="linear" dynamicsDimension="time" value="2"'),
    "lane change": '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics '
                   'dynamicsShape="linear" value="20" '
    'dynamicsDimension="distance"/><LaneChangeTarget><AbsoluteTargetLane '
    'value="-2"/></LaneChangeTarget></LaneChangeAction>'
    "</LateralAction></PrivateAction>",
    "distance": '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" '
                'distance="30" freespace="true" '
    'continuous="false" '
    'displacement="leadingReferencedEntity"/></LongitudinalAction></PrivateAction>',
    "controller": ('<PrivateAction><ControllerAction><ActivateControllerAction '
                  'lateral="0"/></ControllerAction></PrivateAction>'),
}  # fmt: skip


REASONS = {
    "relative speed": ("is written as the 15 m/s",),
    "gradual speed": ("done by a story at the beginning",),
    "lane change": ("done by a story at the beginning",),
    "distance": ("the first position has the distance",),
    "controller": ("switch CARLA's autopilot",),
}  # fmt: skip


@pytest.mark.parametrize("kind", INITS)
def test_first_actions_for_carla_are_what_it_reads(kind: str, tmp_path: Path) -> None:
    init = place("Ego", 100, 20) + place("Lead", 150, 10, more=INITS[kind])
    path = scenario(tmp_path, init=init, stories=story("Ego", [(0.5, speed_action(10))]))
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert stops_at(xosc.load(copy).root) == []
    assert any(reason in remark for remark in remarks for reason in REASONS[kind])
    assert distance(path, copy) < 1e-6


def test_rates_for_carla_become_the_times_that_they_take_from_what_was_demanded_before(
    tmp_path: Path,
) -> None:
    relative = speed_action(0).replace(
        '<AbsoluteTargetSpeed value="0"/>',
        '<RelativeTargetSpeed entityRef="Ego" value="-4" '
        'speedTargetValueType="delta" continuous="false"/>',
    )
    by_rate = 'dynamicsShape="linear" dynamicsDimension="rate" value="{}"'
    events = [(0.5, speed_action(14, by_rate.format(4))), (3.0, relative.replace(
        'dynamicsShape="step" dynamicsDimension="time" value="0"', by_rate.format(2)))]  # fmt: skip
    path = scenario(tmp_path, stories=story("Lead", events), stop=6.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    took = [
        remark.split("written as the ")[1] for remark in remarks if "the rate is written" in remark
    ]
    assert took == ["1 s that it takes from 14 m/s", "1 s that it takes from 10 m/s"]
    assert distance(path, copy) < 1e-6


POSITIONS = [
    '<LanePosition roadId="1" laneId="-1" s="150" offset="0.4"/>',
    ('<LanePosition roadId="1" laneId="-1" s="150"><Orientation type="absolute" '
    'h="0.2"/></LanePosition>'),
    '<RelativeObjectPosition entityRef="Ego" dx="50" dy="0.5"/>',
    '<RelativeLanePosition entityRef="Ego" dLane="-1" ds="50" offset="0.3"/>',
    '<RoutePosition><RouteRef><Route name="r" closed="false">'
    '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" '
    's="10"/></Position></Waypoint>'
    '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" '
    's="300"/></Position></Waypoint>'
    '</Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="140" '
    'laneId="-1"/></InRoutePosition></RoutePosition>',
]  # fmt: skip


@pytest.mark.parametrize("position", POSITIONS, ids=lambda text: str(text).split()[0].strip("<>"))
def test_first_positions_for_carla_are_places_where_it_reads_them_otherwise(
    position: str, tmp_path: Path
) -> None:
    lead = place("Lead", 150, 10).replace(
        '<LanePosition roadId="1" laneId="-1" s="150"/>', position
    )
    path = scenario(tmp_path, entities=[car("Ego"), car("Lead")], init=place("Ego", 100, 20) + lead,
                    stories=story("Lead", [(0.5, speed_action(5))]))  # fmt: skip
    copy, _ = exported(path, "carla", tmp_path / "out")
    root = xosc.load(copy).root
    assert stops_at(root) == [] and {str(each[0].tag) for each in root.iter("Position")} <= {
        "LanePosition",
        "WorldPosition",
    }
    assert distance(path, copy) < 1e-3


@pytest.mark.parametrize(
    ("name", "target"), [("ClothoidSpline", "1.2"), ("TrajectoryPosition", "1.0")]
)
def test_shapes_and_positions_that_a_version_lacks_are_places(
    name: str, target: str, tmp_path: Path
) -> None:
    path = SCENARIOS / f"{name}.xosc"
    copy, remarks = exported(path, target, tmp_path)
    assert any(f": {name}: it is written as" in remark for remark in remarks)
    assert not list(xosc.load(copy).root.iter(name)) and distance(path, copy) < CLOSE
