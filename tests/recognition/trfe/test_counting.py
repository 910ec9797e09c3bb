"""How many clusters there are is found where they are apart, and not made up where there is one."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.trfe.discovery.clustering import likely_count
from tests.recognition.clouds import clouds


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_the_number_of_clusters_is_that_of_clouds_that_are_apart(count: int) -> None:
    assert (
        likely_count(clouds(list(range(11, 11 + count)), 50, seed=0, apart=8.0)[0], 10, seed=0)
        == count
    )


def test_clusters_of_different_sizes_count_alike() -> None:
    samples = np.concatenate(
        [clouds([11], 150, seed=0, apart=8.0)[0], clouds([12, 13], 30, seed=1, apart=8.0)[0]]
    )
    assert likely_count(samples, 10, seed=0) == 3


def test_there_are_no_more_clusters_than_asked_for_or_than_samples_tell() -> None:
    assert likely_count(clouds([11, 12, 13, 14], 50, seed=0, apart=8.0)[0], 3, seed=0) <= 3
    assert likely_count(np.zeros((2, 3), np.float32), 10, seed=0) == 1
    assert likely_count(np.zeros((40, 3), np.float32), 10, seed=0) == 1


def test_parts_of_classes_are_not_counted() -> None:
    """Each of three classes is of two kinds, far nearer to each other than the classes are."""
    samples, truth = clouds([11, 12, 13], 100, seed=0, apart=8.0)
    samples[::2, truth[0]] += 3.0
    assert likely_count(samples, 10, seed=0) == 3


@pytest.mark.slow
def test_a_seed_decides_the_count_and_nothing_is_one_cluster() -> None:
    samples = np.random.default_rng(0).standard_normal((120, 4)).astype(np.float32)
    assert len({likely_count(samples, 10, seed=5) for _ in range(2)}) == 1
    assert likely_count(np.zeros((0, 3), np.float32), 10, seed=0) == 1
