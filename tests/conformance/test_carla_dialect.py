"""What scenarios for CARLA's scenario_runner mean otherwise than the standard: axes, triggers,
speed steps, controllers.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import runner
from runner.systems import Control
from runner.systems.base import Observation
from schemas.common.errors import InvalidFile
from tests.conformance.support import at, changed, events, track
from tests.runner.files import ROADS, car, scenario, speed_action

SCENARIO = Path(__file__).parent / "carla" / "dialect.xosc"
PLACE = '<WorldPosition x="150" y="1.75" h="0"/>'
HERO = '<LanePosition roadId="1" laneId="-1" s="100"/>'
AGAINST = '<LanePosition roadId="1" laneId="1" s="200"/>'
STANDARD = ('value="CARLA:Conformance"', 'value="Conformance"')


def run(scenario: Path = SCENARIO, **options: object) -> runner.RunResult:
    """Run without a system under test, at 0.05 s."""
    return runner.run(
        scenario,
        **{"sut": None, "timestep": 0.05, "max_time": 20.0, "world": "kinematic", **options},
    )


def of_the_run(result: runner.RunResult) -> tuple[str, ...]:
    """The remarks that are not on a place in the file."""
    return tuple(remark for remark in result.remarks if ".xosc:" not in remark)


def start(result: runner.RunResult, entity: str = "adversary") -> tuple[float, float, float]:
    """Where an entity starts: x, y (m), heading (rad)."""
    columns = track(result, entity)
    x, y, h = (float(columns[name][0]) for name in ("x", "y", "h"))
    return round(x, 6), round(y, 6), round(math.remainder(h, math.tau), 6)


def test_axes_that_put_all_positions_off_the_roads_are_told_and_inconclusive(
    tmp_path: Path,
) -> None:
    plain = scenario(
        tmp_path,
        entities=[car("Ego")],
        init='<Private entityRef="Ego"><PrivateAction><TeleportAction><Position>'
        '<WorldPosition x="150" y="8.75" h="0"/></Position></TeleportAction></PrivateAction>'
        f"{speed_action(10)}</Private>",
    )
    text = plain.read_text().replace('description="test"', 'description="CARLA:test"')
    for y, misplaced in (("8.75", False), ("-5.25", False), ("300", False)):
        plain.write_text(text.replace("8.75", y))
        assert any("off the roads" in each for each in run(plain).remarks) is misplaced
    one_sided = ROADS.parents[2] / "xodr" / "library" / "highway_straight.xodr"
    plain.write_text(text.replace("8.75", "-1.75").replace("straight.xodr", str(one_sided)))
    result = run(plain)
    assert any("so all WorldPositions are off the roads" in each for each in result.remarks)
    assert "misplaced" in [cause.name for cause in result.verdict.causes]


@pytest.mark.parametrize(
    ("position", "place"),
    [
        ('<WorldPosition x="150" y="1.75" h="0"/>', (150.0, -1.75, 0.0)),
        ('<WorldPosition x="150" y="-1.75" h="-3"/>', (150.0, 1.75, 3.0)),
        ('<RelativeWorldPosition entityRef="hero" dx="30" dy="3.5"/>', (130.0, -5.25, 0.0)),
        ('<RelativeObjectPosition entityRef="hero" dx="30" dy="3.5"/>', (130.0, -5.25, 0.0)),
        (
            (
                '<RelativeObjectPosition entityRef="hero" dx="30" dy="0"><Orientation '
                'h="0.5"/></RelativeObjectPosition>'
            ),
            (130.0, -1.75, -0.5),
        ),
        ('<RoadPosition roadId="1" s="130" t="1.75"/>', (130.0, -1.75, 0.0)),
        ('<LanePosition roadId="1" laneId="-1" s="130" offset="1"/>', (130.0, -2.75, 0.0)),
        ('<LanePosition roadId="1" laneId="1" s="130" offset="1"/>', (130.0, 2.75, math.pi)),
        (
            (
                '<LanePosition roadId="1" laneId="1" s="130"><Orientation type="absolute" '
                'h="0.5"/></LanePosition>'
            ),
            (130.0, 1.75, math.pi - 0.5),
        ),
        (
            '<RelativeLanePosition entityRef="hero" dLane="-1" ds="20" offset="0.5"/>',
            (120.0, -5.75, 0.0),
        ),
        ('<RelativeRoadPosition entityRef="hero" ds="20" dt="-1"/>', (120.0, -0.75, 0.0)),
    ],
)
def test_positions_in_carla_s_axes(
    tmp_path: Path, position: str, place: tuple[float, float, float]
) -> None:
    result = run(changed(SCENARIO, tmp_path, (PLACE, position)), max_time=0.1)
    assert start(result) == pytest.approx(place, abs=1e-5)


@pytest.mark.parametrize(
    ("position", "place"),
    [
        (
            '<RelativeLanePosition entityRef="hero" dLane="1" ds="20" offset="0.5"/>',
            (180.0, 5.75, math.pi),
        ),
        ('<RelativeRoadPosition entityRef="hero" ds="20" dt="-1"/>', (220.0, 0.75, math.pi)),
    ],
)
def test_positions_relative_to_an_ego_against_s_go_to_its_right_and_face_as_it_does(
    tmp_path: Path, position: str, place: tuple[float, float, float]
) -> None:
    result = run(changed(SCENARIO, tmp_path, (PLACE, position), (HERO, AGAINST)), max_time=0.1)
    x, y, h = start(result)
    assert (x, y) == pytest.approx(place[:2], abs=1e-5) and math.cos(h - place[2]) == pytest.approx(
        1.0
    )


def test_without_the_flag_positions_are_the_standard_s(tmp_path: Path) -> None:
    assert start(run(changed(SCENARIO, tmp_path, STANDARD), max_time=0.1)) == (150.0, 1.75, 0.0)


def test_the_flag_is_a_remark() -> None:
    said = run(max_time=0.1).remarks
    assert "written for CARLA's scenario_runner" in said[0] and "dialect.xosc:3" in said[0]
    assert "the description begins with 'CARLA:'" in said[1] and len(said) == 2


@pytest.mark.parametrize(("lane", "left"), [(HERO, 1), (AGAINST, -1)])
@pytest.mark.parametrize(
    "target",
    [
        '<AbsoluteTargetLaneOffset value="1"/>',
        '<RelativeTargetLaneOffset entityRef="adversary" value="1"/>',
    ],
)
def test_lane_offsets_are_to_the_right(tmp_path: Path, target: str, lane: str, left: int) -> None:
    action = f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="true">
        <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget>{target}</LaneOffsetTarget>
        </LaneOffsetAction></LateralAction></PrivateAction></Private><Private entityRef="adversary">"""
    scenario = changed(
        SCENARIO,
        tmp_path,
        ('</Private>\n        <Private entityRef="adversary">', action),
        (HERO, lane),
    )
    result = run(scenario, max_time=0.5)
    assert at(track(result, "hero"), 0.5, "lane_offset") == pytest.approx(-left)


