"""Figures of recognition on numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.recognition import metrics


def test_open_set_figures_of_six_samples() -> None:
    truth = [1, 1, 2, 2, 0, 0]
    closed = [1, 2, 2, 2, 1, 2]
    scores = [0.1, 0.2, 0.3, 0.8, 0.7, 0.9]
    predicted = [1, 2, 2, 0, 1, 0]
    found = metrics.open_set(truth, closed, scores, predicted)
    assert found.closed_accuracy == 3 / 4
    assert found.accuracy == 3 / 6
    # class 1: one right of two found and two true; class 2: the same; unknown:
    # one right of two found and two true
    assert found.macro_f1 == pytest.approx(0.5)
    assert (
        found.auroc == 7 / 8
    )  # of the eight pairs, only (0.7 unknown, 0.8 known) is the wrong way round
    assert found.false_rejection == 1 / 4


def test_oscr_is_the_area_that_the_thresholds_span() -> None:
    # correct rate 1/2 before the first unknown, 1/2 after it, 1 from the third known sample on:
    # 1/2·1/2 + 1·1/2 in two unit steps
    assert metrics.oscr(
        [1, 2, 0, 1, 2, 0], [1, 1, 1, 1, 2, 2], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    ) == pytest.approx(0.25 * 0.5 + 0.75 * 0.5)


def test_oscr_of_a_perfect_method_is_one_and_of_equal_scores_half() -> None:
    assert metrics.oscr([1, 2, 0], [1, 2, 1], [0.0, 0.1, 0.9]) == 1.0
    assert metrics.oscr([1, 2, 0], [1, 2, 1], [0.5, 0.5, 0.5]) == 0.5


def test_macro_f1_counts_only_classes_that_are_there() -> None:
    assert metrics.macro_f1([1, 1, 0, 0], [1, 1, 0, 9]) == pytest.approx((1.0 + 2 / 3) / 2)


def test_clusters_are_matched_one_to_one() -> None:
    truth = [3, 3, 3, 4, 4, 5, 5, 5]
    clusters = [7, 7, 2, 2, 2, 9, 9, -1]
    found = metrics.clustering(truth, clusters)
    assert found.matches == ((2, 4), (7, 3), (9, 5))
    assert found.accuracy == 6 / 7
    assert found.accuracy_of_all == 6 / 8
    assert found.dropped == 1 / 8
    assert found.unmatched == 0.0
    assert (found.clusters, found.classes) == (3, 3)


def test_samples_of_clusters_without_a_class_are_unmatched() -> None:
    found = metrics.clustering([3, 3, 3, 3], [0, 0, 0, 1])
    assert found.accuracy == found.accuracy_of_all == 3 / 4
    assert found.unmatched == 1 / 4


def test_samples_of_other_classes_are_wrong_in_any_cluster() -> None:
    found = metrics.clustering([3, 3, 1, 1, 1], [0, 0, 0, 1, 1], among=[3, 4])
    assert found.matches == ((0, 3),)
    assert found.accuracy == 2 / 5
    assert found.unmatched == 2 / 5
    assert (found.clusters, found.classes) == (2, 2)


def test_nothing_clustered_is_no_accuracy() -> None:
    found = metrics.clustering([1, 2], [-1, -1])
    assert (found.accuracy, found.accuracy_of_all, found.dropped, found.matches) == (
        0.0,
        0.0,
        1.0,
        (),
    )


@given(st.lists(st.integers(1, 4), min_size=1, max_size=40), st.permutations([5, 6, 7, 8]))
def test_names_of_clusters_do_not_matter(truth: list[int], names: list[int]) -> None:
    assert metrics.clustering(truth, [names[label - 1] for label in truth]).accuracy == 1.0


@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.integers(1, 3), st.integers(0, 5)), min_size=1, max_size=40
    )
)
def test_oscr_is_bounded_by_auroc_and_by_closed_accuracy(
    samples: list[tuple[int, int, int]],
) -> None:
    truth, closed, scores = (
        np.array(column) for column in zip(*samples, (0, 1, 3), (1, 1, 2), strict=True)
    )
    area = metrics.oscr(truth, closed, scores)
    assert (
        -1e-12
        <= area
        <= min(metrics.auroc(truth, scores), np.mean(closed[truth > 0] == truth[truth > 0])) + 1e-12
    )
