"""Measures of the probabilistic risk field; `runner.measures.risk_field` has its formulas and their source."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.measures.measure import Extreme, RunMeasure, measure

if TYPE_CHECKING:
    from runner.measures.criticality import Criticality


@measure
class MaxCollisionProbability(RunMeasure):
    """Greatest probability of a collision with anyone within the next 3 s."""

    name = "max_collision_probability"
    label = "Greatest probability of a collision"
    formula = "probability that the boxes overlap within 3 s if accelerations are normally distributed"
    critical = "high"
    validity = "another participant is there"
    source = "see `runner.measures.risk_field`"

    def of(self, run: Criticality) -> Extreme | None:
        return run.risk_field[0] if run.risk_field else None


@measure
class MaxRiskField(RunMeasure):
    """Greatest strength of the risk field of anyone."""

    name = "max_risk_field"
    label = "Greatest strength of the risk field"
    unit = "kJ"
    formula = "collision probability × energy of the crash"
    critical = "high"
    validity = "another participant is there"
    source = "see `runner.measures.risk_field`"

    def of(self, run: Criticality) -> Extreme | None:
        return run.risk_field[1] if run.risk_field else None
