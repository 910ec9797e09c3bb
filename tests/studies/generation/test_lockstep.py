"""Searches side by side: results are those of each alone."""

from __future__ import annotations

from functools import partial

import numpy as np
import torch

from generation.search.outcomes import Outcomes
from generation.search.problem import Plays
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray
from studies.generation.lockstep import as_ended, together


def played(theta: FloatArray, sut: str | None = None) -> Outcomes:
    return Outcomes.of(len(theta), r_risk=theta[:, 0])


def drawing(seed: int, rounds: int, plays: Plays) -> list[float]:
    """Draws from the global generators of both libraries between questions."""
    np.random.seed(seed)
    drawn: list[float] = []
    with seeded(seed):
        for _ in range(rounds):
            plays(np.zeros((1, 1)))
            drawn += [np.random.random(), float(torch.rand(1))]
    return drawn


def test_each_search_has_the_global_random_numbers_to_itself() -> None:
    works = [partial(drawing, seed, 3) for seed in (1, 2, 1)]
    beside = together(works, played)
    assert beside == [together([work], played)[0] for work in works]
    assert beside[0] == beside[2] != beside[1]


def test_random_numbers_of_the_caller_go_on() -> None:
    np.random.seed(5)
    expected = np.random.random()
    np.random.seed(5)
    together([partial(drawing, 1, 2)], played)
    assert np.random.random() == expected


def test_results_are_given_as_their_searches_end() -> None:
    works = [partial(drawing, 1, rounds) for rounds in (4, 0, 2)]
    assert [number for number, _ in as_ended(works, played)] == [1, 2, 0]
