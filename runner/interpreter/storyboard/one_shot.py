"""Conditions as CARLA's scenario_runner looks at them, for scenarios that are written for it (`xosc.dialects.carla`)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.interpreter.storyboard.triggers import TimedCondition

if TYPE_CHECKING:
    from runner.contracts.condition import Condition
    from runner.contracts.run import Instant


class OneShotCondition(TimedCondition):
    """A condition that stays true once it has been.

    It is looked at from `delay` seconds on after its trigger has begun to wait, without regard to its edge; times and distances
    count from there.
    """

    __slots__ = ("_begun", "_measuring", "_reason")

    def __init__(self, name: str, condition: Condition, edge: str, delay: float) -> None:
        super().__init__(name, condition, "none", delay)
        self.keeps_memory = True
        self.evaluate = self._lasting

    def rearm(self) -> None:
        """Forget that it has been true."""
        super().rearm()
        self._begun: float | None = None
        self._measuring = False
        self._reason = ""

    def outlook(self, run: Instant) -> tuple[bool, float]:
        """Nothing for certain."""
        return False, -math.inf

    def _lasting(self, run: Instant) -> bool:
        """Whether it has been true since its trigger waits; to be called once each step."""
        if self._begun is None:
            self._begun = run.time
        if self._reason or run.time < self._begun + self.delay:
            return bool(self._reason)
        if not self._measuring:
            self._measuring = True
            self.condition.measure_from(run)
        if self.condition.evaluate(run):
            self._reason = f"{super().describe(run)} at {run.time:.2f} s"
        return bool(self._reason)

    def describe(self, run: Instant) -> str:
        """Why and when it has become true; the expression with the values of now before that."""
        return self._reason or super().describe(run)
