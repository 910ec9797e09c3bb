"""What every search is given, what it leaves, and the one way to spend simulator calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Protocol
from zipfile import BadZipFile

import numpy as np

from generation.density.prior import Prior
from generation.outcomes.evaluator import Evaluate
from generation.outcomes.outcomes import Episodes, Outcomes, joined
from generation.search.reward import Reward
from generation.search.space import Space
from schemas.errors import InvalidFile
from xodr.array_types import FloatArray

BATCH = 50
"""Points asked for at a time, wherever a method has no number of its own."""


class Plays(Protocol):
    """Plays points of a space; `generation.twin.episodes.Twin` does."""

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d), driven by the problem's system under test, or by the one of a name."""
        ...


class History(Episodes):
    """All episodes of a search, in their order."""

    def save(self, path: Path) -> None:
        """Write it whole or not at all."""
        draft = path.with_suffix(".draft")
        with draft.open("wb") as file:
            np.savez_compressed(file, theta=self.theta, rewards=self.rewards, **asdict(self.outcomes))
        draft.replace(path)

    @classmethod
    def load(cls, path: Path) -> History:
        """Read what `save` wrote.

        Raises:
            InvalidFile: it is something else.
        """
        try:
            with np.load(path, allow_pickle=False) as found:
                outcomes = Outcomes(**{field.name: found[field.name] for field in fields(Outcomes)})
                return cls(found["theta"], outcomes, found["rewards"])
        except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
            raise InvalidFile(f"this is no search's history ({error}); remove it to have it made again", path=path) from None


@dataclass(frozen=True, eq=False)
class Problem:
    """One search problem, the same for all methods.

    Attributes:
        space: the box of θ.
        evaluate: runs scenarios; what it is asked for counts against the budget.
        reward: what MCSG is after; its density says what is plausible.
        real: parameters (n, d) extracted from recordings, within the box.
        found: critical points (m, d) that earlier searches of the same space have found; None for none.
        prior: what traffic does in this space; None where only the published reward is asked for.
        twin: plays points without a simulator, with any system under test; None where there is none.
    """

    space: Space
    evaluate: Evaluate
    reward: Reward
    real: FloatArray
    found: FloatArray | None = None
    prior: Prior | None = None
    twin: Plays | None = None

    @property
    def starts(self) -> FloatArray:
        """What the first episodes of a search start from (k, d): what was found before, else real scenarios."""
        return self.real if self.found is None else self.found


Search = Callable[[Problem, int, int], History]
"""Spends a budget of simulator calls on a problem, all that is drawn by a seed."""


class Calls:
    """The simulator calls of one search: spends the budget, and keeps what came of it.

    Args:
        problem: the problem.
        budget: how many points may be evaluated in all.
    """

    def __init__(self, problem: Problem, budget: int) -> None:
        self.problem, self.left = problem, budget
        self._parts: list[Episodes] = []

    def __call__(self, theta: FloatArray) -> Episodes:
        """Evaluate the points (n, d), brought into the box; only the first ones, where the budget ends before them."""
        theta = self.problem.space.clip(np.asarray(theta, dtype=np.float64)[: self.left])
        outcomes = self.problem.evaluate(theta)
        self.left -= len(theta)
        self._parts.append(Episodes(theta, outcomes, self.problem.reward(theta, outcomes)))
        return self._parts[-1]

    @property
    def history(self) -> History:
        """All episodes so far."""
        if not self._parts:
            return History(np.empty((0, len(self.problem.space.parameters))), Outcomes.of(0), np.empty(0))
        thetas, outcomes, rewards = zip(*self._parts, strict=True)
        return History(np.concatenate(thetas), joined(outcomes), np.concatenate(rewards))


def counted(evaluate: Evaluate, progress: Callable[[int], None]) -> Evaluate:
    """Evaluate, and call `progress` with the number of points each time."""

    def evaluating(theta: FloatArray) -> Outcomes:
        outcomes = evaluate(theta)
        progress(len(theta))
        return outcomes

    return evaluating
