"""Deviation of the seven parameters' motion from its recording (METHOD §3)."""

from __future__ import annotations

import numpy as np

from recognition.labels.maneuvers.parameters import CUT_IN, CUT_OUT, KINDS, LANE_CHANGE, PARAMETERS
from recognition.labels.maneuvers.units import Samples
from schemas.common.array_types import FloatArray
from studies.recognition.report.tables import Table

_COLUMNS = ("RMSE_t [m]", "95 %", "RMSE_s [m]", "95 %")
_NOTE = (
    "Root mean square of each recorded manoeuvre's distance from the motion that its seven "
    "parameters stand for, at 1 Hz "
    "through its scene, both at one place when it begins; mean over manoeuvres, and the value "
    "that 95 % keep below."
)
_PUBLISHED = (
    "The same for every method that has these parameters. Published: RMSE_t 0.237 m, RMSE_s 3.362 "
    "m, on other data."
)
_LOW, _HIGH = (
    np.array([getattr(each, side) for each in PARAMETERS.values()]) for side in ("low", "high")
)


def overall(errors: FloatArray | None) -> Table:
    """The table of a report.

    Args:
        errors: root mean squares (n, 2), m, of each unit, across and along the lane; None where
            they are not known.
    """
    rows = [] if errors is None else [(str(len(errors)), *_figures(errors))]
    title = "Reconstruction from the parameters"
    return Table("reconstruction", title, f"{_NOTE} {_PUBLISHED}", ("manoeuvres", *_COLUMNS), rows)


def by_kind(samples: Samples, title: str) -> Table:
    """A row for each kind of units, for all that go sideways, and for all; `inside` counts those
    within the limits of Table 1."""
    rows: list[tuple[str, ...]] = []
    groups = [
        *((kind, (kind,)) for kind in KINDS),
        ("all sideways", (LANE_CHANGE, CUT_IN, CUT_OUT)),
        ("all", tuple(KINDS)),
    ]
    for name, kinds in groups:
        chosen = samples.of_kind(*kinds)
        if len(chosen.theta):
            inside = len(chosen.within(_LOW, _HIGH).theta)
            rows.append((name, str(len(chosen.theta)), str(inside), *_figures(chosen.errors)))
    return Table("reconstruction", title, _NOTE, ("kind", "units", "inside", *_COLUMNS), rows)


def _figures(errors: FloatArray) -> list[str]:
    """Mean and 95th percentile of both columns, as text."""
    columns = np.stack([errors.mean(axis=0), np.percentile(errors, 95, axis=0)], axis=1)
    return [f"{figure:.3f}" for figure in columns.ravel()]
