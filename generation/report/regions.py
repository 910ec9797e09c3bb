"""Regions of failure: groups of failing runs, each with a rule that a tester reads, its probability, severity and typical member.

A rule bounds at most three measures from one side each. It is fitted to the runs of the folder, which were sought near failures:
its precision and recall are shares of these runs. The probability of a region comes from unguided draws alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from generation.density.gate import NEAR, Share
from generation.density.roles import roles_of
from generation.pipeline import Generated
from generation.report.counterexamples import Measure, measures
from generation.search.space import distinctive
from schemas.common.array_types import BoolArray, FloatArray, IntArray

LINKED = 0.15
"""Distance in the unit cube, root mean square, up to which failures are of one region"""
_MOST, _GROUPED = 6, 2000
"""Regions that are listed, and failures that are grouped, evenly chosen where there are more"""
_BOUNDS, _EDGE = 3, 0.02
"""Bounds of a rule at most, and share of a region's members that each may leave out"""


class Bound(NamedTuple):
    """One side of a rule: values of a measure, by its index, at least or at most at a limit."""

    measure: int
    least: bool
    limit: float

    def holds(self, rows: FloatArray) -> BoolArray:
        """Rows (n, k) that keep it: (n,)."""
        values = rows[:, self.measure]
        return values >= self.limit if self.least else values <= self.limit


class FailureRegion(NamedTuple):
    """A region.

    Attributes:
        bounds: its rule. precision: share of the runs within the rule that are failures of the region.
        recall: share of its failures within the rule.
        failures: number of failing runs. drawn: unguided draws that fail within `NEAR` of one of them.
        severity: mean impact speed, m/s. cases: rows of the edge cases in it, the likelier first.
        typical, likeliest: rows of the executed runs: the failure nearest to the others, and that of the greatest density.
        survived: number of the edge cases that each reference driver survives.
    """

    bounds: Sequence[Bound]
    precision: float
    recall: float
    failures: int
    drawn: Share
    severity: float
    cases: Sequence[int]
    typical: int
    likeliest: int
    survived: Mapping[str, int]

    def rule(self, by: Sequence[Measure]) -> str:
        """The rule in words."""
        sides = (
            f"{by[each.measure].name} {'≥' if each.least else '≤'} {each.limit:.3g} {by[each.measure].unit}".strip()
            for each in self.bounds
        )
        return " and ".join(sides) or "no measure tells it from other runs"

    @property
    def edge_cases(self) -> int:
        """Number of foreseeable and preventable failures."""
        return len(self.cases)

    @property
    def importance(self) -> tuple[bool, float]:
        """Order: regions with edge cases first, then by probability times severity."""
        return self.edge_cases > 0, (self.drawn.collisions + 0.5) / (self.drawn.runs + 1.0) * (1.0 + self.severity)

    def as_json(self, by: Sequence[Measure], members: Mapping[str, Sequence[float]]) -> dict[str, Any]:
        """For files and the page; `members` has the values of the `typical` and of the `likeliest` member."""
        low, high = self.drawn.interval
        chance = self.drawn.collisions / self.drawn.runs if self.drawn.runs else None
        return {
            "rule": self.rule(by), "precision": round(self.precision, 3), "recall": round(self.recall, 3),
            "failures": self.failures, "draws": self.drawn.runs, "failing_draws": self.drawn.collisions, "probability": chance,
            "interval": [low, high], "severity": round(self.severity, 2), "edge_cases": self.edge_cases,
            "survived": dict(self.survived),
            **{
                name: {each.name: value for each, value in zip(by, values, strict=True)}
                for name, values in members.items()
            },
        }  # fmt: skip


def measured(generated: Generated, theta: FloatArray) -> list[Measure]:
    """Return the readable measures of points (n, d)."""
    names = (*generated.space.names, *generated.space.pinned)
    return measures(generated.space, generated.recorded.roles or roles_of(names), theta)


def varying(generated: Generated) -> list[Measure]:
    """Return the readable measures of the executed runs that differ from run to run."""
    found = measured(generated, generated.episodes.theta[generated.episodes.outcomes.executed])
    return [each for each in found if each.values.size and np.ptp(each.values) > 0.0]


