"""Clustering of new classes in one round: every method on the same samples, nothing screened and nothing dropped."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from recognition.study import kinds, metrics
from recognition.study.experiments.open_set import ONLY_TUNED
from recognition.study.protocol.trials import Trial
from recognition.study.strategies import average_linkage, given_count, keep_all
from recognition.trfe.discovery.buffer import Buffer
from recognition.trfe.discovery.discovery import discover
from recognition.trfe.steps import Steps
from xodr.array_types import IntArray

GIVEN_K, ALL_FEATURES, LINKAGE = "trfe-given-k", "all-features", "rfap-linkage"
OWN = {
    "trfe": "**TRFE**",
    GIVEN_K: "TRFE, given K",
    ALL_FEATURES: "TRFE, all features, given K",
    ONLY_TUNED: "TRFE, features after fine-tuning alone",
    LINKAGE: "RFAP + average linkage",
}
"""TRFE's own ways to cluster, by name, with the titles of their rows in the report."""
TITLES = {**OWN, **kinds.titles(kinds.CLUSTERING)}
"""Methods by name."""


def measure_clustering(name: str, trial: Trial) -> dict[str, Any]:
    """Cluster the new classes of a trial; the fields of `metrics.Clustering` and the number of samples.

    The samples are the first ones of new classes in the stream, as if screening had missed and mistaken none.
    """
    if name == ONLY_TUNED:
        trial = trial.only_tuned
    clusters = _own(name, trial) if name in OWN else kinds.kind(kinds.CLUSTERING, name).METHOD(trial.seed).cluster(trial.pool)
    new = trial.appearing
    return {**metrics.clustering(new.labels, clusters)._asdict(), "samples": len(new.rows)}


def _own(name: str, trial: Trial) -> IntArray:
    """Clusters of TRFE; given the number of new classes where k-means and STAE are given it too."""
    new, steps = trial.appearing, Steps(sift=keep_all)
    if name == LINKAGE:
        steps = replace(steps, cluster=average_linkage)
    elif name != "trfe":
        steps = replace(steps, cluster=partial(given_count, len(trial.round.new)))
    buffer = Buffer(len(new.rows))
    buffer.add(new.features, new.rows)
    config = replace(trial.config, pretrained=0 if name == ALL_FEATURES else trial.tuned)
    return discover(trial.model.known, buffer, config, steps).clusters
