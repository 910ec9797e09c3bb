"""Measures of exposure: the time in which the ego is close to its lead."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.judging.measures.measure import RunMeasure, measure

if TYPE_CHECKING:
    from runner.judging.measures.criticality import Criticality

SHORT = 1.5
"""Threshold of the time to collision, s"""


@measure
class AcmeTimeExposed(RunMeasure):
    """Time exposed to a time to collision below the threshold (TET)."""

    name = "acme_tet"
    label = "Time exposed to a short time to collision"
    unit = "s"
    formula = f"time with time to collision < {SHORT:g} s"
    critical = "high"
    validity = "another participant is there"  # ALWAYS for a measure of the ego alone
    source = "Minderhoud and Bovy (2001)"
    most = 10.0  # end of the axis in reports, which leave measures without it out
    is_extreme = False  # one number over the run, without an instant and another participant

    def of(self, run: Criticality) -> float:
        """Return the exposed time (s) of a run, from series with their validity."""
        short = run.ttc.valid & (run.ttc.value < SHORT)
        return float(run.time[1] - run.time[0]) * int(short.sum()) if len(run.time) > 1 else 0.0
