"""A system under test that executes commands: how the caller of a `runner.Session` drives the ego."""

from __future__ import annotations

from dataclasses import dataclass, field

from runner.sut.base import Control, Observation, Participant


@dataclass(slots=True)
class Commanded:
    """Answers with the command that it holds, whatever it sees.

    Args:
        command: what the ego does in each step until it is replaced; by default all is left to the scenario.
    """

    command: Control = field(default_factory=Control)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Each run begins with all left to the scenario."""
        self.command = Control()

    def control(self, observation: Observation, dt: float) -> Control:
        """The command."""
        return self.command
