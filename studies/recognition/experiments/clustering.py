"""Clustering of new classes in one round: every method on the same samples,
nothing screened and nothing dropped.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from recognition.trfe.config import Steps
from recognition.trfe.discovery.candidates import Buffer
from recognition.trfe.forest.known import discover
from schemas.common.array_types import IntArray
from studies.recognition import kinds, metrics
from studies.recognition.baselines.clustering.kmeans import KMeansFeatures
from studies.recognition.experiments.open_set import MAP_ONLY, ONLY_ENCODED, ONLY_TUNED, seen_by
from studies.recognition.protocol.trials import Trial
from studies.recognition.strategies import average_linkage, given_count, k_means

GIVEN_K, COUNTED, LINKAGE, K_MEANS = "trfe-given-k", "trfe-counted", "rfap-linkage", "trfe-k-means"
ENCODED_GIVEN_K, ALL_FEATURES = "encoded-given-k", "all-features"
OWN = {
    "trfe": "**TRFE**",
    GIVEN_K: "TRFE, given K",
    COUNTED: "TRFE, K of held-out classes",
    K_MEANS: "TRFE, k-means in place of heads",
    ONLY_ENCODED: "TRFE, encoders' features",
    ENCODED_GIVEN_K: "TRFE, encoders' features, given K",
    ALL_FEATURES: "TRFE, encoders' features with equal weights, given K",
    ONLY_TUNED: "TRFE, features after fine-tuning alone, given K",
    LINKAGE: "RFAP + average linkage, encoders' features",
}
"""TRFE's own ways to cluster, by name, with the titles of their rows in the report."""
_OF_ENCODERS = (ENCODED_GIVEN_K, ALL_FEATURES, LINKAGE)
"""Further methods, on the encoders' features alone."""
TITLES = {
    **OWN,
    MAP_ONLY: "map only, one frame: k-means, given K",
    **kinds.titles(kinds.CLUSTERING),
}
"""Methods by name."""


def measure_clustering(name: str, trial: Trial) -> dict[str, Any]:
    """Cluster the new classes of a trial; the fields of `metrics.Clustering` and
    the number of samples.

    The samples are the first ones of new classes in the stream, as if screening had missed and
    mistaken none.
    """
    trial = trial.only_encoded if name in _OF_ENCODERS else seen_by(name, trial)
    if name in OWN:
        clusters = _own(name, trial)
    else:
        method = KMeansFeatures if name == MAP_ONLY else kinds.kind(kinds.CLUSTERING, name).METHOD
        clusters = method(trial.seed).cluster(trial.pool)
    new = trial.appearing
    return {**metrics.clustering(new.labels, clusters)._asdict(), "samples": len(new.rows)}


def _own(name: str, trial: Trial) -> IntArray:
    """Clusters of TRFE; given the number of new classes where k-means and STAE are given it too."""
    new, steps = trial.appearing, Steps()
    if name == LINKAGE:
        steps = replace(steps, cluster=average_linkage)
    elif name == K_MEANS:
        steps = replace(steps, cluster=k_means)
    elif name not in ("trfe", ONLY_ENCODED):
        count = trial.pool.likely_classes if name == COUNTED else len(trial.round.new)
        steps = replace(steps, cluster=partial(given_count, count))
    buffer = Buffer(len(new.rows))
    buffer.add(new.features, new.rows)
    config = replace(trial.config, pretrained=0) if name == ALL_FEATURES else trial.config
    return discover(trial.known, buffer, config, steps).clusters
