"""A test double for systems under test."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from runner.sut.base import Control, Observation, Participant


@dataclass(frozen=True, slots=True)
class Scripted:
    """Plays a script, whatever it sees: `runner.run(scenario, sut=Scripted([(1.0, Control(acceleration=-2.0))]))`.

    Args:
        script: time (s) and control from that time on, in ascending order; before the first it leaves all to the scenario.
    """

    script: Sequence[tuple[float, Control]] = ()

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Nothing is carried from run to run."""

    def control(self, observation: Observation, dt: float) -> Control:
        """What the script says for this time."""
        index = bisect_right(self.script, observation.time + 1e-9, key=lambda entry: entry[0])
        return self.script[index - 1][1] if index else Control()
