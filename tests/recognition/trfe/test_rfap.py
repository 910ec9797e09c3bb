"""RFAP similarity, by hand on two small trees and against the double loop on grown ones."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.ensemble import RandomForestClassifier, RandomTreesEmbedding

from recognition.trfe.forest import forest, random_trees, similarity
from recognition.trfe.forest.trees import Trees
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from tests.recognition.clouds import clouds


def naive(forest: RandomForestClassifier, features: Features) -> FloatArray:
    """The definition, pair by pair and tree by tree."""
    total = np.zeros((len(features), len(features)))
    for tree in forest.estimators_:
        paths = [set(row.indices.tolist()) for row in tree.decision_path(features)]
        for i, one in enumerate(paths):
            for j, other in enumerate(paths):
                total[i, j] += len(one & other) / len(one | other)
    return total / len(forest.estimators_)


def test_two_trees_by_hand() -> None:
    """Both trees split at 0.5; the right half, of two classes, is split again at
    1.5. Paths have 2, 3 and 3 nodes.
    """
    features = np.array([[0.0], [1.0], [2.0]])
    grown = RandomForestClassifier(2, bootstrap=False, random_state=0).fit(features, [1, 2, 1])
    shapes = [tree.tree_.threshold[0] for tree in grown.estimators_]
    found = similarity(Trees.of(grown), features)
    assert shapes == [0.5, 0.5] or set(shapes) <= {0.5, 1.5}
    assert found.diagonal().tolist() == [1.0, 1.0, 1.0]
    assert found == pytest.approx(naive(grown, features))
    stump = RandomForestClassifier(2, bootstrap=False, random_state=0).fit(features, [1, 2, 2])
    assert similarity(Trees.of(stump), features) == pytest.approx(
        np.array([[1, 1 / 3, 1 / 3], [1 / 3, 1, 1], [1 / 3, 1, 1]])
    )


@pytest.mark.parametrize("unsupervised", [False, True])
def test_it_is_the_double_loop(unsupervised: bool) -> None:
    features, labels = clouds([1, 2, 3], 60, seed=0, apart=1.0)
    grown = (
        RandomTreesEmbedding(12, max_depth=8, random_state=0).fit(features)
        if unsupervised
        else RandomForestClassifier(12, random_state=0).fit(features, labels)
    )
    some = clouds([2, 3, 9], 50, seed=1, apart=1.0)[0]
    found = similarity(Trees.of(grown), some)
    assert found.dtype == np.float32
    assert found == pytest.approx(naive(grown, some), abs=1e-5)
    assert np.array_equal(found, found.T)


def test_samples_of_one_class_are_more_alike() -> None:
    known = clouds([1, 2, 3, 4], 80, seed=0, apart=2.0)
    features, truth = clouds([8, 9], 40, seed=1, apart=2.0)
    same = truth[:, None] == truth
    for grown in (forest(*known, 100), random_trees(features, 100)):
        found = similarity(grown, features)
        assert found[same].mean() > 1.3 * found[~same].mean()


def test_samples_of_another_width_are_refused() -> None:
    features, labels = clouds([1, 2], 20, seed=0)
    with pytest.raises(UsageError, match="15 dimensions"):
        similarity(forest(features, labels, 3), features[:, 1:])


def test_one_sample_grows_no_trees() -> None:
    with pytest.raises(UsageError, match="at least 2 are needed"):
        random_trees(np.zeros((1, 3)))