@pytest.mark.parametrize(
    ("flag", "distance", "offset"), [(True, "-2", 2.0), (True, "2", -2.0), (False, "-2", 2.0)]
)
def test_the_sign_of_a_lateral_distance_is_a_side(
    tmp_path: Path, flag: bool, distance: str, offset: float
) -> None:
    action = f"""<PrivateAction><LateralAction><LateralDistanceAction entityRef="hero" distance="{distance}" freespace="false"
        continuous="true"/></LateralAction></PrivateAction></Private></Actions>"""
    scenario = changed(
        SCENARIO, tmp_path, ("</Private>\n      </Actions>", action), *([] if flag else [STANDARD])
    )
    result = run(scenario, max_time=0.5)
    sideways = float(track(result, "adversary")["y"][-1] - track(result, "hero")["y"][-1])
    assert sideways == pytest.approx(offset, abs=1e-6)
    assert any("is negative: 2 m to the left" in remark for remark in result.remarks) is (
        distance == "-2"
    )


def starts_of(result: runner.RunResult) -> dict[str, float]:
    """When each event starts, s."""
    return {
        entry.subject.split("::")[-1]: entry.time for entry in events(result, "startTransition")
    }


def test_conditions_stay_true_and_count_from_when_they_are_waited_for() -> None:
    result = run()
    started = starts_of(result)
    assert started["Act"] == pytest.approx(1.0)
    assert started["Drive"] == pytest.approx(3.0, abs=0.06), (
        "20 m after the act has begun, and the time was 0 then"
    )
    drive = next(
        entry
        for entry in events(result, "startTransition", "Drive")
        if "Maneuver::Drive" in entry.subject
    )
    assert "AtTheBeginning: simulation time = 0 s = 0 s at 1.00 s" in drive.text


