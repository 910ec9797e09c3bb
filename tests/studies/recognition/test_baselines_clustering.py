"""Clustering methods: their similarities by hand, and all of them on classes that lie apart."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import torch

from schemas.common.array_types import IntArray
from studies.recognition import metrics
from studies.recognition.baselines.clustering.gaussian_mixture import Mixture
from studies.recognition.baselines.clustering.gaussian_mixture_counted import MixtureCounted
from studies.recognition.baselines.clustering.iterative_autonovel import IterativeAutoNovel
from studies.recognition.baselines.clustering.iterative_euclidean import IterativeEuclidean
from studies.recognition.baselines.clustering.kmeans import KMeansFeatures
from studies.recognition.baselines.clustering.kmeans_axes import KMeansAxes
from studies.recognition.baselines.clustering.kmeans_axes_counted import KMeansAxesCounted
from studies.recognition.baselines.clustering.pool import ClusteringMethod, Pool
from studies.recognition.baselines.clustering.random import ChanceClusters
from studies.recognition.baselines.clustering.semi_kmeans import SemiSupervised
from studies.recognition.baselines.clustering.semi_kmeans_counted import SemiSupervisedCounted
from studies.recognition.baselines.clustering.simgcd import SimGCD, distillation_loss
from studies.recognition.baselines.clustering.stae import CODE, Autoencoder
from studies.recognition.baselines.clustering.stae_kmeans import STAEKMeans
from studies.recognition.baselines.clustering.stae_linkage import STAELinkage
from studies.recognition.semi_supervised import likely_classes, semi_supervised
from tests.recognition.clouds import clouds

METHODS: list[type[ClusteringMethod]] = [
    KMeansFeatures, KMeansAxes, KMeansAxesCounted, Mixture, MixtureCounted, SemiSupervised,
    SemiSupervisedCounted, IterativeEuclidean, STAEKMeans, STAELinkage, SimGCD,
]  # fmt: skip


def drawn(truth: IntArray) -> np.ndarray:
    """Grids (n, 4, 2, 16, 20) in which a block drives along a lane that its class decides."""
    grids = np.zeros((len(truth), 4, 2, 16, 20), dtype=np.uint8)
    generator = np.random.default_rng(0)
    for window, label in zip(grids, truth.tolist(), strict=True):
        row, bright = 5 * (label % 3), generator.integers(150, 255)
        for frame in range(4):
            window[frame, 0, row : row + 2, 4 * frame : 4 * frame + 4] = bright
    return grids


@cache
def pool(each: int = 60) -> tuple[Pool, IntArray]:
    unknown, truth = clouds([6, 7, 8], each, seed=1, apart=8.0)
    return Pool(unknown, drawn(truth), *clouds([1, 2], each, seed=2, apart=8.0), classes=3), truth


@pytest.mark.parametrize("method", METHODS)
def test_classes_that_lie_apart_become_clusters(method: type[ClusteringMethod]) -> None:
    samples, truth = pool()
    assert metrics.clustering(truth, method(seed=0).cluster(samples)).accuracy > 0.8


@pytest.mark.parametrize(
    ("method", "each"),
    [
        (IterativeEuclidean, 30),
        (IterativeAutoNovel, 30),
        (STAEKMeans, 30),
        (ChanceClusters, 30),
        (SimGCD, 30),
    ],
)
def test_same_seed_gives_the_same_clusters(
    method: type[ClusteringMethod], each: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.recognition.baselines.clustering.stae._STEPS", 40)
    samples, _ = pool(each)
    assert np.array_equal(method(seed=3).cluster(samples), method(seed=3).cluster(samples))


def test_self_distillation_by_hand() -> None:
    even = torch.zeros(3, 2)
    assert distillation_loss(even, even, 0.04).item() == pytest.approx(
        math.log(2) - 2 * math.log(2)
    )
    one_class = torch.tensor([[1.0, -1.0], [1.0, -1.0]])
    assert distillation_loss(one_class, one_class, 0.04).item() == pytest.approx(0.0, abs=1e-6)
    both = torch.tensor(
        [[1.0, -1.0], [-1.0, 1.0]]
    )  # sure of each, and both classes are used: the least there is
    assert distillation_loss(both, both, 0.04).item() == pytest.approx(-2 * math.log(2), abs=1e-6)


def test_ranking_statistics_find_classes_with_strong_features_of_their_own() -> None:
    truth = np.repeat([6, 7, 8], 60)
    features = np.random.default_rng(0).standard_normal((180, 20)).astype(np.float32)
    for label, row in zip(truth.tolist(), features, strict=True):
        row[5 * (label - 6) : 5 * (label - 5)] += 12.0
    samples = Pool(features, drawn(truth), *clouds([1, 2], 60, seed=2, width=20), classes=3)
    assert metrics.clustering(truth, IterativeAutoNovel().cluster(samples)).accuracy > 0.8


def test_chance_is_near_one_in_three() -> None:
    samples, truth = pool()
    assert metrics.clustering(truth, ChanceClusters(seed=0).cluster(samples)).accuracy < 0.5


def test_euclidean_similarity_by_hand() -> None:
    found = IterativeEuclidean().similarity(np.array([[0.0], [1.0], [3.0]], dtype=np.float32))
    # squared distances 1, 9, 4, their median 4
    expected = [
        [1, math.exp(-1 / 4), math.exp(-9 / 4)],
        [math.exp(-1 / 4), 1, math.exp(-1)],
        [math.exp(-9 / 4), math.exp(-1), 1],
    ]
    assert found == pytest.approx(np.array(expected))


def test_ranking_statistics_count_how_many_of_the_five_strongest_are_shared() -> None:
    features = np.array(
        [[9, 8, 7, 6, 5, 0, 1], [5, 6, 7, -8, 9, 1, 0], [9, 8, 7, 6, 0, 5, 1]],
        dtype=np.float32,
    )
    expected = np.array([[1, 1, 0.8], [1, 1, 0.8], [0.8, 0.8, 1]])
    assert IterativeAutoNovel().similarity(features) == pytest.approx(expected)


def test_odd_grids_are_reconstructed_in_their_size() -> None:
    windows = torch.zeros(2, 3, 4, 13, 27)
    model = Autoencoder(3, (4, 13, 27))
    assert model.encoder(windows).shape == (2, CODE)
    assert model(windows).shape == windows.shape


def test_labelled_samples_keep_their_class_and_new_ones_get_clusters_of_their_own() -> None:
    unknown, truth = clouds([2, 6, 7], 60, seed=1, apart=8.0)
    known, labels = clouds([1, 2], 60, seed=2, apart=8.0)
    found = semi_supervised(unknown, known, labels, 2)
    assert (found[truth == 2] == 1).mean() > 0.95
    assert set(np.unique(found[truth != 2])) <= {2, 3}
    assert metrics.clustering(truth, found).accuracy > 0.95


@pytest.mark.parametrize("count", [2, 4])
def test_the_number_of_new_classes_is_estimated_on_held_out_known_ones(count: int) -> None:
    unknown, _ = clouds(list(range(6, 6 + count)), 60, seed=1, apart=8.0)
    assert likely_classes(unknown, *clouds([1, 2, 3], 60, seed=2, apart=8.0)) == count
