"""Where a system fails: a quadratic boundary over the tester's measures, cross-validated, in slices that can be drawn.

Logistic regression on all products of two measures: the simplest boundary that can be closed. What is drawn is that of the
measures that matter most, so that a slice holds one measure and not ten. It separates the runs that there
are. These were sought near failures, so that it is no probability of a failure in traffic (`generation.estimation` is).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from generation.report.measures import Measure
from schemas.commands.wording import many
from xodr.array_types import BoolArray, FloatArray

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

_FEWEST = 20
"""Fewest runs that fail, and that do not, for a boundary"""
_FOLDS, _SLICED, _GRID = 5, 3, 60
"""Folds of the cross-validation, measures that slices are made of, and points along the sides of a slice"""
_ROOM = 0.02
"""Room around the runs of a slice, as a share of their range"""


class Slice(NamedTuple):
    """Two measures, the others held.

    Attributes:
        across, up: indices of the measures.
        held: medians (k,) over the failures, of all measures.
        boundary: lines (n, 2) where as much speaks for a failure as against it, among the runs that there are.
    """

    across: int
    up: int
    held: FloatArray
    boundary: list[FloatArray]


@dataclass(frozen=True, eq=False)
class Region:
    """The boundary.

    Attributes:
        accuracy: balanced, of runs that the model was not fitted on: mean of the shares of failures and of others that it gets
            right; ½ is chance. spread: its standard deviation over folds.
        area: under the receiver's characteristic, likewise.
        weights: how much of the accuracy goes when a measure's values are shuffled, by its index, the greatest first.
        drawn: indices of the measures that matter most. alone: accuracy of a model of these alone.
        slices: of that model.
    """

    accuracy: float
    spread: float
    area: float
    weights: dict[int, float]
    drawn: list[int]
    alone: float
    slices: list[Slice]


def region(measures: Sequence[Measure], failing: BoolArray) -> Region | str:
    """The boundary between runs (n,) that fail and those that do not, or why there is none."""
    fails, others = int(failing.sum()), int((~failing).sum())
    if min(fails, others) < _FEWEST:
        ran = f"{many(fails + others, 'run')}, {many(fails, 'failure')}"
        return f"{ran}: a boundary needs {_FEWEST} that fail and {_FEWEST} that do not"
    if len(measures) < 2:
        return "one measure varies: there is nothing to draw over two"
    rows = np.stack([each.values for each in measures], axis=1)
    scores = _scores(rows, failing)
    weights = _weights(_model().fit(rows, failing), rows, failing)
    drawn, held = list(weights)[:_SLICED], np.median(rows[failing], axis=0)
    few = rows[:, drawn]
    model, alone = _model().fit(few, failing), _scores(few, failing)["test_balanced_accuracy"]
    slices = [
        Slice(drawn[across], drawn[up], held, _boundary(model, few, held[drawn], across, up))
        for across, up in combinations(range(len(drawn)), 2)
    ]
    accuracy, area = scores["test_balanced_accuracy"], scores["test_roc_auc"]
    return Region(float(accuracy.mean()), float(accuracy.std()), float(area.mean()), weights, drawn, float(alone.mean()), slices)


def _model() -> Pipeline:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    regression = LogisticRegression(class_weight="balanced", max_iter=2000)
    return make_pipeline(StandardScaler(), PolynomialFeatures(2, include_bias=False), regression)


def _scores(rows: FloatArray, failing: BoolArray) -> dict[str, Any]:
    from sklearn.model_selection import StratifiedKFold, cross_validate

    folds = StratifiedKFold(_FOLDS, shuffle=True, random_state=0)
    found: dict[str, Any] = cross_validate(_model(), rows, failing, cv=folds, scoring=("balanced_accuracy", "roc_auc"))
    return found


def _weights(model: Pipeline, rows: FloatArray, failing: BoolArray) -> dict[int, float]:
    from sklearn.inspection import permutation_importance

    found = permutation_importance(model, rows, failing, scoring="balanced_accuracy", n_repeats=5, random_state=0)
    means = found["importances_mean"]
    return {int(index): float(means[index]) for index in np.argsort(-means, kind="stable")}


def _boundary(model: Pipeline, rows: FloatArray, held: FloatArray, across: int, up: int) -> list[FloatArray]:
    """Where the model is undecided, as far as runs reach."""
    from matplotlib.figure import Figure
    from scipy.spatial import Delaunay

    xs, ys = (np.linspace(*limits(rows[:, index]), _GRID) for index in (across, up))
    grid = np.repeat(held[None], _GRID * _GRID, axis=0)
    grid[:, across], grid[:, up] = (each.ravel() for each in np.meshgrid(xs, ys))
    reached = Delaunay(rows[:, [across, up]]).find_simplex(grid[:, [across, up]]) >= 0
    decided = np.ma.masked_array(model.decision_function(grid), ~reached).reshape(_GRID, _GRID)
    (path,) = Figure().subplots().contour(xs, ys, decided, levels=[0.0]).get_paths()
    return [np.asarray(line, np.float64) for line in path.to_polygons(closed_only=False)]


def limits(values: FloatArray) -> tuple[float, float]:
    """Least and greatest value with a little room."""
    low, high = float(values.min()), float(values.max())
    return low - _ROOM * (high - low), high + _ROOM * (high - low)
