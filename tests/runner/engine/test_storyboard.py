"""States and transitions of storyboard elements, with actions and triggers that play a script."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from runner.engine.compile.element import AWAKE, Dormancy, GlobalAction
from runner.engine.compile.protocols import ElementState
from runner.engine.storyboard.story_elements import ActionElement
from runner.engine.storyboard.storyboard import (
    Act,
    Event,
    Maneuver,
    ManeuverGroup,
    Story,
    Storyboard,
)


class Script:
    """A trigger that fires at given steps."""

    triggering = ()
    fired = ()
    reason = "scripted"

    def __init__(self, *steps: int) -> None:
        self.steps = set(steps)
        self.resets = 0

    def fires(self, sim: Board) -> bool:
        return sim.step in self.steps

    def dormant_until(self, sim: Board) -> Dormancy:
        return AWAKE

    def rearm(self) -> None:
        self.resets += 1


class Lasting(GlobalAction):
    """An action that takes a number of steps; 0 is complete at once, None never ends."""

    def __init__(self, steps: int | None) -> None:
        self.steps = steps
        self.stopped = 0

    def start(self, sim: Any) -> Any:
        if self.steps == 0:
            return None
        return _Countdown(self)


class _Countdown:
    def __init__(self, action: Lasting) -> None:
        self.left, self.action = action.steps, action

    def step(self, dt: float) -> bool:
        if self.left is None:
            return False
        self.left -= 1
        return self.left == 0

    def stop(self) -> None:
        self.action.stopped += 1


class Board:
    """The part of a simulation that storyboard elements talk to, with one story,
    act, group and maneuver.
    """

    def __init__(self, group_maximum: int = 1) -> None:
        self.step = 0
        self.processes: list[Any] = []
        self.ended: list[Any] = []
        self.log: list[tuple[int, str, str]] = []
        self.rearmed: list[str] = []
        self.board = Storyboard()
        self.story = Story("S", None)
        self.board.stories.append(self.story)
        self.act = Act("A", self.story)
        self.group = ManeuverGroup("G", self.act, group_maximum, [], False)
        self.maneuver = Maneuver("M", self.group)
        self._next: list[Any] = []
        self.changes = 0

        self.dt = 0.1

    @property
    def time(self) -> float:
        return 0.1 * self.step

    def leave_off(self) -> None:
        self.log.append((self.step, "", "leaves off"))

    @property
    def step_index(self) -> int:
        return self.step

    def event(
        self,
        name: str,
        trigger: Any,
        steps: Iterable[int | None],
        priority: str = "parallel",
        maximum: int = 1,
    ) -> Event:
        event = Event(name, self.maneuver, priority, maximum)
        event.trigger = trigger
        for index, count in enumerate(steps):
            ActionElement(f"{name}{index}", event, [Lasting(count)])
        return event

    def element_changed(self, element: Any, transition: Any, reason: str) -> None:
        self.log.append((self.step, element.name, str(transition)))
        self.board.changed(element)

    def element_rearmed(self, element: Any) -> None:
        self.rearmed.append(element.name)
        self.board.changed(element)

    def call_next_step(self, call: Any) -> None:
        self._next.append(call)

    def run(self, steps: int) -> None:
        """Begin at step 0 and play that many steps."""
        self.board.begin(self)  # type: ignore[arg-type]
        for self.step in range(steps):
            calls, self._next = self._next, []
            for call in calls:
                call(self)
            if self.board.evaluate(self):  # type: ignore[arg-type]
                return
            for process in tuple(self.processes):
                if process.running.step(0.1):
                    process.element.finished(self, process)

    def of(self, name: str) -> list[tuple[int, str]]:
        return [(step, transition) for step, element, transition in self.log if element == name]


def test_everything_completes_upwards_when_the_last_action_ends() -> None:
    board = Board()
    board.event("E", Script(2), [1, 3])
    board.run(10)
    assert board.of("E0") == [(2, "startTransition"), (2, "endTransition")]
    assert board.of("E1") == [(2, "startTransition"), (4, "endTransition")]
    for name in ("E", "M", "G", "A", "S"):
        assert board.of(name)[-1] == (4, "endTransition")
    assert board.story.state is ElementState.COMPLETE


def test_an_event_without_trigger_starts_with_its_act() -> None:
    board = Board()
    board.act.trigger = Script(3)  # type: ignore[assignment]
    board.event("E", None, [1])
    board.run(6)
    assert board.of("A")[0] == board.of("E")[0] == (3, "startTransition")


def test_an_event_returns_to_standby_until_its_executions_are_used_up() -> None:
    board = Board()
    event = board.event("E", Script(1, 2, 3, 4, 5), [1, 0], maximum=2)
    board.run(8)
    assert board.of("E") == [
        (1, "startTransition"),
        (1, "endTransition"),
        (2, "startTransition"),
        (2, "endTransition"),
    ]
    assert event.state is ElementState.COMPLETE
    assert event.trigger.resets == 2  # armed, and after the first execution


def test_override_stops_the_running_events_of_the_same_maneuver() -> None:
    board = Board()
    first = board.event("E", Script(0), [None], maximum=3)
    board.event("F", Script(2), [1], priority="override")
    board.run(5)
    assert board.of("E") == [(0, "startTransition"), (2, "stopTransition")]
    assert board.of("E0")[-1] == (2, "stopTransition")
    assert first.state is ElementState.COMPLETE
    assert board.story.state is ElementState.COMPLETE
    assert not board.processes


def test_override_leaves_events_of_other_maneuvers_alone() -> None:
    board = Board()
    other = Maneuver("N", board.group)
    board.event("E", Script(0), [None])
    event = Event("F", other, "override", 1)
    event.trigger = Script(1)  # type: ignore[assignment]
    ActionElement("F0", event, [Lasting(1)])
    board.run(4)
    assert board.of("E") == [(0, "startTransition")]


def test_skip_uses_up_an_execution_without_starting() -> None:
    board = Board()
    board.event("E", Script(0), [4])
    skipped = board.event("F", Script(1, 2, 6), [1], priority="skip", maximum=3)
    board.run(8)
    assert board.of("F") == [
        (1, "skipTransition"),
        (2, "skipTransition"),
        (6, "startTransition"),
        (6, "endTransition"),
    ]
    assert skipped.state is ElementState.COMPLETE


def test_the_last_execution_skipped_completes_the_event() -> None:
    board = Board()
    board.event("E", Script(0), [4])
    skipped = board.event("F", Script(1), [1], priority="skip")
    board.run(6)
    assert board.of("F") == [(1, "skipTransition")]
    assert skipped.state is ElementState.COMPLETE
    assert board.story.state is ElementState.COMPLETE


def test_parallel_events_run_side_by_side() -> None:
    board = Board()
    board.event("E", Script(0), [5])
    board.event("F", Script(1), [1])
    board.run(8)
    assert board.of("E")[-1] == (4, "endTransition")
    assert board.of("F") == [(1, "startTransition"), (1, "endTransition")]


def test_a_maneuver_group_starts_anew_in_the_step_after_it_ended() -> None:
    board = Board(group_maximum=3)
    event = board.event("E", None, [2])
    board.run(12)
    starts = [step for step, transition in board.of("G") if transition == "startTransition"]
    assert starts == [0, 2, 4]
    assert event.executions == 1
    assert board.of("A")[-1] == (5, "endTransition")


def test_the_acts_stop_trigger_stops_everything_inside() -> None:
    board = Board()
    board.act.stop_trigger = Script(3)  # type: ignore[assignment]
    board.event("E", Script(0), [None])
    board.event("F", Script(9), [1])
    board.run(6)
    for name in ("E0", "E", "F", "M", "G", "A"):
        assert board.of(name)[-1] == (3, "stopTransition")
    assert board.of("S")[-1] == (3, "endTransition")
    assert not board.processes


def test_the_storyboards_stop_trigger_ends_the_run_and_stops_all() -> None:
    board = Board()
    board.board.stop_trigger = Script(2)  # type: ignore[assignment]
    board.event("E", Script(0), [None])
    board.run(9)
    assert board.step == 2
    assert board.of("S")[-1] == (2, "stopTransition")


@pytest.mark.parametrize("steps", [[], [0], [0, 0]])
def test_an_event_without_lasting_actions_completes_at_once(steps: list[int]) -> None:
    board = Board()
    board.event("E", Script(1), steps)
    board.run(3)
    assert board.of("E") == [(1, "startTransition"), (1, "endTransition")]


def test_an_ended_action_gives_back_what_it_holds_once() -> None:
    board = Board()
    event = board.event("E", Script(0), [2])
    board.run(5)
    action = event.children[0].actions[0]  # type: ignore[attr-defined]
    assert action.stopped == 1
