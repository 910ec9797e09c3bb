"""Measures of encounters: distance, post-encroachment time, relations to the lead, RSS's safe
distances, risk field; and jerk, by which the ego answers them.

The lead is the nearest participant ahead whose box overlaps the ego's laterally.
`runner.judging.measures.risk_field` has the formulas of the risk field and their source.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from runner.engine.motion.rss import PARAMETERS
from runner.judging.measures.measure import (
    ALWAYS,
    GREATEST_DECELERATION,
    LONGEST_PET,
    Extreme,
    RunMeasure,
    greatest,
    least,
    measure,
    register,
)

if TYPE_CHECKING:
    from runner.judging.measures.criticality import Criticality


def _led(run: Criticality) -> float:
    """Share of the ego's time with a lead; where the gap does not close, the measure has no value
    because nothing is critical."""
    return float((run.lead != "").mean()) if len(run.lead) else 0.0


@measure
class MinTimeToCollision(RunMeasure):
    """Least time to collision with the lead."""

    name = "min_ttc"
    label = "Least time to collision"
    unit = "s"
    formula = "least gap / closing speed"
    critical = "low"
    validity = "there is a lead and the gap closes; 0 where the boxes overlap"
    source = "Hayward (1972)"
    most = 10.0
    tag = "MinTimeToCollision"

    def defined(self, run: Criticality) -> float:
        return _led(run)

    def of(self, run: Criticality) -> Extreme | None:
        return least(run.ttc, run.lead, run.time)


@measure
class MinTimeHeadway(RunMeasure):
    """Least time headway to the lead."""

    name = "min_thw"
    label = "Least time headway"
    unit = "s"
    formula = "least gap / speed of the ego"
    critical = "low"
    validity = "there is a lead and the ego drives"
    source = "Mahmud et al. (2017)"
    most = 10.0
    tag = "MinTimeHeadway"

    def defined(self, run: Criticality) -> float:
        return _led(run)

    def of(self, run: Criticality) -> Extreme | None:
        return least(run.thw, run.lead, run.time)


@measure
class MaxDecelerationToAvoidCrash(RunMeasure):
    """Greatest deceleration rate to avoid a crash with the lead."""

    name = "max_drac"
    label = "Greatest deceleration to avoid a crash"
    unit = "m/s²"
    formula = "greatest closing speed² / (2 gap)"
    critical = "high"
    validity = "there is a lead and the gap closes"
    source = "Mahmud et al. (2017)"
    most = GREATEST_DECELERATION
    beyond = "unavoidable"
    tag = "MaxDecelerationToAvoidCrash"

    def defined(self, run: Criticality) -> float:
        return _led(run)

    def of(self, run: Criticality) -> Extreme | None:
        return greatest(run.drac, run.lead, run.time)


@measure
class MinDistance(RunMeasure):
    """Shortest distance of bounding boxes to any participant."""

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
class MaxJerk(RunMeasure):
    """Greatest jerk of the ego along its heading, of either sign."""

    name = "max_jerk"
    label = "Greatest jerk"
    unit = "m/s³"
    formula = "greatest |change of acceleration over 0.5 s| / 0.5 s"
    critical = "high"
    validity = ALWAYS
    source = "UN Regulation 79 (mean over 0.5 s)"
    is_extreme = False

    def of(self, run: Criticality) -> float | None:
        return float(abs(run.jerk).max()) if len(run.jerk) else None


@measure
class PostEncroachmentTime(RunMeasure):
    """Least post-encroachment time with any participant."""

    name = "pet"
    label = "Post-encroachment time"
    unit = "s"
    formula = "least time between one leaving a place and another reaching it"
    critical = "low"
    validity = f"footprints overlap within {LONGEST_PET:g} s"
    source = "Allen, Shin and Cooper (1978)"
    most = LONGEST_PET
    tag = "PostEncroachmentTime"

    def defined(self, run: Criticality) -> float:
        return 1.0 if run.pet is not None else 0.0

    def of(self, run: Criticality) -> Extreme | None:
        return run.pet


@measure
class MaxCollisionProbability(RunMeasure):
    """Greatest probability of a collision with any participant within the next 3 s."""

    name = "max_collision_probability"
    label = "Greatest probability of a collision"
    formula = (
        "probability that the boxes overlap within 3 s if accelerations are normally distributed"
    )
    critical = "high"
    validity = "another participant is there"
    greatest = 1.0
    source = "see `runner.judging.measures.risk_field`"

    def of(self, run: Criticality) -> Extreme | None:
        return run.risk_field[0] if run.risk_field else None


@measure
class MaxRiskField(RunMeasure):
    """Greatest strength of the risk field of any participant."""

    name = "max_risk_field"
    label = "Greatest strength of the risk field"
    unit = "kJ"
    formula = "collision probability × energy of the crash"
    critical = "high"
    validity = "another participant is there"
    source = "see `runner.judging.measures.risk_field`"

    def of(self, run: Criticality) -> Extreme | None:
        return run.risk_field[1] if run.risk_field else None


class RssRisk(RunMeasure):
    """R_risk: share of the time with the longitudinal and the lateral safe distance to a
    participant violated.

    Args:
        parameters: name of a parameter set of `runner.engine.motion.rss`.
    """

    critical = "high"
    validity = "another participant is there, before any collision"
    source = "Shalev-Shwartz, Shammah, Shashua (2017)"
    greatest = 1.0
    is_extreme = False

    def __init__(self, parameters: str) -> None:
        self.parameters = parameters
        self.name = f"rss_risk_{parameters.replace('-', '_')}"
        self.label = f"Share of time in violation of RSS ({parameters})"
        self.formula = (
            f"share of time with gap < safe distance, along and across, set `{parameters}`"
        )
        # One of the sets stands in reports: both there would say nearly the same twice.
        self.most = 1.0 if parameters == "ad-rss" else None

    def defined(self, run: Criticality) -> float:
        return float(run.active.mean()) if len(run.active) else 0.0

    def of(self, run: Criticality) -> float | None:
        return run.risk(self.parameters)

    def sentence(self, found: Mapping[str, Any] | float) -> str:
        return f"RSS distances are violated in {found:.1%} of the time"


for _name in PARAMETERS:
    register(RssRisk(_name))
