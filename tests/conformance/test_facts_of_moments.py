"""Small inputs with one answer by the standard: when conditions hold, what
values become, which entities are meant.

Each case names the class of the OpenSCENARIO XML reference that it tests.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import runner
from tests.conformance.scenes import (
    condition,
    lane_position,
    other,
    play,
    start,
    triggered,
)
from tests.conformance.support import at, events, track
from tests.runner.files import at_time, car, place, scenario, speed_action, story

BRAKE = 'dynamicsShape="linear" dynamicsDimension="rate" value="2"'


def begun(result: runner.RunResult, story_name: str = "story") -> list[float]:
    """Times (s) at which the event of a story starts."""
    return [
        e.time
        for e in result.events
        if e.kind == "startTransition"
        and e.subject.startswith(f"{story_name}::")
        and e.subject.endswith("event0")
    ]


def when(folder: Path, text: str, init: str = "", more: str = "", **options: object) -> list[float]:
    """Times (s) at which an event starts whose trigger is a ConditionGroup."""
    init = init or place("Ego", 100, 10) + place("Lead", 400, 0)
    waiting = story("Ego", [(99.0, speed_action(10))]).replace(at_time(99.0), text)
    return begun(play(folder, init, waiting + more, **options))


TO_A_PLACE = (
    '<DistanceCondition freespace="{}" coordinateSystem="{}" relativeDistanceType="{}" value="{}" '
    'rule="lessOrEqual">'
    "<Position>{}</Position></DistanceCondition>"
)
DISTANCES = {
    # Ego drives at 10 m/s from x = 100 m on lane -1; its box reaches from 1 m behind to 4 m ahead
    "longitudinal": ("false", "lane", "longitudinal", 50, lane_position(-1, 200), 5.0),
    "longitudinal, other lane": ("false", "road", "longitudinal", 50, lane_position(-2, 200), 5.0),
    "freespace": ("true", "lane", "longitudinal", 50, lane_position(-1, 200), 4.6),
    "freespace, entity": ("true", "entity", "longitudinal", 50, lane_position(-1, 200), 4.6),
    "entity": ("false", "entity", "longitudinal", 50, lane_position(-2, 200), 5.0),
    "euclidean": ("false", "entity", "euclidianDistance", 12.5, lane_position(2, 200), 8.964),
    "lateral, never": ("false", "lane", "lateral", 3.4, lane_position(-2, 200), None),
    "lateral": ("false", "lane", "lateral", 3.6, lane_position(-2, 200), 0.0),
    "lateral, road": (
        "false",
        "road",
        "lateral",
        1.8,
        '<RoadPosition roadId="1" s="200" t="0"/>',
        0.0,
    ),
    "lateral, entity": (
        "false",
        "entity",
        "lateral",
        3.6,
        '<WorldPosition x="200" y="-5.25"/>',
        0.0,
    ),
}


@pytest.mark.parametrize("case", DISTANCES)
def test_distances_to_a_place(case: str, tmp_path: Path) -> None:
    """DistanceCondition: coordinateSystem, relativeDistanceType, freespace (of
    the entity's box).
    """
    *values, time = DISTANCES[case]
    init = place("Ego", 100, 10) + place("Lead", 400, 0)
    found = triggered(tmp_path, TO_A_PLACE.format(*values), init)
    assert found == (None if time is None else pytest.approx(time, abs=0.051))


MOTION = {
    # Ego brakes from 10 m/s with 2 m/s² from 1 s on
    "speed, longitudinal": (
        '<SpeedCondition value="6" rule="lessThan" direction="longitudinal"/>',
        3.0,
    ),
    "speed, lateral": (
        '<SpeedCondition value="0.1" rule="greaterThan" direction="lateral"/>',
        None,
    ),
    "acceleration, total": ('<AccelerationCondition value="1.9" rule="greaterThan"/>', 1.0),
    "acceleration, longitudinal": (
        '<AccelerationCondition value="-1" rule="lessThan" direction="longitudinal"/>',
        1.0,
    ),
    "relative speed": ('<RelativeSpeedCondition entityRef="Lead" value="2" rule="lessThan"/>', 5.0),
    "relative speed, longitudinal": (
        (
            '<RelativeSpeedCondition entityRef="Lead" value="2" rule="lessThan" '
            'direction="longitudinal"/>'
        ),
        5.0,
    ),
    "standing": ('<StandStillCondition duration="1.5"/>', 7.5),
    "angle, heading": (
        (
            '<AngleCondition angleType="heading" angle="0" angleTolerance="0.01" '
            'coordinateSystem="road"/>'
        ),
        0.0,
    ),
    "relative angle": (
        f'<RelativeAngleCondition entityRef="Lead" angleType="heading" angle="{math.pi}" '
        'angleTolerance="0.01"'
        ' coordinateSystem="entity"/>',
        0.0,
    ),
    "relative angle, other": (
        '<RelativeAngleCondition entityRef="Lead" angleType="heading" angle="0" '
        'angleTolerance="0.01"'
        ' coordinateSystem="entity"/>',
        None,
    ),
}


@pytest.mark.parametrize("case", MOTION)
def test_conditions_of_motion(case: str, tmp_path: Path) -> None:
    """SpeedCondition, AccelerationCondition, RelativeSpeedCondition,
    StandStillCondition, AngleCondition.
    """
    text, time = MOTION[case]
    init = start("Ego", lane_position(-1, 100), 10) + start("Lead", lane_position(1, 600), 0)
    braking = other(story("Ego", [(1.0, speed_action(0, BRAKE))]))
    found = triggered(tmp_path, text, init, braking)
    assert found == (None if time is None else pytest.approx(time, abs=0.11))


def clock(start_at: str, animation: str) -> str:
    return (
        f'<GlobalAction><EnvironmentAction><Environment name="e"><TimeOfDay animation="{animation}"'
        f' dateTime="{start_at}"/></Environment></EnvironmentAction></GlobalAction>'
    )


def time_of_day(date: str, rule: str = "greaterOrEqual") -> str:
    return condition(
        "clock",
        f'<ByValueCondition><TimeOfDayCondition dateTime="{date}" '
        f'rule="{rule}"/></ByValueCondition>',
    )


CLOCKS = {
    "runs": ("2026-06-01T23:59:58", "true", "2026-06-02T00:00:02", [4.0]),
    "stands": ("2026-06-01T23:59:58", "false", "2026-06-02T00:00:02", []),
    "zone": ("2026-06-01T12:00:00+02:00", "true", "2026-06-01T10:00:03Z", [3.0]),
    "another day": ("2026-06-02T08:00:00", "true", "2026-06-01T09:00:00", [0.0]),
}


@pytest.mark.parametrize("case", CLOCKS)
def test_the_time_of_day(case: str, tmp_path: Path) -> None:
    """TimeOfDay: animation lets it pass with the simulation time;
    TimeOfDayCondition compares date and time.
    """
    start_at, animation, date, expected = CLOCKS[case]
    init = clock(start_at, animation) + place("Ego", 100, 10) + place("Lead", 400, 0)
    assert when(tmp_path, time_of_day(date), init) == pytest.approx(expected, abs=0.051)


def selected(members: str, rule: str = "any", actors: str = "Both") -> str:
    return (
        f"<Entities>{car('Ego')}{car('Lead')}<EntitySelection "
        f'name="{actors}"><Members>{members}</Members>'
        "</EntitySelection></Entities>"
    )


BOTH = '<EntityRef entityRef="Ego"/><EntityRef entityRef="Lead"/>'
SPEED_OF = (
    '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{}">{}</TriggeringEntities>'
    '<EntityCondition><SpeedCondition value="{}" '
    'rule="greaterOrEqual"/></EntityCondition></ByEntityCondition>'
)


def with_selection(folder: Path, members: str, init: str, stories: str) -> runner.RunResult:
    selection = f'<EntitySelection name="Both"><Members>{members}</Members></EntitySelection>'
    path = scenario(
        folder, entities=[car("Ego"), car("Lead"), selection], init=init, stories=stories, stop=8.0
    )
    return runner.run(path, world="kinematic", sut=None, timestep=0.05)


@pytest.mark.parametrize("members", [BOTH, '<ByType objectType="vehicle"/>'])
def test_a_selection_acts_and_triggers_as_its_members(members: str, tmp_path: Path) -> None:
    """EntitySelection: as an actor all members act; as a triggering entity they
    are asked by the rule.
    """
    init = place("Ego", 100, 10) + place("Lead", 300, 10)
    faster = speed_action(12).replace("<PrivateAction>", "<PrivateAction>")
    stories = story("Both", [(2.0, faster)])
    asked = SPEED_OF.format("all", '<EntityRef entityRef="Both"/>', 12)
    stories += other(
        story("Ego", [(99.0, speed_action(12))]).replace(at_time(99.0), condition("c", asked))
    )
    result = with_selection(tmp_path, members, init, stories)
    for name in ("Ego", "Lead"):
        assert at(track(result, name), 3.0, "speed") == pytest.approx(12.0)
    assert begun(result, "other") == [pytest.approx(2.05, abs=0.051)]


@pytest.mark.parametrize(("rule", "time"), [("any", 2.0), ("all", 4.0)])
def test_triggering_entities_are_asked_by_their_rule(
    rule: str, time: float, tmp_path: Path
) -> None:
    """TriggeringEntitiesRule: any of them, or all at the same time."""
    moves = other(story("Ego", [(2.0, speed_action(12))]))
    moves += other(story("Lead", [(4.0, speed_action(12))]), "third")
    init = place("Ego", 100, 10) + place("Lead", 300, 10)
    found = when(tmp_path, condition("c", SPEED_OF.format(rule, BOTH, 12)), init, moves)
    assert found == [pytest.approx(time + 0.05, abs=0.051)]


EDGES = {
    # Ego's speed is above 11 m/s from 2 s to 4 s
    ("rising", 0.0): 2.0,
    ("falling", 0.0): 4.0,
    ("risingOrFalling", 0.0): 2.0,
    ("none", 0.0): 2.0,
    ("rising", 1.5): 3.5,
    ("falling", 1.5): 5.5,
    ("none", 1.5): 3.5,
}


@pytest.mark.parametrize("case", EDGES)
def test_edges_and_delays(case: tuple[str, float], tmp_path: Path) -> None:
    """Condition: the delay shows the value of so long ago, edge included."""
    edge, delay = case
    text = condition("c", SPEED_OF.format("any", '<EntityRef entityRef="Ego"/>', 11))
    text = text.replace('delay="0" conditionEdge="none"', f'delay="{delay}" conditionEdge="{edge}"')
    init = place("Ego", 100, 10) + place("Lead", 400, 0)
    moves = other(story("Ego", [(2.0, speed_action(12)), (4.0, speed_action(10))]))
    (found,) = when(tmp_path, text, init, moves)
    assert found == pytest.approx(EDGES[case] + 0.05, abs=0.051)


def variables(folder: Path, declared: str, stories: str) -> runner.RunResult:
    init = place("Ego", 100, 10) + place("Lead", 400, 0)
    path = scenario(folder, init=init, stories=stories, stop=6.0)
    text = path.read_text(encoding="utf-8").replace(
        "<CatalogLocations/>",
        f"<VariableDeclarations>{declared}</VariableDeclarations><CatalogLocations/>",
    )
    path.write_text(text, encoding="utf-8")
    return runner.run(path, world="kinematic", sut=None, timestep=0.05)


def variable(name: str, kind: str, value: str) -> str:
    return f'<VariableDeclaration name="{name}" variableType="{kind}" value="{value}"/>'


def change(name: str, inner: str) -> str:
    return (
        "<GlobalAction><VariableAction "
        f'variableRef="{name}">{inner}</VariableAction></GlobalAction>'
    )


def modify(rule: str) -> str:
    return f"<ModifyAction><Rule>{rule}</Rule></ModifyAction>"


VALUES = {
    "add": ("double", "1.5", modify('<AddValue value="2"/>'), ("equalTo", "3.5"), True),
    "multiply": (
        "double",
        "1.5",
        modify('<MultiplyByValue value="-2"/>'),
        ("lessThan", "-2.9"),
        True,
    ),
    "integer": ("int", "3", modify('<AddValue value="-5"/>'), ("equalTo", "-2"), True),
    "set": ("string", "a", '<SetAction value="b"/>', ("equalTo", "b"), True),
    "not equal": ("string", "a", '<SetAction value="b"/>', ("notEqualTo", "a"), True),
    "text is no number": ("string", "a", '<SetAction value="1.0"/>', ("equalTo", "1"), False),
    "boolean": ("boolean", "false", '<SetAction value="true"/>', ("equalTo", "true"), True),
    "boolean as digit": ("boolean", "false", '<SetAction value="1"/>', ("equalTo", "true"), True),
}


@pytest.mark.parametrize("case", VALUES)
def test_values_of_variables(case: str, tmp_path: Path) -> None:
    """VariableModifyAction, VariableSetAction, VariableCondition: values are of
    their declared type.
    """
    kind, value, action, (rule, compared), expected = VALUES[case]
    text = (
        f'<ByValueCondition><VariableCondition variableRef="V" rule="{rule}" value="{compared}"/>'
        "</ByValueCondition>"
    )
    stories = other(story("Ego", [(2.0, change("V", action))]))
    stories += story("Ego", [(99.0, speed_action(12))]).replace(
        at_time(99.0),
        condition("late", text).replace(
            "</ConditionGroup>", at_time(1.0).removeprefix("<ConditionGroup>")
        ),
    )
    found = begun(variables(tmp_path, variable("V", kind, value), stories))
    assert found == ([pytest.approx(2.05, abs=0.051)] if expected else [])


COUNTED = {
    # the speed passes 11 m/s at 1, 3 and 5 s
    (1, "rising"): 1,
    (2, "rising"): 2,
    (3, "rising"): 3,
}


@pytest.mark.parametrize("case", COUNTED)
def test_an_event_starts_as_often_as_it_may(case: tuple[int, str], tmp_path: Path) -> None:
    """Event: maximumExecutionCount."""
    count, edge = case
    text = condition("c", SPEED_OF.format("any", '<EntityRef entityRef="Lead"/>', 11)).replace(
        'conditionEdge="none"', f'conditionEdge="{edge}"'
    )
    moves = [(float(time), speed_action(12 if time % 2 else 8)) for time in range(1, 7)]
    init = place("Ego", 100, 10) + place("Lead", 400, 8)
    waiting = (
        story("Ego", [(99.0, speed_action(10))])
        .replace(at_time(99.0), text)
        .replace('priority="parallel"', f'priority="parallel" maximumExecutionCount="{count}"')
    )
    found = begun(play(tmp_path, init, waiting + other(story("Lead", moves))))
    assert found == pytest.approx([1.05, 3.05, 5.05][: COUNTED[case]], abs=0.051)


PRIORITIES = {"override": 20.0, "skip": 10.0, "parallel": 20.0}


@pytest.mark.parametrize("priority", PRIORITIES)
def test_priorities_of_events(priority: str, tmp_path: Path) -> None:
    """Event: override stops the running ones of the maneuver, skip does not
    start beside one, parallel does.
    """
    lights = (
        "<PrivateAction><LateralAction><LaneOffsetAction "
        'continuous="true"><LaneOffsetActionDynamics'
        ' maxLateralAcc="2" '
        'dynamicsShape="cubic"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/>'
        "</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
    )
    text = story("Ego", [(1.0, lights), (3.0, speed_action(20))])
    first, second = text.split('<Event name="event1"')
    text = first + '<Event name="event1"' + second.replace("parallel", priority, 1)
    init = place("Ego", 100, 10) + place("Lead", 900, 0)
    result = play(tmp_path, init, text)
    assert at(track(result, "Ego"), 4.0, "speed") == pytest.approx(PRIORITIES[priority])
    stopped = events(result, "stopTransition", "event0")
    assert [e.time < 9.0 for e in stopped] == [priority == "override"]
    assert len(events(result, "skipTransition", "event1")) == (priority == "skip")


def test_a_group_repeats_its_events(tmp_path: Path) -> None:
    """ManeuverGroup: maximumExecutionCount executes it anew when it has ended."""
    text = story("Ego", [(1.0, speed_action(12))]).replace(
        'maximumExecutionCount="1"', 'maximumExecutionCount="3"', 1
    )
    init = place("Ego", 100, 10) + place("Lead", 900, 0)
    assert len(begun(play(tmp_path, init, text))) == 3
