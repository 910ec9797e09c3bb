"""The buffer and what is sifted from it."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.trfe.discovery.candidates import Buffer, Preprocessing, sift
from recognition.trfe.inputs.samples import Prototypes
from schemas.common.errors import UsageError
from studies.recognition.strategies import CosinePrototypes, EuclideanPrototypes, MarginPrototypes
from tests.recognition.clouds import clouds


def test_the_oldest_samples_are_dropped() -> None:
    buffer = Buffer(4)
    buffer.add(np.arange(3.0)[:, None], np.array([10, 11, 12]))
    assert not buffer.full
    buffer.add(np.arange(3.0, 6.0)[:, None], np.array([13, 14, 15]))
    assert buffer.full
    assert (buffer.keys.tolist(), buffer.inputs.ravel().tolist(), buffer.dropped) == (
        [12, 13, 14, 15],
        [2.0, 3.0, 4.0, 5.0],
        2,
    )
    buffer.remove(np.array([True, False, False, True]))
    assert (buffer.keys.tolist(), buffer.inputs.ravel().tolist(), len(buffer)) == (
        [13, 14],
        [3.0, 4.0],
        2,
    )


def test_a_batch_larger_than_the_buffer_leaves_its_end() -> None:
    buffer = Buffer(2)
    buffer.add(np.arange(5.0)[:, None], np.arange(5))
    assert (buffer.keys.tolist(), buffer.dropped) == ([3, 4], 3)


def line() -> Prototypes:
    """Classes 1 and 2 about 0 and 10 on a line, their samples up to 1 beside; not standardised."""
    centres, ones = np.array([[0.0], [10.0]], np.float32), np.ones(1, np.float32)
    return Prototypes(np.array([1, 2]), centres, np.array([0.95, 0.95]), 0.0 * ones, np.diag(ones))


def test_ratio_is_the_distance_over_the_radius() -> None:
    assert line().ratio(np.array([[0.0], [0.95], [1.9], [5.0], [12.85]])) == pytest.approx(
        [0.0, 1.0, 2.0, 5.0 / 0.95, 3.0]
    )


def test_radii_are_the_95th_percentile_of_a_class_s_own_distances() -> None:
    features, labels = clouds([1, 2], 200, seed=0)
    for kind in (Prototypes, EuclideanPrototypes, CosinePrototypes, MarginPrototypes):
        prototypes = kind.fit(features, labels)
        assert np.mean(prototypes.ratio(features) <= 1.0) == pytest.approx(0.95, abs=0.011), kind


def test_standardised_features_have_mean_0_and_deviation_1() -> None:
    features, labels = clouds([1, 2], 50, seed=0)
    features[:, 3] = 7.0
    standard = EuclideanPrototypes.fit(features, labels).standardise(features)
    assert standard.mean(axis=0) == pytest.approx(np.zeros(16), abs=1e-5)
    assert np.delete(standard.std(axis=0), 3) == pytest.approx(np.ones(15), abs=1e-4)
    assert (standard[:, 3] == 0.0).all()


def test_margin_is_small_between_classes() -> None:
    samples = np.concatenate([np.linspace(-1, 1, 41), np.linspace(9, 11, 41)])[:, None]
    prototypes = MarginPrototypes.fit(samples, np.repeat([1, 2], 41))
    ratio = prototypes.ratio(np.array([[0.0], [4.9], [10.0]]))
    assert ratio[[0, 2]] == pytest.approx([0.8, 0.8], abs=0.05)
    assert ratio[1] > 10.0


def test_outliers_are_far_from_their_neighbours() -> None:
    """Distances to the two nearest of 0, 1, …, 9, 30: 1 inside, 1.5 at the ends,
    20.5 for 30; median 1, MAD 0.
    """
    features = np.concatenate([np.arange(10.0), [30.0]])[:, None] + 100.0
    sifted = sift(features, line(), Preprocessing(neighbours=2, spread=3.0))
    assert np.flatnonzero(sifted.outlying).tolist() == [0, 9, 10]
    assert not sifted.near_known.any()
    assert np.flatnonzero(sifted.kept).tolist() == list(range(1, 9))


def test_nothing_is_set_aside_unless_asked_for() -> None:
    features = np.concatenate([np.linspace(0.5, 9.5, 19), [300.0]])[:, None]
    assert sift(features, line()).kept.all()


def test_samples_within_the_margin_of_a_known_class_are_set_aside() -> None:
    features = np.array([[0.5], [3.0], [4.0], [5.0], [9.5]])
    sifted = sift(features, line(), Preprocessing(neighbours=1, margin=0.75))
    assert sifted.near_known.tolist() == [True, False, False, False, True]
    beside = np.array([[0.8], [5.0]])
    for margin, near in ((0.75, False), (1.0, True)):
        assert (
            sift(beside, line(), Preprocessing(neighbours=1, margin=margin)).near_known[0] == near
        )


@pytest.mark.parametrize(
    "kind", [Prototypes, EuclideanPrototypes, CosinePrototypes, MarginPrototypes]
)
def test_new_classes_are_kept_and_known_ones_are_not(kind: type[Prototypes]) -> None:
    prototypes = kind.fit(*clouds([1, 2, 3], 100, seed=0, apart=4.0))
    features, truth = clouds([1, 2, 3, 8], 60, seed=1, apart=4.0)
    kept = sift(features, prototypes, Preprocessing(spread=3.0, margin=1.0)).kept
    assert kept[truth != 8].mean() < 0.15
    if kind is not MarginPrototypes:
        assert kept[truth == 8].mean() > 0.85


def test_bad_input_is_refused() -> None:
    with pytest.raises(UsageError, match="can't hold any"):
        Buffer(0)
    with pytest.raises(UsageError, match="have no 10 neighbours"):
        sift(np.zeros((10, 1)), line())
    with pytest.raises(UsageError, match="not finite"):
        sift(np.full((20, 1), np.nan), line())
    with pytest.raises(UsageError, match="at least 2 are needed"):
        MarginPrototypes.fit(np.zeros((4, 1)), np.ones(4, dtype=int))
