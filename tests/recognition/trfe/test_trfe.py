"""TRFE as a whole, on made-up features: known classes recognised, planted ones set aside,
discovered and known from then on.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from recognition.trfe.config import Config, Steps
from recognition.trfe.discovery.candidates import Buffer, Clustering
from recognition.trfe.forest.known import DELTAS, FIRST_DISCOVERED, SET_ASIDE, Discovery, discover
from recognition.trfe.forest.screening import EvtJoint
from recognition.trfe.inputs.samples import BACKGROUND, UNKNOWN, Features
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import IntArray
from schemas.common.errors import UsageError
from studies.recognition.ablations import VARIANTS
from tests.recognition.clouds import clouds

KNOWN, NEW = [1, 2, 3, 4], [11, 12, 13]
APART = 6.0
CONFIG = Config(trees=80, delta=0.05, clustering=Clustering(epochs=60, ramp=30))


def model() -> TRFE:
    """A model of its own of the known classes."""
    return deepcopy(fitted())


@cache
def fitted(config: Config = CONFIG, steps: Steps | None = None, kind: type[TRFE] = TRFE) -> TRFE:
    return kind(config, steps=steps).fit(
        *clouds(KNOWN, 150, seed=0, apart=APART), *clouds(KNOWN, 100, seed=1, apart=APART)
    )


def stream(seed: int = 2) -> tuple[Features, IntArray]:
    return clouds(KNOWN + NEW, 70, seed=seed, apart=APART)


class Round(NamedTuple):
    """A model that has discovered among a stream and expanded, what it
    discovered, and the stream's true labels.
    """

    model: TRFE
    discovery: Discovery
    truth: IntArray


@pytest.fixture(scope="module")
def round_() -> Round:
    after = model()
    samples, truth = stream()
    after.observe(samples, np.arange(len(truth)))
    discovery = after.discover()
    after.expand(discovery)
    return Round(after, discovery, truth)


def test_known_classes_are_recognised_and_new_ones_rejected() -> None:
    samples, truth = stream()
    found, known = model().recognise(samples), np.isin(truth, KNOWN)
    assert np.mean(found.labels[~known] == 0) > 0.95
    assert np.mean(found.labels[known] == 0) < 0.1
    assert np.mean(found.closed[known] == truth[known]) > 0.98
    assert ((found.confidence > 0.0) & (found.confidence <= 1.0)).all()
    assert found.score[~known].min() > np.median(found.score[known])


def test_classes_that_need_more_of_the_votes_are_taken_for_nothing() -> None:
    samples, _ = stream()
    strict = model()
    before = strict.recognise(samples)
    others = [label for label in KNOWN if label != 2]
    strict.least = {2: 1.1, **dict.fromkeys(others, 0.0)}
    found = strict.recognise(samples)
    assert ((found.share > 0.0) & (found.share <= 1.0)).all()
    by_chance = (before.confidence < 1.0 / len(KNOWN)) & (before.labels != UNKNOWN)
    assert (
        np.array_equal(found.labels == BACKGROUND, (before.labels == 2) | by_chance)
        and (before.labels == 2).any()
    )
    assert np.array_equal(
        found.labels[found.labels != BACKGROUND], before.labels[found.labels != BACKGROUND]
    )
    assert np.array_equal(found.closed, before.closed)


def test_classes_without_development_data_need_the_median_share() -> None:
    lax = model()
    assert [lax.least_share(label) for label in (BACKGROUND, UNKNOWN, *KNOWN, 101)] == [0.0] * (
        3 + len(KNOWN)
    )
    first, second, *rest = KNOWN
    lax.least = {first: 0.4, second: 0.6}
    assert [lax.least_share(label) for label in (first, second)] == [0.4, 0.6]
    assert all(lax.least_share(label) == 0.5 for label in rest) and rest
    assert lax.least_share(101) == lax.least_share(UNKNOWN) == 0.0


def test_unknown_samples_wait_in_the_buffer_under_their_keys() -> None:
    watching = model()
    samples, truth = stream()
    found = watching.observe(samples, 1000 + np.arange(len(truth)))
    assert watching.buffer.keys.tolist() == (1000 + np.flatnonzero(found.labels == 0)).tolist()
    assert np.array_equal(watching.buffer.inputs, samples[found.labels == 0])


@pytest.mark.slow
def test_planted_classes_are_discovered(round_: Round) -> None:
    discovery, truth = round_.discovery, round_.truth[round_.discovery.keys]
    promoted = [one for one in discovery.candidates if one.promoted]
    assert len(promoted) == len(NEW)
    assert sorted(set(discovery.labels[discovery.labels > 0].tolist())) == [
        FIRST_DISCOVERED + place for place in range(3)
    ]
    for one in promoted:
        values, counts = np.unique(truth[one.members], return_counts=True)
        assert values[counts.argmax()] in NEW
        assert counts.max() > 0.85 * counts.sum()
    assert np.mean(discovery.labels[np.isin(truth, NEW)] > 0) > 0.85
    assert np.array_equal(discovery.clusters == SET_ASIDE, ~discovery.sifted.kept)


@pytest.mark.slow
def test_discovered_classes_are_known_from_then_on(round_: Round) -> None:
    samples, truth = stream(seed=3)
    found = round_.model.recognise(samples).labels
    assert round_.model.known.classes.tolist() == [*KNOWN, 101, 102, 103]
    known = np.isin(truth, KNOWN)
    assert np.mean(found[known] == truth[known]) > 0.85
    assert np.mean(found[~known] >= FIRST_DISCOVERED) > 0.8


@pytest.mark.slow
def test_promoted_samples_leave_the_buffer_and_the_rest_stays(round_: Round) -> None:
    left = round_.discovery.keys[round_.discovery.labels == 0]
    assert round_.model.buffer.keys.tolist() == left.tolist()


@pytest.mark.slow
def test_promoted_samples_are_either_fitted_on_or_calibrated_on(round_: Round) -> None:
    known = round_.model.known
    for label in (101, 102, 103):
        parts = [
            np.count_nonzero(part.labels == label) for part in (known.fitted, known.calibrating)
        ]
        assert sum(parts) == np.count_nonzero(round_.discovery.labels == label)
        assert parts[1] == pytest.approx(0.3 * sum(parts), abs=1)


@pytest.mark.slow
def test_discovery_changes_nothing_and_a_seed_decides_it(round_: Round) -> None:
    again = model()
    samples, truth = stream()
    again.observe(samples, np.arange(len(truth)))
    first, second = again.discover(), again.discover()
    for discovery in (first, second):
        assert np.array_equal(discovery.clusters, round_.discovery.clusters)
        assert np.array_equal(discovery.labels, round_.discovery.labels)
        assert discovery.reference == round_.discovery.reference
    assert again.known.classes.tolist() == KNOWN


@pytest.mark.slow
def test_nothing_is_expanded_where_nothing_is_promoted(round_: Round) -> None:
    still = fitted(replace(CONFIG, promotion=replace(CONFIG.promotion, least_samples=1000)))
    still.observe(*stream())
    known = still.known
    discovery = still.discover()
    still.expand(discovery)
    assert (discovery.candidates, still.known) == ([], known)


def with_changes(labels: list[int], each: int, seed: int) -> tuple[Features, IntArray]:
    """Samples of which new classes differ in the first eight features alone, and look like the
    first known one in the others.
    """
    samples, truth = clouds(labels, each, seed, apart=APART)
    moved = clouds(labels, each, seed, APART, 8)[0]
    known = np.isin(truth, KNOWN)[:, None]
    still = np.random.default_rng(seed).standard_normal((len(truth), 8)).astype(np.float32)
    alike = clouds(KNOWN[:1], len(truth), seed, apart=APART)[0]
    return np.concatenate(
        [np.where(known, still, moved), np.where(known, samples, alike)], axis=1
    ), truth


@pytest.mark.slow
def test_classes_that_only_changes_tell_apart_are_unknown_and_discovered() -> None:
    settings, training = (
        replace(CONFIG, changes=8),
        (*with_changes(KNOWN, 100, 0), *with_changes(KNOWN, 80, 1)),
    )
    watching, blind = (
        TRFE(replace(settings, recognise_by_changes=seeing)).fit(*training)
        for seeing in (True, False)
    )
    samples, truth = with_changes(KNOWN + NEW, 70, 2)
    found, known = watching.observe(samples, np.arange(len(truth))), np.isin(truth, KNOWN)
    assert np.mean(blind.recognise(samples).labels[~known] == KNOWN[0]) > 0.8
    assert (
        np.mean(found.labels[~known] == 0) > 0.95
        and np.mean(found.closed[known] == truth[known]) > 0.98
    )
    discovery = watching.discover()
    assert len(np.unique(discovery.labels[discovery.labels > 0])) == len(NEW)
    watching.expand(discovery)
    again, _ = with_changes(NEW, 20, 3)
    assert watching.recognise(again).features.shape == again.shape


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["reading-b", "vote-threshold", "no-ucs", "no-oc", "k-means", "nvp", "cosine"]
)
def test_variants_discover_too(name: str) -> None:
    variant = VARIANTS[name]
    varied = fitted(
        replace(CONFIG, preprocessing=variant.config.preprocessing), variant.steps, variant.model
    )
    samples, truth = stream()
    found = varied.observe(samples, np.arange(len(truth)))
    assert np.mean(found.labels[np.isin(truth, NEW)] == 0) > 0.9
    promoted = varied.discover().labels > 0
    assert np.isin(truth[varied.buffer.keys[promoted]], NEW).mean() > 0.85
    assert promoted.sum() > 100


@pytest.mark.slow
def test_delta_is_chosen_where_classes_allow_it() -> None:
    chosen = fitted(replace(CONFIG, delta=None, trees=20)).known.screening
    assert isinstance(chosen, EvtJoint) and any(
        chosen.delta == pytest.approx(each) for each in DELTAS
    )
    few = TRFE(replace(CONFIG, delta=None, trees=20)).fit(
        *clouds([1, 2], 50, seed=0), *clouds([1, 2], 50, seed=1)
    )
    assert few.known.screening.threshold == 0.95, "of two classes none can be left out"


@pytest.mark.slow
def test_delta_stays_when_classes_are_added() -> None:
    growing = fitted(replace(CONFIG, delta=None, trees=20))
    before = growing.known.screening
    samples, truth = stream()
    growing.observe(samples, np.arange(len(truth)))
    growing.expand(growing.discover())
    after = growing.known.screening
    assert len(growing.known.classes) > len(KNOWN)
    assert after is not before
    assert after.threshold == before.threshold


@pytest.mark.slow
def test_a_class_is_found_among_samples_of_none() -> None:
    """Two clusters are likeliest there, and hold everything."""
    fitted = TRFE(CONFIG).fit(
        *clouds(KNOWN, 60, seed=0, apart=APART), *clouds(KNOWN, 60, seed=1, apart=APART)
    )
    stray = 12.0 * np.random.default_rng(0).standard_normal((150, 16)).astype(np.float32)
    samples = np.concatenate([clouds([9], 60, seed=2, apart=2.0 * APART)[0], stray])
    buffer = Buffer(len(samples))
    buffer.add(samples, np.arange(len(samples)))
    found = discover(fitted.known, buffer, CONFIG, Steps())
    (label,) = set(found.labels[:60].tolist())
    assert label >= FIRST_DISCOVERED
    assert np.mean(found.labels[60:] == label) < 0.3


def nan(samples: Features) -> Features:
    samples[3, 0] = np.nan
    return samples


def test_bad_input_is_refused() -> None:
    features, labels = clouds([1, 2, 3], 30, seed=0)
    with pytest.raises(UsageError, match="has not been fitted yet"):
        TRFE().recognise(features)
    with pytest.raises(UsageError, match="sample 3 are not finite"):
        TRFE(CONFIG).fit(nan(features.copy()), labels, features, labels)
    with pytest.raises(UsageError, match="1 known classes are too few"):
        TRFE(CONFIG).fit(features, np.ones_like(labels), features, np.ones_like(labels))
    with pytest.raises(UsageError, match="must be of the same classes"):
        TRFE(CONFIG).fit(features, labels, features[labels < 3], labels[labels < 3])
    fitted = TRFE(CONFIG).fit(features, labels, features, labels)
    with pytest.raises(UsageError, match="takes features, not windows"):
        fitted.recognise(np.zeros((2, 4, 4, 40, 100), np.uint8))
    with pytest.raises(UsageError, match="15 dimensions, the model was fitted on 16"):
        fitted.recognise(features[:, 1:])
    with pytest.raises(UsageError, match="the buffer is empty"):
        fitted.discover()
    fitted.buffer.add(features[:5], np.arange(5))
    with pytest.raises(UsageError, match="5 buffered samples have no 10 neighbours each"):
        fitted.discover()
