"""Emitters of quality-diversity search, by name in `EMITTERS`: ways in which points are proposed, and the archive of parents."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from generation.density.base import Whitening
from generation.density.limits import LEAST, by_actor, reading
from generation.density.prior import Prior
from generation.density.roles import roles_of
from generation.search.policy import Learner, McsgSettings, coordinated, uniform_rows
from generation.search.problem import Problem
from generation.search.space import Space
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.packages import optional


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of points θ (n, d) of a space.

    Attributes:
        varied: the parameters that are searched (d,); nuisances are drawn with them.
        whitening: of recorded points in the unit cube: steps are as long as traffic varies, in the directions in which it does.
    """

    space: Space
    prior: Prior
    varied: BoolArray
    whitening: Whitening

    @classmethod
    def of(cls, space: Space, prior: Prior, generator: np.random.Generator) -> Frame:
        """Build from a prior's recorded points, or from draws if there are too few."""
        varied = np.array([name not in prior.nuisances for name in space.names])
        rows = prior.theta if len(prior.theta) > 2 * len(varied) else prior.sample(1000, generator)
        return cls(space, prior, varied, Whitening.of(space.unit(rows)[:, varied]))

    @property
    def dimension(self) -> int:
        """Number of coordinates k."""
        return int(self.varied.sum())

    def coordinates(self, theta: FloatArray) -> FloatArray:
        """Whitened coordinates (n, k)."""
        return self.whitening.forward(self.space.unit(theta)[:, self.varied])

    def points(self, coordinates: FloatArray) -> FloatArray:
        """Points of coordinates (n, k), with nuisances as recorded; some may lie outside the box."""
        unit = np.full((len(coordinates), len(self.varied)), 0.5)
        unit[:, self.varied] = self.whitening.mean + coordinates @ self.whitening.factor.T
        return self.prior.with_nuisances(self.space.scaled(unit))

    def measures(self, theta: FloatArray) -> FloatArray:
        """Return the readable measures, in the unit cube (n, m).

        Relative speed and time headway when the manoeuvre begins and its pace (lanes per second), of each actor, and the ego's
        speed, as far as the space has them; the varied parameters themselves where it has fewer than two.
        """
        values = self.space.by_name(theta)
        roles = roles_of(values)
        found = _read(by_actor(values, roles)) if len(roles) > 1 else []
        return np.stack(found, axis=1) if len(found) > 1 else self.space.unit(theta)[:, self.varied]


def _read(actors: Mapping[str, Mapping[str, FloatArray]]) -> list[FloatArray]:
    """The measures that the roles of each actor allow, each about 0 to 1."""
    found: list[FloatArray | None] = []
    ego = None
    for actor, of in actors.items():
        closing, headway, ego = reading(of, actor)
        found += [
            None if closing is None else 0.5 + closing / 60.0,
            None if headway is None else headway / 4.0,
            1.0 / np.maximum(of["duration"], LEAST) if "duration" in of else None,
        ]
    return [each for each in (*found, None if ego is None else ego / 40.0) if each is not None]


_NOVEL = 0.02
"""Distance of measures from which a point is one more parent"""
_BEST, _ENOUGH = 0.9, 1
"""Quantile of all scores from which a point is a parent, and number of failures from which these are the only parents"""


class Archive:
    """A proximity archive of the library ribs.

    J. Lehman and K. O. Stanley, Abandoning objectives: evolution through the search for novelty alone, 2011.

    Args:
        frame: coordinates of its points.
        seed: of what is drawn from it.

    Attributes:
        parents: the archive of ribs, for its emitters.
        failures: how many points that fail it was given.
    """

    def __init__(self, frame: Frame, measures: int, seed: int) -> None:
        self._frame = frame
        self.parents: Any = ribs("archives").ProximityArchive(
            solution_dim=frame.dimension, measure_dim=measures, k_neighbors=1, novelty_threshold=_NOVEL, local_competition=True,
            seed=seed,
        )  # fmt: skip
        self._scores, self.failures = np.empty(0), 0

    def add(self, theta: FloatArray, scores: FloatArray) -> None:
        """Take points (n, d) with scores (n,) as parents: the best so far, or the failures alone once they are enough."""
        failing = scores >= 1.0
        before, self.failures = self.failures, self.failures + int(failing.sum())
        if before < _ENOUGH:
            self._scores = np.concatenate([self._scores, scores])
            failing |= scores >= float(np.quantile(self._scores, _BEST))
            if self.failures >= _ENOUGH:
                self._forget()
                failing = scores >= 1.0
        if failing.any():
            self.parents.add(self._frame.coordinates(theta[failing]), scores[failing], self._frame.measures(theta[failing]))

    def _forget(self) -> None:
        """Keep the failures alone."""
        found = self.parents.data(["solution", "objective", "measures"])
        self.parents.clear()
        kept = found["objective"] >= 1.0
        if kept.any():
            self.parents.add(*(found[name][kept] for name in ("solution", "objective", "measures")))

    def __len__(self) -> int:
        return len(self.parents)


def ribs(module: str) -> Any:
    """A module of ribs.

    Raises:
        MissingExtra: it is not installed.
    """
    return optional(f"ribs.{module}")


class Emitter(ABC):
    """Proposes points, and learns from their scores.

    Args:
        problem: what is searched. frame: coordinates of points. archive: of parents.
        batch: points proposed at a time. generator: of everything random.
    """

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        self._frame, self._archive, self._batch, self._generator = frame, archive, batch, generator

    @abstractmethod
    def ask(self, spent: float) -> FloatArray:
        """Points (n, d), also outside the box; `spent` is the share of the budget that is spent."""

    def tell(self, scores: FloatArray) -> None:  # noqa: B027 - most emitters learn nothing
        """Scores (n,) of the points asked for last: 1 for a new failure, less the further from it; −1 where not tried."""


