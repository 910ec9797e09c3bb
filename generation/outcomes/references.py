"""Which failures a careful driver would have prevented: the reference drivers, and the bound of what braking can do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from generation.outcomes.outcomes import Outcomes, joined
from xodr.array_types import BoolArray, FloatArray

CAREFUL = "r157-cc"
"""The careful and competent human driver of UN Regulation 157"""
JUDGES = (CAREFUL, "fsm")
"""A failure is preventable where one of these drivers survives the same case (METHOD.md §6)."""
FULL_BRAKING = "generation.outcomes.full_braking:FullBraking"
"""Full braking from the instant at which the manoeuvre begins: what this hits, no braking from then on avoids"""
NEVER_BRAKED = "nobody changes speed or lane before the contact, so that full braking never begins"
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


class Matrix(NamedTuple):
    """What comes of points with each of the reference drivers, by their names in reports.

    Attributes:
        drivers: outcomes by name.
        agreed: verdicts of the judges, all the same on the twin, on which the others were played; 0 where all were run.
    """

    drivers: Mapping[str, Outcomes]
    agreed: int = 0


def matrix(theta: FloatArray, drivers: Drivers, twin: Drivers | None = None) -> Matrix:
    """The matrix of points (n, d). The judges are run; the others are played on the twin, if it agrees with all verdicts of the
    judges, and run otherwise.

    Args:
        twin: plays points with the system of a name; None for none.
    """
    judged = {name: drivers(theta, REFERENCES[name]) for name in JUDGES}
    others = {name: sut for name, sut in REFERENCES.items() if name not in JUDGES}
    if twin is None or not len(theta) or not all(_same(judged[name], twin(theta, REFERENCES[name])) for name in JUDGES):
        return Matrix(judged | {name: _driven(theta, sut, drivers) for name, sut in others.items()})
    return Matrix(judged | {name: _driven(theta, sut, twin) for name, sut in others.items()}, len(JUDGES) * len(theta))


def _driven(theta: FloatArray, sut: str, drivers: Drivers) -> Outcomes:
    """Outcomes of a driver; where full braking never begins, its collision says nothing of what braking can do, and counts as a
    run that failed: it is the same as that of what the scenario scripts alone."""
    found = drivers(theta, sut)
    rows = np.flatnonzero(found.executed & found.collision)
    if sut != FULL_BRAKING or not rows.size:
        return found
    hit, scripted = found.take(rows), drivers(theta[rows], "none")
    same = np.isclose(hit.conflict, scripted.conflict) & np.isclose(hit.impact_speed, scripted.impact_speed)
    never = np.zeros(len(theta), bool)
    never[rows] = scripted.executed & scripted.collision & same
    status, error = np.where(never, "error", found.status), np.where(never, NEVER_BRAKED, found.error)
    return replace(found, status=status, error=error, collision=found.collision & ~never)


def _same(one: Outcomes, other: Outcomes) -> bool:
    return bool(((one.collision == other.collision) & one.executed & other.executed).all())


def remembering(drivers: Drivers) -> Drivers:
    """The same drivers, which run no case twice with the same system."""
    known: dict[tuple[str, tuple[float, ...]], Outcomes] = {}

    def driving(theta: FloatArray, sut: str) -> Outcomes:
        keys = [(sut, tuple(row)) for row in theta.tolist()]
        missing = {key: row for row, key in enumerate(keys) if key not in known}
        if missing:
            found = drivers(theta[list(missing.values())], sut)
            known.update((key, found.take(np.array([place]))) for place, key in enumerate(missing))
        return joined([known[key] for key in keys]) if keys else Outcomes.of(0)

    return driving
