"""Measures of the ego and anyone else: shortest distance and post-encroachment time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.measures.measure import LONGEST_PET, Extreme, RunMeasure, least, measure

if TYPE_CHECKING:
    from runner.measures.criticality import Criticality


@measure
class MinDistance(RunMeasure):
    """Shortest distance of bounding boxes to anyone."""

    name = "min_distance"
    label = "Least distance"
    unit = "m"
    formula = "least distance of bounding boxes"
    critical = "low"
    validity = "another participant is there"
    source = "-"
    most = 100.0
    tag = "MinDistance"

    def of(self, run: Criticality) -> Extreme | None:
        return least(run.distance, run.nearest, run.time)


@measure
class PostEncroachmentTime(RunMeasure):
    """Least post-encroachment time with anyone."""

    name = "pet"
    label = "Post-encroachment time"
    unit = "s"
    formula = "least time between one leaving a place and another reaching it"
    critical = "low"
    validity = f"footprints overlap within {LONGEST_PET:g} s"
    source = "Allen, Shin and Cooper (1978)"
    most = LONGEST_PET
    tag = "PostEncroachmentTime"

    def of(self, run: Criticality) -> Extreme | None:
        return run.pet
