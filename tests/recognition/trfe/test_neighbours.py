"""Distances to the nearest samples of each known class."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.trfe.forest import Neighbours
from schemas.common.errors import UsageError
from tests.recognition.clouds import clouds


def test_samples_are_nearest_to_their_own_class() -> None:
    near = Neighbours.fit(*clouds([3, 7, 9], 80, seed=0))
    samples, truth = clouds([3, 7, 9], 50, seed=1)
    assert (
        np.mean(near.distances(samples).argmin(axis=1) == np.searchsorted([3, 7, 9], truth)) > 0.98
    )


def test_distances_are_means_over_the_three_nearest_others() -> None:
    line = np.arange(10.0)[:, None]
    near = Neighbours.fit(line, np.ones(10, int))
    spread = line.std()
    assert np.exp(near.distances([[0.0]]))[0, 0] == pytest.approx(2.0 / spread, rel=1e-2), (
        "of 1, 2, 3: itself is none"
    )
    assert np.exp(near.distances([[-1.0]]))[0, 0] == pytest.approx(2.0 / spread, rel=1e-2), (
        "of 0, 1, 2"
    )


def test_distances_stand_beside_the_features() -> None:
    features, labels = clouds([1, 2], 20, seed=0)
    extended = Neighbours.fit(features, labels).extended(features)
    assert extended.shape == (40, 18)
    assert np.array_equal(extended[:, :16], features)
    assert np.isfinite(extended).all()


def test_few_and_equal_samples_have_finite_distances() -> None:
    near = Neighbours.fit(np.zeros((3, 2)), np.array([1, 1, 2]))
    assert np.isfinite(near.distances(np.zeros((2, 2)))).all()


def test_frequent_classes_are_thinned_alike_for_a_seed() -> None:
    features, labels = clouds([1, 2], 500, seed=0)
    first, again, other = (Neighbours.fit(features, labels, seed) for seed in (1, 1, 2))
    assert np.bincount(first.labels).tolist() == [0, 400, 400]
    assert np.array_equal(first.references, again.references)
    assert not np.array_equal(first.references, other.references)


def test_other_dimensions_and_numbers_that_are_none_are_refused() -> None:
    features, labels = clouds([1, 2], 20, seed=0)
    near = Neighbours.fit(features, labels)
    with pytest.raises(UsageError, match="15 dimensions"):
        near.distances(features[:, 1:])
    with pytest.raises(UsageError, match="not finite"):
        near.distances(np.full((1, 16), np.nan))


def test_distances_stay_finite_far_beyond_a_feature_that_hardly_varies() -> None:
    features, labels = clouds([3, 7], 80, seed=0)
    features[:, 0] = 1.0 + 1e-6 * features[:, 0]
    far = features.copy()
    far[:, 0] = np.where(labels == 3, 2e30, -2e30)
    near = Neighbours.fit(features, labels)
    distances = near.distances(far)
    assert np.isfinite(distances).all()
    assert distances.min() > near.distances(features).max()