def test_speed_steps_last_for_their_time_or_distance_and_the_run_ends_with_its_stories() -> None:
    result = run()
    started = starts_of(result)
    assert started["Wait"] - started["Drive"] == pytest.approx(10.0 / 5.0, abs=0.11)
    assert (
        result.end_time - started["Wait"] == pytest.approx(3.0, abs=0.06)
        and result.status == "completed"
    )
    assert at(track(result, "adversary"), started["Drive"] + 1.0, "speed") == pytest.approx(5.0)


def test_the_standard_s_triggers_without_the_flag(tmp_path: Path) -> None:
    result = run(changed(SCENARIO, tmp_path, STANDARD))
    assert "Drive" not in starts_of(result) and result.status == "timeout" and not result.remarks


def test_an_act_stops_when_one_condition_holds(tmp_path: Path) -> None:
    trigger = """<StopTrigger><ConditionGroup><Condition name="Soon" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="2" rule="greaterThan"/></ByValueCondition></Condition>
        <Condition name="Never" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="1000" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
        </Act>"""
    result = run(changed(SCENARIO, tmp_path, ("<StopTrigger/>\n      </Act>", trigger)))
    assert result.end_time == pytest.approx(3.05, abs=0.06), "2 s after the act has begun"


@pytest.mark.parametrize(("flag", "lane"), [(True, -1), (False, -2)])
def test_lane_changes_count_from_the_actor_s_own_lane(
    tmp_path: Path, flag: bool, lane: int
) -> None:
    there = '<LanePosition roadId="1" laneId="-2" s="150"/>'
    action = """<PrivateAction><LateralAction><LaneChangeAction>
        <LaneChangeActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/><LaneChangeTarget>
        <RelativeTargetLane entityRef="hero" value="{value}"/></LaneChangeTarget></LaneChangeAction></LateralAction>
        </PrivateAction></Private></Actions>"""
    change = ("</Private>\n      </Actions>", action.format(value=1 if flag else -1))
    result = run(
        changed(SCENARIO, tmp_path, (PLACE, there), change, *([] if flag else [STANDARD])),
        max_time=0.5,
    )
    assert int(track(result, "adversary")["lane_id"][-1]) == lane


@pytest.mark.parametrize(
    "empty", ['<Action name="Wait"/>', '<Action name="Wait"><PrivateAction/></Action>']
)
def test_an_empty_action_does_nothing_and_is_a_remark(tmp_path: Path, empty: str) -> None:
    text = SCENARIO.read_text()
    begin = text.index('<Action name="Wait">')
    action = text[begin : text.index("</Action>", begin) + len("</Action>")]
    scenario = changed(SCENARIO, tmp_path, (action, empty))
    result = run(scenario)
    assert (
        result.end_time == pytest.approx(starts_of(result)["Wait"])
        and "it does nothing" in result.remarks[-1]
    )
    with pytest.raises(InvalidFile, match="an action is expected inside"):
        run(changed(SCENARIO, tmp_path, (action, empty), STANDARD), strict=True)


