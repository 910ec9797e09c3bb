"""Clustering of new classes in one round: every method on the same samples, nothing screened and nothing dropped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from recognition import metrics
from recognition.baselines.iterative_autonovel import IterativeAutoNovel
from recognition.baselines.iterative_euclidean import IterativeEuclidean
from recognition.baselines.kmeans import ChanceClusters, KMeansFeatures
from recognition.baselines.pool import ClusteringMethod, Pool
from recognition.baselines.stae_kmeans import STAEKMeans
from recognition.baselines.stae_linkage import STAELinkage
from recognition.buffer import Buffer
from recognition.config import Config
from recognition.discovery import discover
from recognition.protocol.stage import Stage
from recognition.samples import Whole

POOL = 500
"""Samples to cluster, at most: as many as TRFE's buffer holds."""
OWN: dict[str, Config] = {"trfe": Config(sifted=False), "rfap-linkage": Config(sifted=False, clusterer="linkage")}
"""TRFE's own ways to cluster, by name."""
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
    new = stage.stream.only(np.isin(stage.stream.labels, stage.round.new)).only(slice(POOL))
    if name in OWN:
        buffer = Buffer(len(new.rows))
        buffer.add(new.features, new.rows)
        clusters: Whole = discover(stage.model.known, buffer, replace(OWN[name], seed=stage.seed)).clusters
    else:
        pool = Pool(new.features, stage.windows.grids[new.rows], *stage.labelled[:2], len(stage.round.new))
        clusters = OTHERS[name](seed=stage.seed).cluster(pool)
    return {**metrics.clustering(new.labels, clusters)._asdict(), "samples": len(new.rows)}
