"""Steps from parents: draws of the prior beside them until something fails, and new parents before worn ones."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from generation.search.emitters import Archive, Frame, LineEmitter
from generation.search.problem import Problem
from schemas.common.array_types import FloatArray

FAR = 1000.0
"""Where parents are, far from draws of the prior"""


class _Parents:
    def __init__(self, solutions: FloatArray) -> None:
        self._solutions = solutions

    def data(self, _: str) -> FloatArray:
        return self._solutions


class _Archive:
    def __init__(self, solutions: FloatArray, failures: int) -> None:
        self.parents, self.failures = _Parents(solutions), failures

    def __len__(self) -> int:
        return len(self.parents.data("solution"))


def emitter(archive: Any, seed: int = 0) -> LineEmitter:
    prior = SimpleNamespace(sample=lambda n, generator: generator.random((n, 2)))
    frame = SimpleNamespace(prior=prior, points=lambda coordinates: coordinates)
    return LineEmitter(cast("Problem", None), cast("Frame", frame), cast("Archive", archive), 100, np.random.default_rng(seed))


def far(theta: FloatArray) -> int:
    return int((theta[:, 0] > FAR / 2).sum())


def test_draws_of_the_prior_are_left_out_once_something_fails() -> None:
    solutions = np.array([[FAR, 0.0], [FAR, 1.0]])
    assert [far(emitter(_Archive(*each)).ask(0.0)) for each in ((solutions[:0], 0), (solutions, 0), (solutions, 1))] == [
        0,
        50,
        100,
    ]


def test_new_parents_are_drawn_before_those_that_many_steps_began_at() -> None:
    archive = _Archive(np.array([[FAR, 0.0]]), 1)
    steps = emitter(archive)
    steps.ask(0.0)
    archive.parents = _Parents(np.array([[FAR, 0.0], [FAR, 4000.0]]))
    assert (steps.ask(0.0)[:, 1] > 1000.0).sum() > 80
    assert 40 < (steps.ask(0.0)[:, 1] > 1000.0).sum() < 80


def test_the_same_seed_gives_the_same_points() -> None:
    archive = _Archive(np.array([[FAR, 0.0], [FAR, 4.0]]), 1)
    first, again = emitter(archive, 3), emitter(archive, 3)
    for _ in range(2):
        np.testing.assert_array_equal(first.ask(0.0), again.ask(0.0))
