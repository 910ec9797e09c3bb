"""Online clustering: its losses by hand, and the clusters it finds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.discovery.clustering import (
    Clusters,
    NovelHead,
    Pairs,
    Projection,
    cluster,
    clustering_loss,
    consistency_weight,
    k_means_head,
    random_head,
    three_way_pairs,
)
from recognition.trfe.forest import forest, similarity
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import IntArray
from schemas.common.errors import UsageError
from studies.recognition import metrics
from studies.recognition.strategies import soft_pairs
from tests.recognition.clouds import clouds

QUICK = Clustering()


@pytest.mark.parametrize(
    ("epoch", "weight"),
    [(0, 3.0 * math.exp(-5.0)), (10, 3.0 * math.exp(-1.25)), (20, 3.0), (35, 3.0)],
)
def test_the_weight_of_consistency_ramps_up(epoch: int, weight: float) -> None:
    assert consistency_weight(epoch, Clustering(consistency=3.0, ramp=20)) == pytest.approx(weight)


def test_three_way_targets_leave_out_what_is_between() -> None:
    """Ten pairs of five samples: from the 85th percentile on alike, up to the median different."""
    values = np.arange(1, 11) / 10
    similar = np.eye(5, dtype=np.float32)
    similar[np.triu_indices(5, 1)] = values
    similar = np.maximum(similar, similar.T)
    pairs = three_way_pairs(similar, Clustering())
    upper = np.triu_indices(5, 1)
    assert pairs.targets[upper].tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 1, 1]
    assert pairs.counts[upper].tolist() == [1, 1, 1, 1, 1, 0, 0, 0, 1, 1]
    assert pairs.targets.diagonal().tolist() == [1] * 5


def test_soft_targets_are_the_similarity() -> None:
    similar = np.array([[1.0, 0.3], [0.3, 1.0]], np.float32)
    pairs = soft_pairs(similar)
    assert np.array_equal(pairs.targets, similar)
    assert pairs.counts.tolist() == [[1, 1], [1, 1]]


def test_clustering_loss_by_hand() -> None:
    p = torch.tensor([[0.9, 0.1], [0.2, 0.8]])
    other = torch.tensor([[0.7, 0.3], [0.4, 0.6]])
    g = [[0.66, 0.42], [0.38, 0.56]]
    w = [[1.0, 0.0], [0.25, 1.0]]
    terms = [
        [w[i][j] * math.log(g[i][j]) + (1 - w[i][j]) * math.log(1 - g[i][j]) for j in range(2)]
        for i in range(2)
    ]
    everything = clustering_loss(p, other, Pairs(torch.tensor(w), torch.ones(2, 2)))
    assert float(everything) == pytest.approx(-sum(map(sum, terms)) / 4, rel=1e-5)
    some = clustering_loss(p, other, Pairs(torch.tensor(w), torch.tensor([[1.0, 0.0], [0.0, 1.0]])))
    assert float(some) == pytest.approx(-(terms[0][0] + terms[1][1]) / 2, rel=1e-5)


def test_certain_assignments_have_finite_losses() -> None:
    certain = torch.tensor([[1.0, 0.0], [0.0, 1.0]])
    pairs = Pairs(torch.tensor([[0.0, 1.0], [1.0, 0.0]]), torch.ones(2, 2))
    assert math.isfinite(float(clustering_loss(certain, certain, pairs)))


def found(
    truth_seed: int, config: Clustering = QUICK, new: tuple[int, ...] = (7, 8, 9), seed: int = 0
) -> tuple[Clusters, IntArray]:
    """Clusters of three classes of 60 samples beside three known ones, with the
    similarity of the forest of those.
    """
    known, labels = clouds([1, 2, 3], 60, seed=1, apart=4.0)
    samples, truth = clouds(list(new), 60, seed=truth_seed, apart=4.0)
    grown, scale = forest(known, labels, 60), known.std()

    pairs = three_way_pairs(similarity(grown, samples), config)
    torch.manual_seed(0)
    inputs = samples / scale, known / scale, labels
    return cluster(
        Projection(16), *inputs, lambda _: pairs, every_candidate(config), config, seed
    ), truth


def every_candidate(config: Clustering) -> NovelHead:
    return lambda features, _: random_head(features, config.candidates)


def test_planted_classes_are_found_without_their_number() -> None:
    clusters, truth = found(2)
    assert metrics.clustering(truth, clusters.assignment).accuracy > 0.95
    assert clusters.confidence.min() > 1 / QUICK.candidates
    assert len(clusters.losses) == QUICK.epochs
    assert clusters.losses[-1, 1] < 0.5 * clusters.losses[0, 1], "L_clu falls"
    assert clusters.losses[-1, 0] < 0.2, "known classes are still told apart"


def test_a_seed_decides_the_clusters() -> None:
    first, again = (found(2, replace(QUICK, epochs=2))[0] for _ in range(2))
    assert all(np.array_equal(one, other) for one, other in zip(first, again, strict=True))
    other = found(2, replace(QUICK, epochs=2), seed=1)[0]
    assert not np.array_equal(first.losses, other.losses)


def test_pairs_are_asked_for_in_each_epoch_with_the_features_learnt_so_far() -> None:
    known, labels = clouds([1, 2], 20, seed=0)
    learnt: list[Features] = []

    def pairs(features: Callable[[], Features]) -> Pairs:
        learnt.append(features())
        return three_way_pairs(np.corrcoef(learnt[-1]).astype(np.float32), config)

    config = Clustering(epochs=3)
    cluster(Projection(16), known, known, labels, pairs, every_candidate(config), config)
    assert len(learnt) == 3
    assert not np.array_equal(learnt[0], learnt[-1]), "features change as the backbone learns"


def test_a_head_from_k_means_puts_samples_to_their_centres() -> None:
    samples, truth = clouds([1, 2, 3], 30, seed=0, apart=8.0)
    chosen = k_means_head(samples, 3, seed=0)(torch.from_numpy(samples)).argmax(dim=1).numpy()
    assert metrics.clustering(truth, chosen).accuracy == 1.0
    assert k_means_head(samples[:2], 3, seed=0).out_features == 3, "of too few samples a random one"


def test_a_projection_starts_as_the_identity() -> None:
    features = torch.randn(5, 8)
    assert torch.equal(Projection(8)(features), features)


def test_nothing_to_cluster_is_refused() -> None:
    known, labels = clouds([1, 2], 10, seed=0)
    with pytest.raises(UsageError, match="1 unknown and 20 known samples are too few"):
        cluster(
            Projection(16),
            known[:1],
            known,
            labels,
            lambda _: Pairs(torch.eye(1), torch.eye(1)),
            every_candidate(QUICK),
        )