def test_a_compiled_scenario_gives_the_same_run_twice() -> None:
    first, second = run(), run()
    assert first.events == second.events and first.trajectories == second.trajectories


def module(name: str, entity: str = "adversary", more: str = "") -> tuple[str, str]:
    """A change that assigns an entity a controller by its module."""
    assign = f"""<PrivateAction><ControllerAction><AssignControllerAction><Controller name="Agent"><Properties>
        <Property name="module" value="{name}"/>{more}</Properties></Controller></AssignControllerAction>
        </ControllerAction></PrivateAction>"""
    return f'<Private entityRef="{entity}">', f'<Private entityRef="{entity}">{assign}'


@pytest.mark.parametrize(
    ("change", "remark"),
    [
        (module("npc_vehicle_control"), ""),
        (module("simple_vehicle_control"), ""),
        (module("pedestrian_control"), ""),
        (
            module(
                "simple_vehicle_control", more='<Property name="consider_obstacles" value="false"/>'
            ),
            "",
        ),
        (
            module(
                "simple_vehicle_control", more='<Property name="consider_obstacles" value="True"/>'
            ),
            (
                "adversary: consider_obstacles of simple_vehicle_control is not executed: it "
                "moves as scripted"
            ),
        ),
        (
            module("vehicle_longitudinal_control"),
            "adversary: vehicle_longitudinal_control would not steer; it follows its lane",
        ),
        (
            module("./mine/My_Agent.py"),
            "adversary: the controller ./mine/My_Agent.py is not executed: it moves as scripted",
        ),
        (
            module("external_control", "hero"),
            (
                "hero is to be driven from outside (external_control), and no system under test "
                "does (--sut): it moves as scripted"
            ),
        ),
    ],
)
def test_controllers_by_module_are_scripted_motion_or_a_remark(
    tmp_path: Path, change: tuple[str, str], remark: str
) -> None:
    result = run(changed(SCENARIO, tmp_path, change), max_time=0.2)
    assert of_the_run(result) == ((remark,) if remark else ())


class Recorder:
    """A system under test that writes down what it is asked for, and intervenes in nothing."""

    def __init__(self) -> None:
        self.asked: list[float] = []

    def reset(self, *_: object) -> None:
        """Begin."""

    def control(self, observation: Observation, dt: float) -> Control:
        """Write down the target speed."""
        self.asked.append(observation.target_speed)
        return Control()


def test_an_ego_that_is_driven_from_outside_is_asked_to_drive(tmp_path: Path) -> None:
    speed = '<AbsoluteTargetSpeed value="10"/>'
    text = SCENARIO.read_text()
    begin = text.rindex("<PrivateAction>", 0, text.index(speed))
    action = text[begin : text.index("</PrivateAction>", begin) + len("</PrivateAction>")]
    system = Recorder()
    scenario = changed(SCENARIO, tmp_path, (action, ""), module("external_control", "hero"))
    result = run(scenario, sut=system, max_time=4.0)
    assert set(system.asked) == {20.0 / 3.6}
    speeds = track(result, "hero")["speed"]
    assert (
        speeds[0] == 0.0
        and max(abs(speeds[1:] - speeds[:-1])) <= 3.5 * 0.05 + 1e-9
        and speeds[-1] == pytest.approx(20.0 / 3.6)
    )
    assert result.remarks[-1].startswith(
        "hero is driven from outside (external_control), and Init gives it no speed"
    )
    assert not events(result, "interventionEnd")


def test_an_ego_with_a_scripted_speed_keeps_it(tmp_path: Path) -> None:
    system = Recorder()
    result = run(
        changed(SCENARIO, tmp_path, module("external_control", "hero")), sut=system, max_time=1.0
    )
    assert set(system.asked) == {10.0} and not of_the_run(result)


def test_the_property_ego_vehicle_names_the_ego(tmp_path: Path) -> None:
    assert (
        run(changed(SCENARIO, tmp_path, ('"hero"', '"vehicle1"')), max_time=0.1).ego == "vehicle1"
    )
