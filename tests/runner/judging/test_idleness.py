"""Remarks on triggers that wait for a time that has passed."""

from __future__ import annotations

from pathlib import Path

import runner
from tests.runner.files import at_time, car, place, scenario, speed_action, story

RISES = 'conditionEdge="rising"'


def play(
    folder: Path, *times: float, stop: float = 1.0, changes: dict[str, str] | None = None
) -> tuple[str, ...]:
    """The remarks on a run with an event at each of these times (s), and with
    texts of its file replaced.
    """
    stories = story("Ego", [(time, speed_action(5)) for time in times])
    path = scenario(
        folder, entities=[car("Ego")], init=place("Ego", 100, 10), stories=stories, stop=stop
    )
    text = path.read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text, encoding="utf-8")
    return runner.run(path, world="kinematic", sut="none").remarks


def test_a_run_with_an_event_has_no_remark(tmp_path: Path) -> None:
    assert play(tmp_path, 0.5, 9.0) == ()


def test_a_rise_before_the_trigger_waits_is_a_remark(tmp_path: Path) -> None:
    early = at_time(0.2, "early").replace('conditionEdge="none"', RISES)
    remarks = play(tmp_path, 0.3, 0.2, changes={at_time(0.2): early, at_time(0): at_time(0.4)})
    reason = (
        "early: simulation time = 1 s ≥ 0.2 s (rising) was true too early, and did not rise again"
    )
    option = "the first check is no edge, conditionEdge='none' needs none"
    assert remarks == (f"event 'event1' does not start: {reason}: {option}",)


def test_a_condition_that_is_true_from_its_first_check_on_is_a_remark(tmp_path: Path) -> None:
    fast = (
        f'<ConditionGroup><Condition name="fast" delay="0" {RISES}><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>'
        '</TriggeringEntities><EntityCondition><SpeedCondition value="8" rule="greaterThan"/>'
        "</EntityCondition></ByEntityCondition></Condition></ConditionGroup>"
    )
    (remark,) = play(tmp_path, 0.3, 0.5, changes={at_time(0.5): fast, 'value="5"': 'value="9"'})
    assert remark.startswith("event 'event1' does not start: fast:")
    assert "conditionEdge='none' needs none" in remark
    # a condition that has been false since may yet rise
    falling = play(tmp_path, 0.3, 0.5, changes={at_time(0.5): fast})
    assert not any("does not start" in each for each in falling)


def test_events_of_the_same_name_are_told_apart(tmp_path: Path) -> None:
    early = at_time(0.2, "early").replace('conditionEdge="none"', RISES)
    _, remark = play(
        tmp_path,
        0.3,
        0.2,
        changes={at_time(0.2): early, at_time(0): at_time(0.25), '"event1"': '"event0"'},
    )
    assert remark.startswith("event 'event0' does not start: early")


def test_an_act_that_waits_for_the_beginning_to_come_is_a_remark(tmp_path: Path) -> None:
    (first,) = play(
        tmp_path, 0.3, changes={at_time(0): at_time(0).replace('conditionEdge="none"', RISES)}
    )
    assert first.startswith(
        "act 'act' does not start: time: simulation time = 1 s ≥ 0 s (rising) was true too early"
    )


def test_a_delayed_rise_may_still_come(tmp_path: Path) -> None:
    late = at_time(0.5).replace('delay="0" conditionEdge="none"', f'delay="3" {RISES}')
    assert play(tmp_path, 0.2, 0.5, changes={at_time(0.5): late}) == ()
