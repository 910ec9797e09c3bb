"""Principal axes along which samples are clustered."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.cluster import KMeans

from recognition.trfe.inputs.samples import PrincipalAxes, Prototypes
from studies.recognition import metrics
from tests.recognition.clouds import clouds

KNOWN, NEW = [1, 2, 3], [11, 12, 13, 14]


def test_new_classes_are_apart_in_few_directions() -> None:
    samples, truth = clouds(NEW, 60, seed=1)
    axes = PrincipalAxes.fit([Prototypes.fit(*clouds(KNOWN, 100, seed=0))], [samples], 4)
    found = axes.project([samples])
    assert found.shape == (240, 4)
    assert found.std(axis=0).mean() == pytest.approx(1.0, rel=1e-3)
    assert (
        metrics.clustering(truth, KMeans(4, n_init=5, random_state=0).fit_predict(found)).accuracy
        > 0.95
    )


def test_what_varies_within_known_classes_counts_little() -> None:
    """The first feature varies a hundred times as much as the others, in all classes."""
    widened = [
        (samples * np.r_[100.0, np.ones(15)], truth)
        for samples, truth in (clouds(KNOWN, 100, 0), clouds(NEW, 60, 1))
    ]
    (known, labels), (samples, truth) = widened
    samples[:, 0] = 100.0 * np.random.default_rng(2).standard_normal(len(samples))
    found = PrincipalAxes.fit([Prototypes.fit(known, labels)], [samples], 4).project([samples])
    assert (
        metrics.clustering(truth, KMeans(4, n_init=5, random_state=0).fit_predict(found)).accuracy
        > 0.9
    )


def test_new_classes_that_fine_tuning_mixes_are_told_apart_by_what_was_before() -> None:
    """After it, each new sample lies on one of the known classes, whichever."""
    (known, labels), (samples, truth) = clouds(KNOWN, 100, seed=0), clouds(NEW, 60, seed=1)
    tuned, onto = (
        clouds(KNOWN, 100, seed=2, apart=20.0)[0],
        clouds(KNOWN, 80, seed=3, apart=20.0)[0],
    )
    around, parts = [Prototypes.fit(part, labels) for part in (known, tuned)], [samples, onto]
    found = (
        PrincipalAxes.fit(around, parts, 4).project(parts),
        PrincipalAxes.fit(around[1:], parts[1:], 4).project(parts[1:]),
    )
    clusters = [KMeans(4, n_init=5, random_state=0).fit_predict(samples) for samples in found]
    assert metrics.clustering(truth, clusters[0]).accuracy > 0.9
    assert metrics.clustering(truth, clusters[1]).accuracy < 0.5


def test_directions_of_few_or_equal_samples_are_finite() -> None:
    prototypes = Prototypes.fit(*clouds(KNOWN, 50, seed=0))
    for samples in (np.zeros((5, 16), np.float32), clouds([11], 3, seed=1)[0]):
        assert np.isfinite(PrincipalAxes.fit([prototypes], [samples], 8).project([samples])).all()


def test_what_never_varies_in_known_classes_has_a_limit() -> None:
    """The first feature hardly varies in known classes, and as much as others in new ones."""
    (known, labels), (samples, _) = clouds(KNOWN, 100, seed=0), clouds(NEW, 60, seed=1)
    known[:, 0] = 1e-4 * np.random.default_rng(3).standard_normal(len(known))
    lengths = []
    for prototypes in (Prototypes.fit(known, labels, samples), Prototypes.fit(known, labels)):
        raised = samples + np.eye(16, dtype=np.float32)[0]
        lengths.append(
            np.linalg.norm(
                prototypes.standardise(raised) - prototypes.standardise(samples), axis=1
            ).mean()
        )
    assert lengths[0] < 10.0 < 1000.0 < lengths[1]
