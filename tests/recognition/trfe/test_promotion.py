"""Which clusters become classes."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.trfe.discovery.candidates import Promotion, cohesion, judge, known_cohesion
from recognition.trfe.inputs.samples import Prototypes
from schemas.common.errors import UsageError


def blocks(sizes: list[int], within: list[float], between: float = 0.1) -> np.ndarray:
    """Similarity that is constant within each cluster and between them."""
    similar = np.full((sum(sizes), sum(sizes)), between, np.float32)
    start = 0
    for size, value in zip(sizes, within, strict=True):
        similar[start : start + size, start : start + size] = value
        start += size
    np.fill_diagonal(similar, 1.0)
    return similar


def prototypes() -> Prototypes:
    """One known class about the origin, radius 1."""
    ones = np.ones(2, np.float32)
    return Prototypes(
        np.array([1]), np.zeros((1, 2), np.float32), np.array([1.0]), 0.0 * ones, np.diag(ones)
    )


def test_cohesion_is_the_mean_over_pairs_of_different_samples() -> None:
    similar = np.array([[1.0, 0.2, 0.4], [0.2, 1.0, 0.9], [0.4, 0.9, 1.0]], np.float32)
    assert cohesion(similar) == pytest.approx(0.5)
    assert cohesion(similar[:1, :1]) == 0.0


def test_the_known_classes_cohesion_is_their_median() -> None:
    similar = blocks([3, 4, 5], [0.5, 0.9, 0.7])
    assert known_cohesion(similar, np.repeat([1, 2, 3], [3, 4, 5])) == pytest.approx(0.7)


def test_clusters_are_judged_by_size_cohesion_and_distance() -> None:
    sizes, within = [25, 19, 25, 25], [0.8, 0.9, 0.3, 0.9]
    features = np.repeat([[5.0, 0.0], [0.0, 5.0], [5.0, 5.0], [0.5, 0.5]], sizes, axis=0)
    numbers = np.repeat([4, 2, 7, 9], sizes)
    found = judge(numbers, features, blocks(sizes, within), prototypes(), reference=0.8)
    assert [one.cluster for one in found] == [2, 4, 7, 9]
    assert [one.promoted for one in found] == [False, True, False, False]
    assert [one.reason for one in found] == [
        "19 samples, fewer than 20",
        "",
        "cohesion 0.300 below 0.5 of the known classes' 0.800",
        "within the margin of a known class, r = 0.71",
    ]
    assert [round(one.cohesion, 3) for one in found] == [0.9, 0.8, 0.3, 0.9]
    assert [one.absolutely_cohesive for one in found] == [True, False, False, True]
    assert found[1].members.tolist() == list(range(25))
    assert found[1].ratio == pytest.approx(5.0)


def test_limits_are_choices() -> None:
    strict = Promotion(least_samples=2, relative_cohesion=1.0)
    arguments = np.zeros(2, dtype=int), np.full((2, 2), 3.0), blocks([2], [0.7]), prototypes()
    assert judge(*arguments, 0.69, strict)[0].promoted
    assert not judge(*arguments, 0.71, strict)[0].promoted


def test_arrays_of_different_samples_are_refused() -> None:
    with pytest.raises(UsageError, match="are not of 3 samples"):
        judge(
            np.zeros(3, dtype=int), np.zeros((3, 2)), np.eye(2, dtype=np.float32), prototypes(), 0.5
        )