class PriorEmitter(Emitter):
    """Draws from the prior, whatever was found so far."""

    def ask(self, spent: float) -> FloatArray:
        """Draws (n, d)."""
        return self._frame.prior.sample(self._batch, self._generator)


_ISO, _LINE = 0.5, 0.2
"""Standard deviations of the noise, and of the way along the line as a share of the parents' distance"""
_STEPS = 4.0
"""Steps after which a parent is drawn half as often as a new one"""


class LineEmitter(Emitter):
    """Isotropic steps from parents, and some of the way to another parent, in whitened coordinates.

    A parent at which many steps began is drawn less often than a new one: its surroundings are known.

    V. Vassiliades and J.-B. Mouret, Discovering the elite hypervolume by leveraging interspecies correlation, 2018; A. Cully and
    Y. Demiris, Quality and diversity optimization: a unifying modular framework, 2018 (selection of parents by curiosity).
    """

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        super().__init__(problem, frame, archive, batch, generator)
        self._steps = Counter[bytes]()

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d); until something fails half are draws of the prior, as near misses may lead nowhere."""
        steps = self._batch if self._archive.failures else self._batch // 2 if len(self._archive) else 0
        drawn = self._frame.prior.sample(self._batch - steps, self._generator)
        return np.concatenate([drawn, self._stepped(steps)]) if steps else drawn

    def _stepped(self, n: int) -> FloatArray:
        parents = np.asarray(self._archive.parents.data("solution"), np.float64)
        start, other = parents[self._drawn(parents, n)], parents[self._generator.integers(len(parents), size=n)]
        along = self._generator.normal(0.0, _LINE, (n, 1))
        return self._frame.points(start + self._generator.normal(0.0, _ISO, start.shape) + along * (other - start))

    def _drawn(self, parents: FloatArray, n: int) -> IntArray:
        """Indices (n,) of the parents (m, k) at which the steps begin."""
        names = [each.tobytes() for each in parents]
        weights = 1.0 / (1.0 + np.array([self._steps[name] for name in names]) / _STEPS)
        drawn = self._generator.choice(len(parents), n, p=weights / weights.sum())
        self._steps.update(names[index] for index in drawn)
        return drawn


_SIGMA = 0.3
"""First standard deviation of its steps, in whitened coordinates"""


class EvolutionEmitter(Emitter):
    """Evolution strategy with covariance matrix adaptation towards failures; it restarts from another parent when it stagnates.

    N. Hansen, The CMA evolution strategy: a tutorial, 2016; M. C. Fontaine et al., Covariance matrix adaptation for the rapid
    illumination of behavior space, 2020.
    """

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        super().__init__(problem, frame, archive, batch, generator)
        self._seed = int(generator.integers(2**31))
        self._own: Any = None
        self._rows = np.empty((0, frame.dimension))

    def ask(self, spent: float) -> FloatArray:
        """Points (n, d); none while there are no parents."""
        if self._own is None and len(self._archive):
            start = self._archive.parents.sample_elites(1)["solution"][0]
            self._own = ribs("emitters").EvolutionStrategyEmitter(
                self._archive.parents, x0=start, sigma0=_SIGMA, ranker="obj", selection_rule="mu", batch_size=self._batch,
                seed=self._seed,
            )  # fmt: skip
        self._rows = self._own.ask() if self._own is not None else np.empty((0, self._frame.dimension))
        return self._frame.points(self._rows)

    def tell(self, scores: FloatArray) -> None:
        """Move towards the better half."""
        if len(scores):
            measures = np.zeros((len(scores), self._archive.parents.measure_dim))
            self._own.tell(self._rows, scores, measures, {"status": (scores >= 1.0).astype(int), "value": scores})


_COARSE, _FINE = 4, 8
"""Generations after which its edits are refined, and have Gaussian noise"""


class PolicyEmitter(Emitter):
    """Policy of MCSG: an LSTM edits parents, from coarse to fine.

    It learns from the archive: 1 for a failure, less the further from it, −1 for a point that is not foreseeable or
    known; such points are never run.
    """

    def __init__(self, problem: Problem, frame: Frame, archive: Archive, batch: int, generator: np.random.Generator) -> None:
        super().__init__(problem, frame, archive, batch, generator)
        self._real = problem.starts
        self._learner = Learner(problem.space, coordinated(problem.space, problem.real), McsgSettings())
        self._generations = 0

    def ask(self, spent: float) -> FloatArray:
        """Edited parents (n, d), or edited real scenarios while there are none; nuisances are those of the edited ones."""
        if self._generations == _COARSE:
            self._learner.refine()
        proposed = self._learner.propose(self._starts(), noise=self._generations >= _FINE)
        self._generations += 1
        return self._frame.prior.with_nuisances(proposed)

    def tell(self, scores: FloatArray) -> None:
        """Learn from what came of them."""
        self._learner.learn(scores)

    def _starts(self) -> FloatArray:
        if not len(self._archive):
            return uniform_rows(self._real, self._batch, self._generator)
        parents = self._archive.parents.sample_elites(self._batch)["solution"]
        return self._frame.points(np.asarray(parents, np.float64))


EMITTERS: dict[str, type[Emitter]] = {
    "evolution": EvolutionEmitter,
    "line": LineEmitter,
    "policy": PolicyEmitter,
    "prior": PriorEmitter,
}
