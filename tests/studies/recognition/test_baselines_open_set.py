"""Open-set methods: their formulas on numbers worked out by hand, and all of
them on classes that lie apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest
import torch
from torch.nn import functional

from recognition.trfe.inputs.samples import Features
from studies.recognition import metrics
from studies.recognition.baselines.open_set.arpl import ARPL, arpl_loss, reciprocal_distances
from studies.recognition.baselines.open_set.cac import CAC, cac_loss, cac_rejection
from studies.recognition.baselines.open_set.cpn import CPN, cpn_loss
from studies.recognition.baselines.open_set.energy import Energy, energy
from studies.recognition.baselines.open_set.knn import KNN
from studies.recognition.baselines.open_set.logistic import Logistic
from studies.recognition.baselines.open_set.mdenet import MDENet, contrastive_loss, sphere_loss
from studies.recognition.baselines.open_set.method import OpenSetMethod
from studies.recognition.baselines.open_set.mls import MLS, logit_outlyingness
from studies.recognition.baselines.open_set.random import Chance
from studies.recognition.baselines.open_set.vim import ViM, residual_axes
from studies.recognition.baselines.open_set.voting import VotingMethod
from studies.recognition.screenings.reading_b import WeibullVotes
from studies.recognition.screenings.vote_threshold import VoteThreshold
from tests.recognition.clouds import clouds

KNOWN = [1, 2, 5, 9]
CEVT, PlainThreshold = (
    partial(VotingMethod, screening=screening) for screening in (WeibullVotes, VoteThreshold)
)
METHODS: list[Callable[..., OpenSetMethod]] = [
    CAC,
    ARPL,
    CPN,
    MDENet,
    MLS,
    CEVT,
    PlainThreshold,
    KNN,
    Logistic,
    Energy,
    ViM,
]


def fit(method: Callable[..., OpenSetMethod]) -> OpenSetMethod:
    return method(seed=0).fit(*clouds(KNOWN, 60, seed=1), *clouds(KNOWN, 50, seed=2))


fitted = cache(fit)


def between(count: int) -> Features:
    """Samples about the middle of the known classes."""
    middle = clouds(KNOWN, 200, seed=3)[0].mean(axis=0)
    return (middle + np.random.default_rng(4).standard_normal((count, len(middle)))).astype(
        np.float32
    )


@pytest.mark.parametrize("method", METHODS)
def test_classes_that_lie_apart_are_told_apart(method: Callable[..., OpenSetMethod]) -> None:
    model = fitted(method)
    (known, labels), unknown = clouds(KNOWN, 50, seed=3), between(100)
    features, truth = (
        np.concatenate([known, unknown]),
        np.r_[labels, np.zeros(len(unknown), dtype=np.int64)],
    )
    found = metrics.open_set(
        truth, model.classify(features), model.score(features), model.predict(features)
    )
    assert found.closed_accuracy > 0.97
    assert found.auroc > 0.9
    assert found.false_rejection < 0.15


@pytest.mark.parametrize("method", [*METHODS, Chance])
def test_one_in_twenty_validation_samples_is_rejected(method: Callable[..., OpenSetMethod]) -> None:
    model = fitted(method)
    rejected = model.predict(clouds(KNOWN, 50, seed=2)[0]) == 0
    assert 0.0 <= rejected.mean() <= 0.055


@pytest.mark.parametrize("method", [*METHODS, Chance])
def test_same_seed_gives_the_same_scores(method: Callable[..., OpenSetMethod]) -> None:
    samples = clouds(KNOWN, 20, seed=4)[0]
    assert np.array_equal(fit(method).score(samples), fitted(method).score(samples))


def test_chance_detects_nothing() -> None:
    model = fitted(Chance)
    scores = model.score(clouds(KNOWN, 500, seed=5)[0])
    truth = np.arange(len(scores)) % 2
    assert metrics.auroc(truth, scores) == pytest.approx(0.5, abs=0.05)


def test_energy_by_hand() -> None:
    assert energy(torch.tensor([[0.0, math.log(3.0)]])).item() == pytest.approx(-math.log(1 + 3))


def test_what_the_principal_subspace_leaves_is_the_direction_that_hardly_varies() -> None:
    samples = torch.tensor([[3.0, 0.1], [-3.0, 0.1], [3.0, -0.1], [-3.0, -0.1]])
    assert residual_axes(samples).abs().flatten().tolist() == pytest.approx([0.0, 1.0], abs=1e-6)


def test_vim_scores_by_the_residual_and_the_energy() -> None:
    model = fitted(ViM)
    assert isinstance(model, ViM)
    samples = clouds(KNOWN, 20, seed=5)[0]
    inputs = model._standardise(samples)
    with torch.no_grad():
        logits = model.network(inputs)
        apart = (model.network.before_last(inputs) - model._origin) @ model._axes
    assert model.score(samples) == pytest.approx(
        (model._weight * apart.norm(dim=1) + energy(logits)).numpy(), rel=1e-5
    )
    assert model._weight > 0.0 and 1 < apart.shape[1] < model.training.hidden


def test_the_nearest_neighbours_decide_what_logistic_regression_rejects() -> None:
    samples = np.concatenate([clouds(KNOWN, 20, seed=5)[0], between(20)])
    linear, nearest = fitted(Logistic), fitted(KNN)
    assert np.array_equal(linear.score(samples), nearest.score(samples))
    assert not np.array_equal(linear.classify(between(200)), nearest.classify(between(200)))


def test_anchor_loss_by_hand() -> None:
    distances = torch.tensor([[1.0, 3.0, 4.0]])
    expected = math.log(1 + math.exp(1 - 3) + math.exp(1 - 4)) + 0.1 * 1
    assert cac_loss(distances, torch.tensor([0])).item() == pytest.approx(expected)


def test_anchor_rejection_by_hand() -> None:
    total = math.exp(-1) + math.exp(-2)
    expected = [1 * (1 - math.exp(-1) / total), 2 * (1 - math.exp(-2) / total)]
    assert cac_rejection(torch.tensor([[1.0, 2.0]]))[0].tolist() == pytest.approx(expected)


def test_reciprocal_distances_and_loss_by_hand() -> None:
    embedding, points = torch.tensor([[1.0, 2.0]]), torch.tensor([[0.0, 0.0], [3.0, 2.0]])
    logits, euclidean = reciprocal_distances(embedding, points)
    assert euclidean[0].tolist() == pytest.approx([5 / 2, 4 / 2])
    assert logits[0].tolist() == pytest.approx([2.5 - 0.0, 2.0 - 7.0])
    loss = arpl_loss(embedding, points, torch.tensor(0.5), torch.tensor([0]))
    assert loss.item() == pytest.approx(math.log(1 + math.exp(-7.5)) + 0.1 * (2.5 - 0.5), abs=1e-6)


def test_samples_inside_the_margin_cost_nothing() -> None:
    embedding, points = torch.tensor([[1.0, 2.0]]), torch.tensor([[0.0, 0.0], [3.0, 2.0]])
    wide, wider = (
        arpl_loss(embedding, points, torch.tensor(radius), torch.tensor([0]))
        for radius in (3.0, 9.0)
    )
    assert wide == wider


def test_prototype_loss_by_hand() -> None:
    expected = -math.log(math.exp(-1) / (math.exp(-1) + math.exp(-4))) + 0.01 * 1
    assert cpn_loss(torch.tensor([[1.0, 4.0]]), torch.tensor([0])).item() == pytest.approx(expected)


def test_contrastive_loss_by_hand() -> None:
    embedding = functional.normalize(torch.tensor([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    expected = -math.log(
        math.exp(10) / (math.exp(10) + 1)
    )  # the third has no other of its class and is left out
    assert contrastive_loss(embedding, torch.tensor([0, 0, 1])).item() == pytest.approx(
        expected, abs=1e-6
    )


def test_sphere_loss_by_hand() -> None:
    centres = torch.tensor([[0.0, 0.0], [1.5, 0.0]])
    embedding = torch.tensor([[0.0, 3.0], [1.5, 0.5]])
    assert sphere_loss(embedding, centres, torch.tensor([0, 1])).item() == pytest.approx(
        (2.0 + 0.0) / 2 + 0.5
    )


def test_greatest_logit_by_hand() -> None:
    assert logit_outlyingness(torch.tensor([[0.5, 2.0], [-1.0, -3.0]])).tolist() == [-2.0, 1.0]
