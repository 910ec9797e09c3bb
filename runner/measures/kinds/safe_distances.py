"""Measures of RSS's safe distances: the share of time in which they are violated, by parameter set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from runner.measures.measure import RunMeasure, register
from runner.measures.rss import PARAMETERS

if TYPE_CHECKING:
    from runner.measures.criticality import Criticality


class RssRisk(RunMeasure):
    """R_risk: share of the time in which the longitudinal and the lateral safe distance to anyone are violated.

    Args:
        parameters: name of a parameter set of `runner.measures.rss`.
    """

    critical = "high"
    validity = "another participant is there, before any collision"
    source = "Shalev-Shwartz, Shammah, Shashua (2017)"
    is_extreme = False

    def __init__(self, parameters: str) -> None:
        self.parameters = parameters
        self.name = f"rss_risk_{parameters.replace('-', '_')}"
        self.label = f"Share of time in violation of RSS ({parameters})"
        self.formula = f"share of time with gap < safe distance, along and across, set `{parameters}`"
        self.most = 1.0 if parameters == "ad-rss" else None

    def of(self, run: Criticality) -> float | None:
        return run.risk(self.parameters)

    def sentence(self, found: Mapping[str, Any] | float) -> str:
        return f"RSS distances are violated in {found:.1%} of the time"


for _name in PARAMETERS:
    register(RssRisk(_name))
