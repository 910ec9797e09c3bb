"""Measures of the ego and its lead: time to collision, time headway, deceleration to avoid a crash.

The lead is the nearest participant ahead whose box overlaps the ego's laterally.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.measures.measure import GREATEST_DECELERATION, Extreme, RunMeasure, greatest, least, measure

if TYPE_CHECKING:
    from runner.measures.criticality import Criticality


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

    def of(self, run: Criticality) -> Extreme | None:
        return greatest(run.drac, run.lead, run.time)
