"""Which failures a careful driver would have prevented: the reference drivers, and the bound of what braking can do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from generation.outcomes.outcomes import Outcomes
from xodr.array_types import BoolArray, FloatArray

CAREFUL = "r157-cc"
"""The careful and competent human driver of UN Regulation 157"""
JUDGES = (CAREFUL, "fsm")
"""A failure is preventable where one of these drivers survives the same case (METHOD.md §6)."""
FULL_BRAKING = "generation.outcomes.full_braking:FullBraking"
"""Full braking from the instant at which the manoeuvre begins: what this hits, no braking avoids"""
REFERENCES: Mapping[str, str] = {
    **{name: name for name in (*JUDGES, "aeb", "idm", "rss", "r157-reg")},
    "full braking": FULL_BRAKING,
}
"""Systems under test by the names that reports have for them: the columns of the matrix of reference drivers."""
Drivers = Callable[[FloatArray, str], Outcomes]
"""Outcomes of points (n, d), driven by the system under test of a name; `generation.outcomes.evaluator.Evaluator` is one."""


def survivors(theta: FloatArray, drivers: Drivers) -> BoolArray:
    """The points (n,) of (n, d) that one of the `JUDGES` survives; each is asked only where those before it have not."""
    found = np.zeros(len(theta), bool)
    for judge in JUDGES:
        left = np.flatnonzero(~found)
        if left.size:
            found[left] = drivers(theta[left], judge).survived
    return found


def matrix(theta: FloatArray, drivers: Drivers, names: Sequence[str] = tuple(REFERENCES)) -> dict[str, Outcomes]:
    """What comes of points (n, d) with each of the reference drivers, by their names in reports."""
    return {name: drivers(theta, REFERENCES[name]) for name in names}
