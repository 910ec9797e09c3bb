"""Unknown screening: the formulas by hand, and what the readings do with unknown classes."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import genpareto, weibull_min
from sklearn.ensemble import RandomForestClassifier

from recognition.trfe.config import Config, Steps
from recognition.trfe.forest import VotingForest, forest, grow
from recognition.trfe.forest.known import Labelled, choose_delta, learn
from recognition.trfe.forest.screening import EvtJoint, Screening, tail
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from schemas.common.errors import UsageError
from studies.recognition.recalibrated import Recalibrated
from studies.recognition.screenings.pooled import EvtPooled
from studies.recognition.screenings.reading_a import EvtDeficit
from studies.recognition.screenings.reading_b import WeibullVotes, weibull
from studies.recognition.screenings.vote_threshold import VoteThreshold
from studies.recognition.strategies import grow_plain
from tests.recognition.clouds import clouds

READINGS = [EvtDeficit, WeibullVotes, VoteThreshold]
KNOWN, NEW = [1, 2, 3, 4], [7, 8]
APART = 8.0


class Cast(NamedTuple):
    """Votes of samples to calibrate, their labels, votes of samples to judge, their labels."""

    table: IntArray
    labels: IntArray
    judged: IntArray
    truth: IntArray


@pytest.fixture(scope="module")
def grown() -> RandomForestClassifier:
    return forest(*clouds(KNOWN, 150, seed=0, apart=APART), trees=100)


@pytest.fixture(scope="module")
def cast(grown: RandomForestClassifier) -> Cast:
    calibrating, labels = clouds(KNOWN, 150, seed=1, apart=APART)
    judged, truth = clouds(KNOWN + NEW, 150, seed=2, apart=APART)
    return Cast(grown.votes(calibrating), labels, grown.votes(judged), truth)


def two_classes(of_first: list[int], trees: int) -> tuple[IntArray, IntArray]:
    """Votes of samples of class 1 with so many votes for it each, and as many
    samples of class 2 the other way round.
    """
    own = np.array(of_first)
    table = np.stack([own, trees - own], axis=1)
    return np.concatenate([table, table[:, ::-1]]), np.repeat([1, 2], len(own))


def test_similarity_is_the_share_of_samples_with_as_great_a_deficit() -> None:
    """Deficits of 0, 1, …, 9 plus less than 1 each: one that lacks 6 votes, 6.5
    with mean jitter, is beaten by 3 or 4.
    """
    table, labels = two_classes(list(range(20, 10, -1)), trees=20)
    screening = EvtDeficit().fit(table, labels)
    found = screening.similarities(np.array([[14, 6], [20, 0]]))[:, 0]
    own = screening.deficits[:10]
    assert found.tolist() == [np.mean(own >= 6.5), np.mean(own >= 0.5)]
    assert found[0] in (0.3, 0.4)
    assert ((own >= np.arange(10)) & (own < np.arange(1, 11))).all()


def test_the_tail_is_generalised_pareto() -> None:
    screening = EvtDeficit()
    screening.classes, screening.trees = np.array([1]), 100
    screening.deficits, screening.starts = np.arange(11.0), np.array([0, 11])
    screening.limits, screening.shapes, screening.scales = (
        np.array([10.0]),
        np.array([0.5]),
        np.array([4.0]),
    )
    assert screening.similarities(np.array([[82]])) == pytest.approx(
        0.05 * (1 + 0.5 * 8.5 / 4.0) ** (-1 / 0.5)
    )
    screening.shapes[0] = 0.0
    assert screening.similarities(np.array([[82]])) == pytest.approx(0.05 * np.exp(-8.5 / 4.0))
    screening.shapes[0] = -0.5
    assert screening.similarities(np.array([[81]])) == 0.0, (
        "a tail with negative shape ends, here at 10 + 4 / 0.5"
    )


def test_few_excesses_have_an_exponential_tail_with_their_mean() -> None:
    assert tail(np.array([1.0, 2.0, 6.0])) == (0.0, 3.0)
    shape, scale = tail(genpareto.rvs(0.3, scale=2.0, size=4000, random_state=0))
    assert (shape, scale) == pytest.approx((0.3, 2.0), abs=0.15)


def test_weibull_has_the_greatest_likelihood() -> None:
    values = weibull_min.rvs(7.0, scale=40.0, size=500, random_state=0)
    shape, scale = weibull(values)
    reference, _, reference_scale = weibull_min.fit(values, floc=0.0)
    assert (shape, scale) == pytest.approx((reference, reference_scale), rel=1e-3)


def test_weibull_score_is_one_minus_its_distribution(cast: Cast) -> None:
    table, labels, *_ = cast
    screening = WeibullVotes().fit(table, labels)
    row = table[:1]
    column = row[0].argmax()
    expected = weibull_min.sf(
        row.max() + 0.5, screening.shapes[column], scale=screening.scales[column]
    )
    assert screening.score(row) == pytest.approx(expected)


def test_plain_threshold_gives_up_the_share_of_calibration_samples(cast: Cast) -> None:
    table, labels, *_ = cast
    screening = VoteThreshold(0.05).fit(table, labels)
    assert screening.score(np.array([[70, 10, 10, 10]])) == pytest.approx(0.3)
    assert 0.0 < np.mean(screening.predict(table) == 0) <= 0.05


@pytest.mark.parametrize("reading", READINGS)
def test_unknown_classes_are_rejected_and_known_ones_accepted(
    reading: type[Screening], cast: Cast
) -> None:
    table, labels, judged, truth = cast
    found = reading().fit(table, labels).predict(judged)
    known = np.isin(truth, KNOWN)
    assert np.mean(found[~known] == 0) > 0.9
    assert np.mean(found[known] == 0) < 0.11
    assert np.mean(found[known] == truth[known]) > 0.9


@pytest.mark.parametrize("reading", READINGS)
def test_fewer_votes_never_score_lower(reading: type[Screening]) -> None:
    """Of two classes with the same votes; the samples have a majority for the
    first, and ever fewer of its votes.
    """
    screening = reading().fit(*two_classes([100] * 20 + list(range(99, 59, -1)), trees=100))
    score = screening.score(np.array([[most, 100 - most] for most in range(100, 50, -1)]))
    assert (np.diff(score) >= -1e-12).all()
    assert score[0] < score[-1]


@pytest.mark.parametrize("reading", READINGS)
def test_perfect_votes_are_accepted_even_if_all_calibration_samples_have_them(
    reading: type[Screening],
) -> None:
    screening = reading().fit(*two_classes([100] * 60, trees=100))
    assert screening.predict(np.array([[100, 0], [0, 100], [50, 50]])).tolist() == [1, 2, 0]


@pytest.mark.parametrize("reading", READINGS)
def test_state_restores_a_screening(reading: type[Screening], cast: Cast) -> None:
    table, labels, judged, _ = cast
    fitted = reading().fit(table, labels)
    restored = reading().restore(fitted.state())
    assert restored.threshold == fitted.threshold
    assert np.array_equal(restored.score(judged), fitted.score(judged))


def test_scores_do_not_depend_on_what_is_scored_beside(cast: Cast) -> None:
    table, labels, judged, _ = cast
    screening = EvtDeficit().fit(table, labels)
    assert np.array_equal(screening.score(judged)[5:9], screening.score(judged[5:9]))


def test_the_pooled_reading_counts_votes_that_the_best_class_lacks() -> None:
    """Of 20 trees 0, 1, …, 9 do not vote for the true class; a sample that lacks
    four is beaten by 5 or 6 of 10.
    """
    strays = np.arange(10)
    table = np.stack([20 - strays, np.zeros(10, int)], axis=1)
    screening = EvtPooled().fit(
        np.concatenate([table, table[:, ::-1]]), np.repeat([1, 2], 10), trees=20
    )
    similar = screening.similarities(np.array([[16, 0], [4, 16], [20, 0]]))
    assert similar.shape == (3, 1)
    assert similar[0] == similar[1]
    assert similar[0, 0] in (0.5, 0.55, 0.6)
    assert similar[2, 0] > 0.9


def test_the_joint_reading_combines_the_significance_of_votes_and_distances() -> None:
    """Of 20 calibration samples ten lack a vote, and distances are 1, 2, …, 20."""
    table, distances = (
        np.stack([np.repeat([20, 19], 10), np.repeat([0, 1], 10)], axis=1),
        np.arange(1.0, 21.0),
    )
    table[10:] = table[10:, ::-1]
    screening = EvtJoint(seed=0).fit(table, np.repeat([1, 2], 10), trees=20, distances=distances)
    near = 0.5  # ten of twenty distances are 11 or more
    lacking = screening.similarities(np.array([[20, 0]]), np.array([11.0]))[0, 0]
    both = near * lacking
    assert near == screening.similarities(np.array([[20, 0]]), np.array([11.0]))[0, 1]
    assert screening.score(np.array([[20, 0]]), np.array([11.0]))[0] == pytest.approx(
        1.0 - both * (1.0 - np.log(both))
    )
    scores = screening.score(
        np.array([[20, 0], [20, 0], [4, 0], [4, 0]]), np.array([1.0, 40.0, 1.0, 40.0])
    )
    assert scores[0] < scores[1] <= scores[3]
    assert scores[0] < scores[2] <= scores[3] <= 1.0


def test_the_joint_reading_wants_distances() -> None:
    known = clouds([1, 2], 40, seed=0)
    with pytest.raises(UsageError, match="looks at distances"):
        learn(
            Labelled(*known), Labelled(*known), Config(trees=10, delta=0.05), Steps(grow=grow_plain)
        )


def test_a_background_shows_what_lies_beside_all_classes() -> None:
    """Classes 1 and 2 differ in the first feature; in 3, which is like 2 in it,
    the others go together otherwise.
    """
    random = np.random.default_rng(0)

    def draw(labels: list[int], each: int) -> tuple[Features, IntArray]:
        truth = np.repeat(labels, each)
        features = 0.3 * random.standard_normal((len(truth), 5))
        features[:, 1:3] += np.where(random.random((len(truth), 1)) < 0.5, -2.0, 2.0)
        features[:, 0] += np.where(truth == 1, -2.0, 2.0)
        features[truth == 3, 2] *= -1.0
        return features.astype(np.float32), truth

    fitting, calibrating, (judged, truth) = (
        draw([1, 2], 200),
        draw([1, 2], 200),
        draw([1, 2, 3], 100),
    )
    rejected = {}
    for background, neighbours in ((False, False), (True, False), (True, True)):
        grown = grow(*fitting, trees=60, background=background, neighbours=neighbours)
        screening = EvtPooled().fit(grown.vote(calibrating[0]).counts, calibrating[1], 60)
        found = screening.predict(grown.vote(judged).counts)
        rejected[background, neighbours] = np.mean(found[truth == 3] == 0)
        assert np.mean(found[truth != 3] == truth[truth != 3]) > 0.85
    assert rejected[False, False] < 0.2
    assert rejected[True, False] > 0.4
    assert rejected[True, True] > 0.9


def test_distances_show_what_lies_between_all_classes() -> None:
    """Trees that see features alone give a cloud apart from three others to one of these."""
    fitting, calibrating = clouds([1, 2, 3], 40, seed=0), clouds([1, 2, 3], 200, seed=1)
    rejected = {}
    for reading, neighbours in ((EvtPooled, False), (EvtJoint, True)):
        grown = grow(*fitting, trees=100, neighbours=neighbours)
        usual, beside = grown.vote(calibrating[0]), grown.vote(clouds([9], 100, seed=2)[0])
        screening = reading().fit(usual.counts, calibrating[1], 100, usual.distances)
        rejected[neighbours] = np.mean(screening.predict(*beside) == 0)
    assert rejected[False] < 0.8 < 0.95 < rejected[True]


choose = partial(choose_delta, grow=grow_plain, screening=EvtDeficit)


@pytest.mark.slow
def test_delta_is_chosen_by_leaving_classes_out() -> None:
    fitting, calibrating = (clouds([1, 2, 3, 4], 120, seed=seed, apart=2.0) for seed in (0, 1))
    delta = choose(*fitting, *calibrating, trees=40)
    assert delta == choose(*fitting, *calibrating, trees=40)
    assert 0.001 <= delta <= 0.2
    assert choose(*fitting, *calibrating, trees=40, deltas=[1e-12, delta, 1.0]) == delta, (
        "neither all nor nothing"
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_class_with_one_calibration_sample_calibrates_with_it(seed: int) -> None:
    features, labels = clouds([1, 2, 3, 4], 30, seed=1)
    kept = np.append(np.flatnonzero(labels != 4), np.flatnonzero(labels == 4)[:1])
    assert (
        choose(*clouds([1, 2, 3, 4], 40, seed=0), features[kept], labels[kept], trees=20, seed=seed)
        > 0.0
    )


def noisy(labels: list[int], each: int, seed: int, noise: float) -> tuple[Features, IntArray]:
    """Samples seen through a worse sensor."""
    features, truth = clouds(labels, each, seed, APART)
    return features + noise * np.random.default_rng(seed).standard_normal(features.shape).astype(
        np.float32
    ), truth


def recalibrated(window: int) -> tuple[VotingForest, Recalibrated]:
    calibrating, labels = clouds(KNOWN, 150, seed=1, apart=APART)
    forest = grow(*clouds(KNOWN, 150, seed=0, apart=APART), trees=100)
    votes = forest.vote(calibrating)
    return forest, Recalibrated(0.05, window=window).fit(votes.counts, labels, 100, votes.distances)


def test_recalibration_follows_a_shift() -> None:
    forest, following = recalibrated(100)
    drifted, truth = noisy(KNOWN + NEW, 150, 30, 0.8)
    known, votes = np.isin(truth, KNOWN), forest.vote(drifted)
    before = following.predict(*votes) == 0
    for step in range(8):
        following.recalibrate(*forest.vote(noisy(KNOWN, 50, 10 + step, 0.8 * (step + 1) / 8)[0]))
    after = following.predict(*votes) == 0
    assert before[known].mean() > 0.2
    assert after[known].mean() < 0.8 * before[known].mean()
    assert (
        after[~known].mean() - after[known].mean() > before[~known].mean() - before[known].mean()
    ), "a gain on the whole"


def test_recalibration_without_a_shift_changes_little() -> None:
    forest, screening = recalibrated(100)
    judged = forest.vote(clouds(KNOWN + NEW, 150, seed=2, apart=APART)[0])
    before = screening.predict(*judged)
    for step in range(20):
        screening.recalibrate(*forest.vote(noisy(KNOWN, 50, 10 + step, 0.0)[0]))
    assert np.mean(screening.predict(*judged) != before) < 0.03


@pytest.mark.parametrize(
    ("table", "labels", "message"),
    [
        ([[3, 1], [2, 2]], [1, 1], "2 classes are voted for, but calibration samples are of 1"),
        ([[3, 1], [2, 1]], [1, 2], "each row of the votes must add up"),
        (np.zeros((0, 2), int), [], "votes must be a table"),
    ],
)
def test_bad_calibration_is_refused(table, labels, message) -> None:
    with pytest.raises(UsageError, match=message):
        EvtDeficit().fit(np.array(table), np.array(labels))


def test_screening_has_to_be_fitted_and_to_get_its_classes(cast: Cast) -> None:
    with pytest.raises(UsageError, match="has to be fitted"):
        VoteThreshold().score(np.array([[1, 2]]))
    with pytest.raises(UsageError, match="not for 4 classes"):
        VoteThreshold().fit(*cast[:2]).score(np.array([[1, 2]]))


def test_two_classes_are_too_few_to_leave_one_out() -> None:
    with pytest.raises(UsageError, match="at least 3 are needed"):
        choose_delta(*clouds([1, 2], 20, seed=0), *clouds([1, 2], 20, seed=1))
