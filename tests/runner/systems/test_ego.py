"""The ego: how it is found, when the system under test drives it, and how that
combines with what is scripted.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from runner.judging.execution import prepare
from runner.systems import Control
from runner.systems.kinds.commanded import Scripted
from schemas.common.errors import UsageError
from tests.conformance.support import at, events, track
from tests.runner.files import ROADS, car, place, scenario, speed_action, story

PEDESTRIAN = """
    <ScenarioObject name="Ego">
      <Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian">
        <BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.6" length="0.4" height="1.8"/></BoundingBox>
        <Properties/>
      </Pedestrian>
    </ScenarioObject>"""


def controller_action(inner: str) -> str:
    return f"<PrivateAction><ControllerAction>{inner}</ControllerAction></PrivateAction>"


def activate(**domains: bool) -> str:
    attributes = " ".join(f'{name}="{str(value).lower()}"' for name, value in domains.items())
    return controller_action(f"<ActivateControllerAction {attributes}/>")


def override(inner: str) -> str:
    return controller_action(
        f"<OverrideControllerValueAction>{inner}</OverrideControllerValueAction>"
    )


def drive(path: Path, *script: tuple[float, Control], **settings: Any) -> runner.RunResult:
    return runner.run(path, world="kinematic", timestep=0.01, sut=Scripted(script), **settings)


def alone(folder: Path, **settings: Any) -> Path:
    """Ego alone at 20 m/s for 6 s."""
    settings = {
        "entities": [car("Ego", performance=settings.pop("performance", ""))],
        "stop": 6.0,
        **settings,
    }
    return scenario(
        folder,
        init=place("Ego", 100, settings.pop("speed", 20), more=settings.pop("more", "")),
        **settings,
    )


# which one it is ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("entities", "asked", "found"),
    [
        ([car("A"), car("Ego")], None, "Ego"),
        ([car("A"), car("Ego")], "A", "A"),
        ([car("A"), car("ego_vehicle")], None, "ego_vehicle"),
        ([car("A"), car("EgoVehicle1")], None, "EgoVehicle1"),
        ([car("A"), car("EGO-CAR")], None, "EGO-CAR"),
        ([car("A"), car("Hero")], None, "Hero"),
        ([car("Ego", "driver"), car("A", "driver")], None, "Ego"),
        ([car("A", "driver"), car("Ego")], None, "Ego"),
        ([car("Ego1"), car("Ego2", "driver")], None, "Ego2"),
        ([car("Ego1"), car("Ego2")], None, "Ego1"),
        ([car("A"), car("B", "driver")], None, "B"),
        ([car("A", "driver"), car("B", "driver")], None, None),
        ([car("A"), car("B")], None, None),
        ([car("Egon"), car("Lego")], None, None),
        ([PEDESTRIAN, car("A")], None, None),
        ([PEDESTRIAN, car("A")], "Ego", "Ego"),
    ],
)
def test_how_the_ego_is_found(
    tmp_path: Path, entities: list[str], asked: str | None, found: str | None
) -> None:
    path = scenario(tmp_path, entities=entities, init=" ", stories=" ")
    ego = prepare(path).ego(asked)
    assert (ego.name if ego is not None else None) == found


def test_an_ego_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"'ego'; did you mean 'Ego'\?"):
        prepare(scenario(tmp_path)).ego("ego")


def test_without_an_ego_nobody_is_driven_and_nothing_is_tested(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        entities=[car("A"), car("B")],
        init=place("A", 100, 20) + place("B", 102, 20),
        stories=" ",
        stop=0.1,
    )
    result = drive(path, (0.0, Control(acceleration=-5.0)))
    assert (result.ego, result.sut, [cause.name for cause in result.verdict.causes]) == (
        None,
        "none",
        ["no-ego"],
    )
    assert at(track(result, "A"), 0.1, "speed") == 20.0


# when the system drives ---------------------------------------------------------------------


def test_a_scenario_that_activates_no_controller_is_driven_from_the_beginning(
    tmp_path: Path,
) -> None:
    result = drive(alone(tmp_path), (0.0, Control(acceleration=-2.0)))
    assert at(track(result, "Ego"), 3.0, "speed") == pytest.approx(14.0)
    assert result.sut == "runner.systems.kinds.commanded:Scripted"


ASSIGN = controller_action(
    "<AssignControllerAction><Controller "
    'name="driver"><Properties/></Controller></AssignControllerAction>'
)


def test_activation_hands_the_ego_over_and_back(tmp_path: Path) -> None:
    switches = [
        (3.0, activate(longitudinal=True, lateral=True)),
        (4.0, activate(longitudinal=False, lateral=False)),
    ]
    path = alone(tmp_path, more=ASSIGN, stories=story("Ego", switches))
    result = drive(path, (0.0, Control(acceleration=-2.0, reason="test")))
    ego = track(result, "Ego")
    assert at(ego, 3.0, "speed") == 20.0
    assert at(ego, 4.0, "speed") == pytest.approx(18.0)
    # it goes back to the scripted speed at 3.5 m/s², not at once
    assert at(ego, 4.3, "speed") == pytest.approx(18.0 + 0.3 * 3.5)
    assert at(ego, 5.0, "speed") == pytest.approx(20.0)
    assert [
        (e.kind, round(e.time, 2)) for e in result.events if e.kind.startswith("intervention")
    ] == [
        ("interventionStart", 3.0),
        ("interventionEnd", 4.57),
    ]


@pytest.mark.parametrize(
    ("domains", "speed", "turns"),
    [
        ({"longitudinal": True}, 18.0, False),
        ({"lateral": True}, 20.0, True),
        ({"longitudinal": True, "lateral": True}, 18.0, True),
    ],
)
def test_each_domain_is_handed_over_by_itself(
    tmp_path: Path, domains: dict[str, bool], speed: float, turns: bool
) -> None:
    path = alone(tmp_path, stories=story("Ego", [(1.0, activate(**domains))]), stop=2.0)
    ego = track(drive(path, (0.0, Control(acceleration=-2.0, steering=0.01))), "Ego")
    assert at(ego, 2.0, "speed") == pytest.approx(speed)
    assert (abs(at(ego, 2.0, "h")) > 0.01) == turns


def test_activation_by_assign_controller_action(tmp_path: Path) -> None:
    assign = ASSIGN.replace(
        "<AssignControllerAction>",
        '<AssignControllerAction activateLongitudinal="true" activateLateral="false">',
    )
    path = alone(tmp_path, stories=story("Ego", [(1.0, assign)]))
    ego = track(drive(path, (0.0, Control(acceleration=-2.0))), "Ego")
    assert (at(ego, 1.0, "speed"), at(ego, 2.0, "speed")) == (20.0, pytest.approx(18.0))


def test_activating_somebody_elses_controller_does_not_concern_the_ego(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(1.0, activate(longitudinal=True))]))
    ego = track(drive(path, (0.0, Control(acceleration=-2.0))), "Ego")
    assert at(ego, 0.5, "speed") == pytest.approx(19.0)


# longitudinal -------------------------------------------------------------------------------


def test_scripted_speed_is_the_demand_and_an_intervention_returns_to_it(tmp_path: Path) -> None:
    faster = speed_action(24, 'dynamicsShape="linear" dynamicsDimension="rate" value="2"')
    path = alone(tmp_path, stories=story("Ego", [(1.0, faster)]))
    result = drive(
        path, (2.0, Control(acceleration=-4.0, reason="somebody is in the way")), (2.5, Control())
    )
    ego = track(result, "Ego")
    assert at(ego, 2.0, "speed") == pytest.approx(22.0, abs=0.03)
    assert at(ego, 2.5, "speed") == pytest.approx(20.0, abs=0.03)
    assert at(ego, 3.0, "speed") == pytest.approx(21.75, abs=0.03)
    assert at(ego, 5.0, "speed") == pytest.approx(24.0)
    (start,) = events(result, "interventionStart")
    (end,) = events(result, "interventionEnd")
    assert (start.subject, start.text) == ("Ego", "somebody is in the way")
    assert end.text == "back at the scripted speed"


@pytest.mark.parametrize(
    ("performance", "asked", "given"),
    [
        ('maxSpeed="70" maxAcceleration="2" maxDeceleration="3"', -8.0, -3.0),
        ('maxSpeed="70" maxAcceleration="2" maxDeceleration="3"', 8.0, 2.0),
        ('maxSpeed="70" maxAcceleration="50" maxDeceleration="50"', -30.0, -9.81),
        ('maxSpeed="70" maxAcceleration="50" maxDeceleration="50"', 30.0, 9.81),
        ('maxSpeed="70" maxAcceleration="2" maxDeceleration="3"', -1.0, -1.0),
    ],
)
def test_accelerations_are_limited_by_performance_and_grip(
    tmp_path: Path, performance: str, asked: float, given: float
) -> None:
    result = drive(alone(tmp_path, performance=performance), (0.0, Control(acceleration=asked)))
    assert at(track(result, "Ego"), 1.0, "speed") == pytest.approx(20.0 + given)


def test_the_vehicle_goes_no_faster_than_it_can(tmp_path: Path) -> None:
    path = alone(tmp_path, performance='maxSpeed="22" maxAcceleration="5" maxDeceleration="5"')
    assert at(
        track(drive(path, (0.0, Control(acceleration=5.0))), "Ego"), 3.0, "speed"
    ) == pytest.approx(22.0)


def test_a_slippery_road_brakes_less(tmp_path: Path) -> None:
    ice = '<RoadCondition frictionScaleFactor="0.2"/>'
    environment = (
        "<GlobalAction><EnvironmentAction><Environment "
        f'name="ice">{ice}</Environment></EnvironmentAction></GlobalAction>'
    )
    path = scenario(tmp_path, init=environment + place("Ego", 100, 20) + place("Lead", 400, 20))
    ego = track(drive(path, (0.0, Control(acceleration=-8.0))), "Ego")
    assert at(ego, 1.0, "speed") == pytest.approx(20.0 - 0.2 * 9.81)


def test_braking_ends_in_standstill(tmp_path: Path) -> None:
    ego = track(drive(alone(tmp_path, speed=2), (0.0, Control(acceleration=-8.0))), "Ego")
    assert at(ego, 1.0, "speed") == 0.0
    assert np.ptp(ego["x"][ego["time"] > 1.0]) == 0.0


def test_braking_backwards_comes_through_standstill(tmp_path: Path) -> None:
    ego = track(
        drive(alone(tmp_path, speed=-2), (0.0, Control(acceleration=3.9)), (0.6, Control())), "Ego"
    )
    assert at(ego, 0.2, "speed") == pytest.approx(-2 + 0.2 * 3.9)
    assert 0.0 in ego["speed"]
    # back to the scripted −2 m/s by 3.5 m/s²
    assert at(ego, 1.0, "speed") == pytest.approx(at(ego, 0.7, "speed") - 0.3 * 3.5)
    assert at(ego, 3.0, "speed") == -2.0


def test_a_reversing_ego_stays_where_cas_stops_it(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        entities=[car("Ego"), car("Wall")],
        init=place("Ego", 100, -3) + place("Wall", 85, 0),
        stop=8.0,
    )
    result = runner.run(path, world="kinematic")
    ego = track(result, "Ego")
    assert result.verdict.passed
    assert abs(at(ego, 8.0, "speed")) < 0.5
    assert at(ego, 8.0, "x") > 91.0


def test_a_braking_ego_falls_behind_a_scripted_trajectory_and_stays_on_it(tmp_path: Path) -> None:
    vertices = "".join(
        f'<Vertex time="{t}"><Position><WorldPosition x="{100 + 20 * t}" '
        f'y="{-1.75 + 0.5 * t}"/></Position></Vertex>'
        for t in range(5)
    )
    follow = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        '<Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>'
        '<TimeReference><Timing domainAbsoluteRelative="relative" scale="1" '
        'offset="0"/></TimeReference>'
        "<TrajectoryFollowingMode "
        'followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )
    path = alone(tmp_path, more=follow, stop=3.0)
    ego = track(drive(path, (1.0, Control(acceleration=-5.0))), "Ego")
    assert at(ego, 3.0, "speed") == pytest.approx(10.0, abs=0.1)
    way = np.hypot(ego["x"] - 100, ego["y"] + 1.75)
    assert np.allclose(ego["y"] + 1.75, way * math.sin(math.atan2(0.5, 20)), atol=1e-3)


# overridden inputs --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inputs", "control", "change"),
    [
        ('<Brake active="true" value="0.5"/>', Control(), -4.0),
        ('<Brake active="true" value="0.5"/>', Control(acceleration=-8.0), -4.0),
        ('<Brake active="true" value="0"/>', Control(acceleration=-8.0), 0.0),
        ('<Brake active="true" value="0"/>', Control(acceleration=2.0), 2.0),
        ('<Throttle active="true" value="0.25"/>', Control(), 2.0),
        ('<Throttle active="true" value="0.25"/>', Control(acceleration=-3.0), -1.0),
        ('<ParkingBrake active="true" value="1"/>', Control(acceleration=-3.0), -8.0),
        ('<ParkingBrake active="true" value="0"/>', Control(acceleration=-3.0), -3.0),
        ('<Clutch active="true" value="1"/>', Control(acceleration=-3.0), -3.0),
        ('<Brake active="false" value="1"/>', Control(acceleration=-3.0), -3.0),
    ],
)
def test_overridden_pedals_take_the_place_of_the_systems(
    tmp_path: Path, inputs: str, control: Control, change: float
) -> None:
    path = alone(tmp_path, stories=story("Ego", [(1.0, override(inputs))]))
    ego = track(drive(path, (1.0, control)), "Ego")
    assert at(ego, 2.0, "speed") - at(ego, 1.0, "speed") == pytest.approx(change, abs=1e-6)


def test_released_pedals_are_the_systems_again(tmp_path: Path) -> None:
    held = [
        (1.0, override('<Brake active="true" value="0.5"/>')),
        (2.0, override('<Brake active="false" value="0"/>')),
    ]
    ego = track(drive(alone(tmp_path, stories=story("Ego", held))), "Ego")
    assert at(ego, 2.0, "speed") == pytest.approx(16.0)
    assert at(ego, 4.0, "speed") == pytest.approx(20.0)


# lateral ------------------------------------------------------------------------------------


def test_steering_is_a_kinematic_bicycle(tmp_path: Path) -> None:
    path = alone(tmp_path, speed=10, stop=3.0)
    ego = track(drive(path, (0.0, Control(steering=0.02))), "Ego")
    radius = 3.0 / math.tan(0.02)
    angle = 30.0 / radius
    assert at(ego, 3.0, "h") == pytest.approx(angle, rel=1e-6)
    assert at(ego, 3.0, "x") == pytest.approx(100 + radius * math.sin(angle), abs=1e-3)
    assert at(ego, 3.0, "y") == pytest.approx(-1.75 + radius * (1 - math.cos(angle)), abs=1e-3)


def test_wheels_turn_no_further_than_they_can(tmp_path: Path) -> None:
    ego = track(drive(alone(tmp_path, speed=1, stop=1.0), (0.0, Control(steering=1.5))), "Ego")
    assert at(ego, 1.0, "h") == pytest.approx(math.tan(0.5) / 3.0, rel=1e-6)


def test_an_ego_that_is_no_longer_steered_follows_the_lane_that_it_is_on(tmp_path: Path) -> None:
    path = alone(tmp_path, speed=10)
    ego = track(
        drive(
            path, (0.0, Control(steering=0.07)), (1.0, Control(steering=-0.07)), (2.0, Control())
        ),
        "Ego",
    )
    late = ego["time"] > 2.1
    assert set(ego["lane_id"][late]) == {1}
    assert np.ptp(ego["t"][late]) == pytest.approx(0.0, abs=1e-6)


def test_a_steered_ego_stays_on_the_surface_of_the_road(tmp_path: Path) -> None:
    road = (ROADS / "straight.xodr").read_text()
    assert "<lanes>" in road
    slope = '<elevationProfile><elevation s="0" a="5" b="0.05" c="0" d="0"/></elevationProfile>'
    (tmp_path / "straight.xodr").write_text(road.replace("<lanes>", slope + "<lanes>", 1))
    ego = track(drive(alone(tmp_path), (1.0, Control(steering=0.001))), "Ego")
    assert np.allclose(ego["z"], 5 + 0.05 * ego["x"], atol=1e-6)
    assert at(ego, 3.0, "pitch") == pytest.approx(-math.atan(0.05), abs=1e-6)
