"""Search space of the ablation No-Maneuver: trajectories, judged with manoeuvres by both kinds of
parameters."""

from __future__ import annotations

import numpy as np

from generation.search.problem import Realism
from schemas.common.array_types import BoolArray, FloatArray
from studies.generation.comparison.measures import last_third
from studies.generation.comparison.study import Key, Study
from studies.generation.knots.motion import Nearest, knots_of, maneuvers_of
from studies.generation.methods import METHODS, TRAJECTORIES
from studies.recognition.report.tables import Table, spread

Figures = tuple[float, ...]

_NEAR = 0.99
"""Share of the recorded manoeuvres whose knots are as near to a manoeuvre as a trajectory must be
to count as one"""
_NOTE = (
    "The last third of each search, by both kinds of parameters: knots by those of the "
    "trajectory, seven by those of the "
    "manoeuvre that comes nearest to it. Each kind has a density of its own, of the same recorded "
    "manoeuvres, and its own limit "
    "of what is plausible: no less likely than 99 % of them. Log-likelihoods of the two are in "
    "different units: compare them "
    "within a column. Near a manoeuvre: share of the episodes that are as near to one, across and "
    "along the lane, as 99 % of the "
    "recorded manoeuvres are after their description by knots; the others are none, whatever the "
    "seven parameters say of them."
)
_HEADER = (
    "", "log-likelihood, knots", "plausible, knots", "plausible collisions, knots",
    "log-likelihood, seven", "plausible, seven", "plausible collisions, seven", "near a manoeuvre",
)  # fmt: skip


def table(study: Study) -> Table:
    """MCSG and the methods that search trajectories, by both kinds of parameters; no rows without
    such a method."""
    keys = [key for key in study.searches() if key.method == "mcsg" or key.method in TRAJECTORIES]
    rows: list[tuple[str, ...]] = []
    if any(key.method in TRAJECTORIES for key in keys):
        judge = _Judge(study)
        rows.append(_row("recorded, by their knots", [judge.recorded]))
        for name in dict.fromkeys(key.method for key in keys):
            rows.append(
                _row(
                    METHODS[name].title, [judge.figures(key) for key in keys if key.method == name]
                )
            )
    return Table("trajectories", "Trajectories and manoeuvres", _NOTE, _HEADER, rows)


class _Judge:
    """Describes episodes by both kinds of parameters.

    Attributes:
        recorded: figures of the recorded manoeuvres, described by knots and then by the nearest
            manoeuvres.
    """

    def __init__(self, study: Study) -> None:
        self._study, self._side = study, study.trajectories
        knots = self._side.problem.real
        nearest = maneuvers_of(knots, self._side.setting)
        self._limits = np.quantile([nearest.lateral, nearest.longitudinal], _NEAR, axis=1)
        self.recorded = self._figures(
            knots, nearest.theta, np.zeros(len(knots), bool), self._near(nearest)
        )

    def figures(self, key: Key) -> Figures:
        """Of the last third of a search."""
        setting = self._side.setting
        if key.method not in TRAJECTORIES:
            last = last_third(self._study.history(key))
            every = np.ones(len(last.theta), bool)
            return self._figures(
                knots_of(last.theta, setting), last.theta, last.outcomes.collision, every
            )
        last = last_third(self._study.knots(key))
        nearest = maneuvers_of(last.theta, setting)
        return self._figures(
            last.theta, nearest.theta, last.outcomes.collision, self._near(nearest)
        )

    def _near(self, nearest: Nearest) -> BoolArray:
        return (nearest.lateral <= self._limits[0]) & (nearest.longitudinal <= self._limits[1])

    def _figures(
        self, knots: FloatArray, theta: FloatArray, collision: BoolArray, near: BoolArray
    ) -> Figures:
        sides = (self._side.problem, knots), (self._study.problem, theta)
        found = [_likelihoods(problem.reward.realism, rows, collision) for problem, rows in sides]
        return (*found[0], *found[1], float(near.mean()))


def _likelihoods(realism: Realism, theta: FloatArray, collision: BoolArray) -> Figures:
    """Mean log-density, share of the plausible, and of the plausible collisions."""
    log_likelihood, plausible = realism.judged(theta)
    return (
        float(log_likelihood.mean()),
        float(plausible.mean()),
        float((plausible & collision).mean()),
    )


def _row(title: str, found: list[Figures]) -> tuple[str, ...]:
    return (
        title,
        *(
            spread(column, 1 if "log" in head else 3)
            for head, column in zip(_HEADER[1:], zip(*found, strict=True), strict=True)
        ),
    )
