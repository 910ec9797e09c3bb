"""What exports take from roads and runs: targets before steady states, distances
of time 0, states when actions begin.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from tests.runner.exchange.test_exports_geometry import CLOSE, distance, exported
from tests.runner.files import at_time, car, place, scenario, speed_action, story
from tests.xosc.scenario_runner_grammar import stops_at
from xosc.exports.draft import Folder

STARTS = place("Ego", 20, 10) + place("Lead", 20, 8, lane=-2)
BRAKE = speed_action(4, 'dynamicsShape="linear" dynamicsDimension="rate" value="2"')


def on_lane(lane: int, s: float) -> str:
    """A LanePosition."""
    return f'<LanePosition roadId="1" laneId="{lane}" s="{s}"/>'


def synchronise(final: str, attributes: str = "") -> str:
    """A PrivateAction: Lead is to be at s=120 when Ego is at s=140."""
    return f"""<PrivateAction><SynchronizeAction masterEntityRef="Ego" {attributes}>
        <TargetPositionMaster>{on_lane(-1, 140)}</TargetPositionMaster><TargetPosition>{
        on_lane(-2, 120)
    }</TargetPosition>
        <FinalSpeed>{final}</FinalSpeed></SynchronizeAction></PrivateAction>"""


def gap(attributes: str) -> str:
    """A PrivateAction that sets a distance of 30 m ahead of Ego."""
    return f"""<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="30" freespace="false"
        displacement="leadingReferencedEntity" {attributes}/></LongitudinalAction></PrivateAction>"""


def change_lane(dimension: str) -> str:
    """A PrivateAction: to the lane beside Ego."""
    return f"""<PrivateAction><LateralAction><LaneChangeAction>
        <LaneChangeActionDynamics dynamicsShape="linear" {dimension}/><LaneChangeTarget>
        <RelativeTargetLane entityRef="Ego" value="0"/></LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"""


def refusal(path: Path, target: str, folder: Path) -> str:
    """Why an export refuses a scenario."""
    (done,) = export_documents([path], TARGETS[target], Folder(folder))
    assert done.exit_code == 4
    return str(done.remarks[0])


@pytest.mark.parametrize("target", ["1.0", "carla"])
@pytest.mark.parametrize(
    ("final", "attributes"),
    [
        ('<AbsoluteSpeed value="6"><TargetDistanceSteadyState distance="15"/></AbsoluteSpeed>', ""),
        ('<AbsoluteSpeed value="6"><TargetTimeSteadyState time="2"/></AbsoluteSpeed>', ""),
        (
            '<RelativeSpeedToMaster value="-3" '
            'speedTargetValueType="delta"><TargetDistanceSteadyState distance="14"/>'
            "</RelativeSpeedToMaster>",
            "",
        ),
        ('<AbsoluteSpeed value="6"/>', 'targetTolerance="2" targetToleranceMaster="3"'),
    ],
)
def test_steady_states_become_earlier_targets(
    target: str, final: str, attributes: str, tmp_path: Path
) -> None:
    path = scenario(
        tmp_path,
        init=STARTS,
        stories=story("Lead", [(1.0, synchronise(final, attributes))]),
        stop=12.0,
    )
    copy, remarks = exported(path, target, tmp_path / "out")
    assert any(
        "earlier, where the steady state or the tolerance begins" in remark for remark in remarks
    )
    root = xosc.load(copy).root
    assert not list(root.iter("TargetDistanceSteadyState", "TargetTimeSteadyState"))
    assert distance(path, copy) < 1e-3


def test_a_steady_state_longer_than_the_way_is_refused(tmp_path: Path) -> None:
    final = '<AbsoluteSpeed value="6"><TargetDistanceSteadyState distance="130"/></AbsoluteSpeed>'
    path = scenario(tmp_path, init=STARTS, stories=story("Lead", [(1.0, synchronise(final))]))
    assert "where its way has not begun yet" in refusal(path, "1.0", tmp_path / "out")


@pytest.mark.parametrize("target", ["1.0", "carla"])
def test_a_distance_that_a_story_sets_at_time_0_is_the_first_position(
    target: str, tmp_path: Path
) -> None:
    path = scenario(
        tmp_path, stories=story("Lead", [(0.0, gap('continuous="false"')), (2.0, BRAKE)])
    )
    copy, remarks = exported(path, target, tmp_path / "out")
    assert any("Init sets it instead" in remark for remark in remarks)
    assert (
        not list(xosc.load(copy).root.iter("LongitudinalDistanceAction"))
        and distance(path, copy) < CLOSE
    )


@pytest.mark.parametrize(
    "when, attributes", [(1.0, 'continuous="false"'), (0.0, 'continuous="true"')]
)
def test_a_distance_ahead_that_is_set_later_or_kept_is_refused_before_1_1(
    when: float, attributes: str, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=story("Lead", [(when, gap(attributes))]))
    assert "'displacement' attribute not allowed" in refusal(path, "1.0", tmp_path / "out")


def test_rates_and_lanes_for_carla_are_those_of_a_run_where_the_file_leaves_them_open(
    tmp_path: Path,
) -> None:
    faster = speed_action(20, 'dynamicsShape="linear" dynamicsDimension="rate" value="1"')
    events = [(0.5, faster), (3.0, BRAKE), (6.0, change_lane('dynamicsDimension="time" value="3"'))]
    path = scenario(tmp_path, init=STARTS, stories=story("Lead", events), stop=11.0)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert stops_at(xosc.load(copy).root) == []
    assert any("the time is written as" in remark for remark in remarks)


def test_a_lane_change_to_the_own_lane_is_left_out_for_carla(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        stories=story("Lead", [(1.0, change_lane('dynamicsDimension="distance" value="30"'))]),
    )
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any("its actor is on that lane" in remark for remark in remarks)
    assert not list(xosc.load(copy).root.iter("LaneChangeAction")) and distance(path, copy) < 1e-6


def after_the_first(path: Path, time: float, delay: float, kind: str = "Event") -> Path:
    """The scenario, in which what has begun at a time begins at the end of the
    first event (or what it is part of).
    """
    first = next(xosc.load(path).node.iter(kind)).get("name")
    ended = f"""<ConditionGroup><Condition name="after" delay="{delay}" conditionEdge="none"><ByValueCondition>
        <StoryboardElementStateCondition storyboardElementType="{kind.lower()}" storyboardElementRef="{first}"
        state="endTransition"/></ByValueCondition></Condition></ConditionGroup>"""
    path.write_text(path.read_text("utf-8").replace(at_time(time), ended), "utf-8")
    return path


@pytest.mark.parametrize("target", ["1.0", "carla"])
@pytest.mark.parametrize("delay", [0.0, 0.5])
def test_what_waits_for_a_steady_state_that_ends_earlier_waits_longer(
    target: str, delay: float, tmp_path: Path
) -> None:
    final = '<AbsoluteSpeed value="6"><TargetTimeSteadyState time="2"/></AbsoluteSpeed>'
    stories = story("Lead", [(1.0, synchronise(final)), (2.5, BRAKE)])
    path = after_the_first(scenario(tmp_path, init=STARTS, stories=stories, stop=17.0), 2.5, delay)
    copy, _ = exported(path, target, tmp_path / "out")
    assert distance(path, copy) < 0.01


def test_what_waits_for_more_than_a_steady_state_is_refused(tmp_path: Path) -> None:
    final = '<AbsoluteSpeed value="6"><TargetTimeSteadyState time="2"/></AbsoluteSpeed>'
    stories = story("Lead", [(1.0, synchronise(final)), (2.5, BRAKE)])
    path = after_the_first(scenario(tmp_path, init=STARTS, stories=stories), 2.5, 0.0, "Maneuver")
    assert "would end 2 s earlier, but for its other actions" in refusal(
        path, "1.0", tmp_path / "out"
    )


@pytest.mark.parametrize("target", ["1.0", "carla"])
def test_what_waits_for_another_element_of_the_same_name_does_not_wait_longer(
    target: str, tmp_path: Path
) -> None:
    final = '<AbsoluteSpeed value="6"><TargetTimeSteadyState time="2"/></AbsoluteSpeed>'
    other = story("Ego", [(0.5, speed_action(9)), (2.5, speed_action(8))]).replace(
        '"story"', '"other"'
    )
    path = scenario(
        tmp_path, init=STARTS, stories=other + story("Lead", [(1.0, synchronise(final))]), stop=6.0
    )
    copy, _ = exported(after_the_first(path, 2.5, 0.0), target, tmp_path / "out")
    assert {float(each.get("delay", "nan")) for each in xosc.load(copy).root.iter("Condition")} == {
        0.0
    }


@pytest.mark.parametrize("how", ['distance="20" coordinateSystem="road"', 'timeGap="1.5"'])
def test_distances_among_others_than_the_ego_are_ways_for_carla(how: str, tmp_path: Path) -> None:
    keep = f"""<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="NAME" freespace="false" continuous="true"
        displacement="trailingReferencedEntity" {how}/></LongitudinalAction></PrivateAction>"""
    init = place("Ego", 20, 10) + place("Lead", 60, 8, lane=-2) + place("Third", 30, 8, lane=-2)
    cars = [car(name) for name in ("Ego", "Lead", "Third")]
    kept = story("Third", [(1.0, keep.replace("NAME", "Lead")), (6.0, speed_action(7))]).replace(
        '"story"', '"kept"'
    )
    path = scenario(
        tmp_path, entities=cars, init=init, stories=story("Lead", [(3.0, BRAKE)]) + kept, stop=9.0
    )
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any(
        "LongitudinalDistanceAction: written as the way that Third takes" in remark
        for remark in remarks
    )
    # Third jumps to its distance: a trajectory does at the instant of its
    # start, the action a step later
    assert stops_at(xosc.load(copy).root) == [] and distance(path, copy, but=1.0) < CLOSE
    path.write_text(
        path.read_text("utf-8").replace('entityRef="Lead" freespace', 'entityRef="Ego" freespace'),
        "utf-8",
    )
    assert "LongitudinalDistanceAction" in refusal(path, "carla", tmp_path / "refused")


def test_delays_of_what_others_do_are_times_for_carla(tmp_path: Path) -> None:
    stories = story("Lead", [(1.0, BRAKE), (2.5, speed_action(9))])
    path = after_the_first(scenario(tmp_path, stories=stories, stop=10.0), 2.5, 1.5)
    copy, remarks = exported(path, "carla", tmp_path / "out")
    assert any("at which it holds in a run" in remark for remark in remarks)
    assert {float(each.get("delay", "nan")) for each in xosc.load(copy).root.iter("Condition")} == {
        0.0
    }
    assert distance(path, copy) < CLOSE


def test_delays_in_files_for_carla_stay_as_scenario_runner_reads_them(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        stories=story("Lead", [(1.0, BRAKE)]).replace(
            'name="time" delay="0"', 'name="time" delay="2"'
        ),
    )
    path.write_text(
        path.read_text("utf-8").replace('description="test"', 'description="CARLA:test"'), "utf-8"
    )
    copy, _ = exported(path, "carla", tmp_path / "out")
    starts = xosc.load(copy).root.iter("StartTrigger")
    assert {each.get("delay") for start in starts for each in start.iter("Condition")} == {"2"}
