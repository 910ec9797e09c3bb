"""Clustering of new classes in one round: every method on the same samples, nothing screened and nothing dropped."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from recognition.study import kinds, metrics
from recognition.study.experiments.open_set import ONLY_TUNED
from recognition.study.protocol.stage import Stage
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


def measure_clustering(name: str, stage: Stage) -> dict[str, Any]:
    """Cluster the new classes of a stage; the fields of `metrics.Clustering` and the number of samples.

    The samples are the first ones of new classes in the stream, as if screening had missed and mistaken none.
    """
    if name == ONLY_TUNED:
        stage = stage.only_tuned
    clusters = _own(name, stage) if name in OWN else kinds.kind(kinds.CLUSTERING, name).METHOD(stage.seed).cluster(stage.pool)
    new = stage.appearing
    return {**metrics.clustering(new.labels, clusters)._asdict(), "samples": len(new.rows)}


def _own(name: str, stage: Stage) -> IntArray:
    """Clusters of TRFE; given the number of new classes where k-means and STAE are given it too."""
    new, steps = stage.appearing, Steps(sift=keep_all)
    if name == LINKAGE:
        steps = replace(steps, cluster=average_linkage)
    elif name != "trfe":
        steps = replace(steps, cluster=partial(given_count, len(stage.round.new)))
    buffer = Buffer(len(new.rows))
    buffer.add(new.features, new.rows)
    config = replace(stage.config, pretrained=0 if name == ALL_FEATURES else stage.tuned)
    return discover(stage.model.known, buffer, config, steps).clusters