def regions(generated: Generated, by: Sequence[Measure]) -> list[FailureRegion]:
    """The regions of all executed runs, the most important first, at most `_MOST`; none without failures or measures.

    Args:
        by: values (n,) at the executed runs.
    """
    theta, outcomes, _ = generated.episodes
    theta, outcomes = theta[outcomes.executed], outcomes.take(outcomes.executed)
    failing = np.flatnonzero(outcomes.collision)
    if not failing.size or not by:
        return []
    failing = failing[np.linspace(0, len(failing) - 1, min(len(failing), _GROUPED)).astype(int)]
    space, columns = generated.space, distinctive(generated.space)
    unit, rows = space.unit(theta)[:, columns], np.stack([each.values for each in by], axis=1)
    labels = grouped(unit[failing], LINKED)
    collided = np.flatnonzero(generated.cases.outcomes.collision)
    cases = generated.cases.take(collided)
    found = []
    for label in np.unique(labels):
        group = failing[labels == label]
        of = np.zeros(len(rows), bool)
        of[group] = True
        bounds, precision, recall = _rule(rows, of)
        typical = group[int(np.argmin(np.square(unit[group] - unit[group].mean(axis=0)).sum(axis=1)))]
        likeliest = group[int(np.argmax(generated.prior.log_density(theta[group])))]
        near = _near(space.unit(cases.theta)[:, columns], unit[group])
        survived = {name: int((each.survived & near).sum()) for name, each in cases.drivers.items()}
        severity, drawn = float(outcomes.impact_speed[group].mean()), _share(generated, columns, unit[group])
        of_rule = (bounds, precision, recall, len(group))
        found.append(FailureRegion(*of_rule, drawn, severity, collided[near].tolist(), int(typical), int(likeliest), survived))
    return sorted(found, key=lambda each: each.importance, reverse=True)[:_MOST]


def grouped(unit: FloatArray, linked: float) -> IntArray:
    """Labels (n,) of rows (n, d) of the unit cube: groups by single linkage at a root-mean-square distance."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(unit) < 2:
        return np.zeros(len(unit), np.int64)
    return np.asarray(fcluster(linkage(unit, "single"), linked * np.sqrt(unit.shape[1]), "distance"), np.int64)


def _share(generated: Generated, columns: BoolArray, group: FloatArray) -> Share:
    """Unguided draws that fail near the rows (m, k) of a region."""
    if generated.draws is None:
        return Share(0, 0)
    theta, outcomes, _ = generated.draws
    near = _near(generated.space.unit(theta)[:, columns], group)
    return Share(int((outcomes.executed & outcomes.collision & near).sum()), int(outcomes.executed.sum()))


def _near(unit: FloatArray, others: FloatArray) -> BoolArray:
    from scipy.spatial.distance import cdist

    if not len(unit):
        return np.empty(0, bool)
    return np.asarray(cdist(unit, others).min(axis=1) < NEAR * np.sqrt(unit.shape[1]))


def _rule(rows: FloatArray, of: BoolArray) -> tuple[list[Bound], float, float]:
    """Bounds that tell the marked rows (n,) of (n, k) from the others best, with precision and recall."""
    bounds, inside = list[Bound](), np.ones(len(rows), bool)
    while len(bounds) < _BOUNDS:
        best = max(_candidates(rows, of), key=lambda each: _score(inside & each.holds(rows), of))
        if _score(inside & best.holds(rows), of) <= _score(inside, of) + _GAIN:
            break
        bounds.append(best)
        inside &= best.holds(rows)
    hit = float((inside & of).sum())
    return bounds, hit / max(int(inside.sum()), 1), hit / max(int(of.sum()), 1)


_GAIN = 0.01
"""Gain of the F1 score that a further bound needs"""


def _candidates(rows: FloatArray, of: BoolArray) -> Iterator[Bound]:
    for measure in range(rows.shape[1]):
        low, high = np.quantile(rows[of, measure], [_EDGE, 1.0 - _EDGE])
        yield Bound(measure, True, float(low))
        yield Bound(measure, False, float(high))


def _score(inside: BoolArray, of: BoolArray) -> float:
    """F1 of a rule."""
    return 2.0 * float((inside & of).sum()) / float(inside.sum() + of.sum())
