"""Clustering of new classes in one round: every method on the same samples, nothing screened and nothing dropped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from recognition.study import metrics
from recognition.study.baselines.iterative_autonovel import IterativeAutoNovel
from recognition.study.baselines.iterative_euclidean import IterativeEuclidean
from recognition.study.baselines.kmeans import ChanceClusters, KMeansFeatures
from recognition.study.baselines.pool import ClusteringMethod
from recognition.study.baselines.stae_kmeans import STAEKMeans
from recognition.study.baselines.stae_linkage import STAELinkage
from recognition.study.experiments.openset import ONLY_TUNED
from recognition.study.protocol.stage import Stage
from recognition.trfe.config import Config
from recognition.trfe.discovery.buffer import Buffer
from recognition.trfe.discovery.discovery import discover
from xodr.array_types import IntArray

ALL_FEATURES = "all-features"
"""TRFE clustering in the features of before and after fine-tuning together."""
OWN: dict[str, Config] = {
    "trfe": Config(sifted=False),
    "trfe-given-k": Config(sifted=False, counted=False),
    ALL_FEATURES: Config(sifted=False, counted=False),
    ONLY_TUNED: Config(sifted=False, counted=False),
    "rfap-linkage": Config(sifted=False, clusterer="linkage"),
}
"""TRFE's own ways to cluster, by name."""
GIVEN = ("trfe-given-k", ALL_FEATURES, ONLY_TUNED)
"""Those of them that are told how many new classes there are, as k-means and STAE are."""
OTHERS: dict[str, type[ClusteringMethod]] = {
    "stae-kmeans": STAEKMeans,
    "stae-linkage": STAELinkage,
    "iterative-euclidean": IterativeEuclidean,
    "iterative-autonovel": IterativeAutoNovel,
    "kmeans": KMeansFeatures,
    "random": ChanceClusters,
}
"""Other clustering methods, by name."""


def measure_clustering(name: str, stage: Stage) -> dict[str, Any]:
    """Cluster the new classes of a stage; the fields of `metrics.Clustering` and the number of samples.

    The samples are the first ones of new classes in the stream, as if screening had missed and mistaken none.
    """
    if name == ONLY_TUNED:
        stage = stage.only_tuned
    new = stage.appearing
    if name in OWN:
        buffer = Buffer(len(new.rows))
        buffer.add(new.features, new.rows)
        config = replace(OWN[name], seed=stage.seed, pretrained=0 if name == ALL_FEATURES else stage.tuned)
        if name in GIVEN:
            given = replace(config.clustering, candidates=len(stage.round.new), start="k-means")
            config = replace(config, clustering=given)
        clusters: IntArray = discover(stage.model.known, buffer, config).clusters
    else:
        clusters = OTHERS[name](seed=stage.seed).cluster(stage.pool)
    return {**metrics.clustering(new.labels, clusters)._asdict(), "samples": len(new.rows)}
