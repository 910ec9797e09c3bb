"""Votes of forests, against what each tree says."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from sklearn.ensemble import RandomForestClassifier
from threadpoolctl import threadpool_limits

from recognition.trfe.forest import background_of, forest
from recognition.trfe.forest.trees import Trees
from schemas.common.errors import UsageError
from tests.recognition.clouds import clouds


def test_votes_are_the_choices_of_the_trees() -> None:
    features, labels = clouds([3, 7, 12], 40, seed=0, apart=1.0)
    grown = RandomForestClassifier(20, random_state=1).fit(features, labels)
    chosen = grown.classes_[
        np.stack([tree.predict(features).astype(int) for tree in grown.estimators_])
    ]
    expected = np.stack([(chosen == label).sum(axis=0) for label in (3, 7, 12)], axis=1)
    assert np.array_equal(Trees.of(grown).votes(features), expected)
    assert (Trees.of(grown).votes(features).sum(axis=1) == 20).all()


def test_votes_are_not_mean_probabilities() -> None:
    """Each leaf of a stump that holds two thirds of a class casts a whole vote for it, while its
    probability is two thirds.
    """
    features = np.array([[0.0], [0.0], [0.0], [1.0], [1.0], [1.0]])
    labels = np.array([1, 1, 2, 2, 2, 1])
    grown = RandomForestClassifier(8, bootstrap=False, max_depth=1, random_state=0).fit(
        features, labels
    )
    assert Trees.of(grown).votes(features[[0, 3]]).tolist() == [[8, 0], [0, 8]]
    assert grown.predict_proba(features[[0, 3]]) == pytest.approx(
        np.array([[2 / 3, 1 / 3], [1 / 3, 2 / 3]])
    )


def test_a_seed_decides_the_forest() -> None:
    features, labels = clouds([1, 2], 50, seed=0, apart=1.0)
    first, again, other = (forest(features, labels, 10, seed).votes(features) for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_votes_for_the_background_are_left_out() -> None:
    features, labels = clouds([3, 7], 60, seed=0)
    grown = forest(features, labels, 20, background=background_of(features, 0))
    assert grown.classes.tolist() == [0, 3, 7]
    around = np.random.default_rng(0).permuted(features, axis=0)
    for samples, most in ((features, 20), (around, 8)):
        cast = grown.votes(samples)
        assert cast.shape == (len(samples), 2)
        assert np.median(cast.sum(axis=1)) == pytest.approx(most, abs=8)


def test_the_background_is_like_the_samples_in_each_feature_but_not_together() -> None:
    features, _ = clouds([1, 2, 3], 100, seed=0)
    features[:, 5] = 4.0
    around = background_of(features, seed=1)
    assert around.shape == (600, 16)
    assert np.allclose(np.sort(around[:300], axis=0), np.sort(features, axis=0), atol=1e-4)
    correlation = [np.cov(samples.T)[0, 1] for samples in (features, around[:300], around[300:])]
    assert abs(correlation[1]) < 0.2 * abs(correlation[0])
    assert correlation[2] == pytest.approx(correlation[0], rel=0.2), (
        "components are uncorrelated anyway"
    )
    assert np.isfinite(around).all()
    assert np.array_equal(around, background_of(features, seed=1))


def test_no_samples_have_no_votes() -> None:
    features, labels = clouds([1, 2], 5, seed=0)
    assert forest(features, labels, 3).votes(features[:0]).shape == (0, 2)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda features, labels: (np.where(features > 0, np.nan, features), labels), "not finite"),
        (lambda features, labels: (features[:, 0], labels), "a table"),
        (lambda features, labels: (features, labels[:-1]), "need as many labels"),
        (lambda features, labels: (features, np.ones_like(labels)), "at least 2 are needed"),
        (lambda features, labels: (features, labels - 1), "positive whole numbers"),
    ],
)
def test_bad_samples_are_refused(spoil, message) -> None:
    with pytest.raises(UsageError, match=message):
        forest(*spoil(*clouds([1, 2], 10, seed=0)), trees=2)


def test_features_of_another_width_are_refused() -> None:
    features, labels = clouds([1, 2], 10, seed=0)
    with pytest.raises(UsageError, match="15 dimensions, the model was fitted on 16"):
        forest(features, labels, 2).votes(features[:, 1:])


def test_a_forest_grows_by_as_many_threads_as_are_allowed_and_keeps_warning_filters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    threads = []

    class Watched(RandomForestClassifier):
        def fit(self, *arguments: Any, **options: Any) -> RandomForestClassifier:
            threads.append(self.n_jobs)
            warnings.filters[:] = []  # as threads that end in another order leave them
            return super().fit(*arguments, **options)

    monkeypatch.setattr("sklearn.ensemble.RandomForestClassifier", Watched)
    features, labels = clouds([1, 2], 50, seed=0, apart=1.0)
    for limit in (1, 2):
        with threadpool_limits(limit), warnings.catch_warnings(record=True):
            before = list(warnings.filters)
            forest(features, labels, 10, 0)
            assert list(warnings.filters) == before
    assert threads[0] == 1
