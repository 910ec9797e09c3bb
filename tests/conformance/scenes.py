"""Small scenes of two cars, Ego and Lead, for tests of facts: positions,
actions, conditions, and how they are played.
"""

from __future__ import annotations

from pathlib import Path

import runner
from tests.conformance.support import track
from tests.runner.files import at_time, car, scenario, speed_action, story

TELEPORT = "<PrivateAction><TeleportAction><Position>{}</Position></TeleportAction></PrivateAction>"
HELD_OFFSET = (
    '<PrivateAction><LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics'
    ' maxLateralAcc="2" dynamicsShape="cubic"/><LaneOffsetTarget><AbsoluteTargetLaneOffset '
    'value="{}"/>'
    "</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
)
CHANGE = (
    "<PrivateAction><LateralAction><LaneChangeAction{}><LaneChangeActionDynamics "
    'dynamicsShape="cubic"'
    ' value="2" '
    'dynamicsDimension="time"/><LaneChangeTarget>{}</LaneChangeTarget></LaneChangeAction>'
    "</LateralAction></PrivateAction>"
)
LATE = 8.0
"""Time (s) of the teleport, when all other actions have ended"""
NAMES = ("Ego", "Lead")


def lane_position(lane: int, s: float, offset: float = 0.0, road: str = "1", more: str = "") -> str:
    return (
        f'<LanePosition roadId="{road}" laneId="{lane}" s="{s}" offset="{offset}">{more}'
        "</LanePosition>"
    )


def start(entity: str, position: str, speed: float) -> str:
    return (
        f'<Private entityRef="{entity}">{TELEPORT.format(position)}{speed_action(speed)}</Private>'
    )


def play(folder: Path, init: str, stories: str = "", **options: object) -> runner.RunResult:
    """Play two cars for 10 s in steps of 0.05 s."""
    road = str(options.pop("road", "straight"))
    entities = [car(name) for name in NAMES]
    path = scenario(folder, entities=entities, init=init, stories=stories, stop=10.0, road=road)
    return runner.run(path, world="kinematic", sut=None, timestep=0.05, **options)


def placed_beside(
    folder: Path, position: str, action: str = "", lead: str = "", **options: object
) -> tuple[dict, dict]:
    """Let Lead do an action at 1 s, and put the standing Ego somewhere at 8 s;
    the tracks of both.
    """
    init = start("Ego", lane_position(1, 500), 0) + start(
        "Lead", lead or lane_position(-1, 100), 10
    )
    stories = story("Lead", [(1.0, action)]) if action else ""
    stories += story("Ego", [(LATE, TELEPORT.format(position))]).replace('"story"', '"other"')
    result = play(folder, init, stories, **options)
    return track(result, "Ego"), track(result, "Lead")


def other(text: str, name: str = "other") -> str:
    return text.replace('"story"', f'"{name}"')


def condition(name: str, body: str) -> str:
    return (
        f'<ConditionGroup><Condition name="{name}" delay="0" '
        f'conditionEdge="none">{body}</Condition></ConditionGroup>'
    )


def by_entity(body: str) -> str:
    return condition(
        "c",
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/>'
        f"</TriggeringEntities><EntityCondition>{body}</EntityCondition></ByEntityCondition>",
    )


def triggered(
    folder: Path, body: str, init: str, more: str = "", **options: object
) -> float | None:
    """The time (s) at which a condition of Ego is first true."""
    text = story("Ego", [(99.0, speed_action(0))]).replace(at_time(99.0), by_entity(body))
    result = play(folder, init, text + more, **options)
    started = [
        e.time
        for e in result.events
        if e.kind == "startTransition"
        and e.subject.startswith("story::")
        and e.subject.endswith("event0")
    ]
    return started[0] if started else None
