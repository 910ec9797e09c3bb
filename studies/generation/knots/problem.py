"""The trajectory-level search problem beside that of a logical scenario."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from generation.search.problem import History, Reward, SearchProblem
from studies.generation.knots.motion import Setting, maneuvers_of


class Trajectories(NamedTuple):
    """The trajectory-level problem beside a study's own.

    Attributes:
        scenario: its file.
        setting: what trajectories are described by.
        problem: what methods are given.
    """

    scenario: Path
    setting: Setting
    problem: SearchProblem

    def as_maneuvers(self, history: History, reward: Reward) -> History:
        """A search of trajectories as the manoeuvres nearest to them, and what these would have
        been rewarded with."""
        theta = maneuvers_of(history.theta, self.setting).theta
        return History(theta, history.outcomes, reward(theta, history.outcomes))
