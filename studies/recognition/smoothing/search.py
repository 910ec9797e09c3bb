"""Settings of ways to smooth, chosen on development data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from recognition.recordings.motion.observations import Noise
from studies.recognition.smoothing import ways
from studies.recognition.smoothing.cases import Case
from studies.recognition.smoothing.scores import Score, score
from studies.recognition.smoothing.ways import Way


class Material(NamedTuple):
    """Cases to judge by.

    recordings: rows hidden from each data set, by its name. exact: exact recordings with noise.
    """

    recordings: Mapping[str, Sequence[Case]]
    exact: Sequence[Case]


class Judged(NamedTuple):
    """Scores by a data set's name, and that of exact recordings."""

    recordings: dict[str, Score]
    exact: Score

    @property
    def likelihood(self) -> float:
        """Mean of the data sets' likelihoods of hidden places."""
        return float(np.mean([each.likelihood for each in self.recordings.values()]))

    @property
    def place(self) -> float:
        """Geometric mean of the data sets' errors of hidden places, m."""
        return float(np.exp(np.mean(np.log([each.place for each in self.recordings.values()]))))

    @property
    def error(self) -> float:
        """Geometric mean of the errors of place (m), speed (m/s) and acceleration (m/s²) on exact
        recordings."""
        return float(
            np.exp(np.mean(np.log([self.exact.place, self.exact.speed, self.exact.acceleration])))
        )


class Method(NamedTuple):
    """A way to smooth: its name, what makes it from settings, and the values to try for each."""

    name: str
    make: Callable[..., Way]
    values: Mapping[str, Sequence[float]]


class Trial(NamedTuple):
    """Settings that were tried, and how they did."""

    settings: dict[str, float]
    judged: Judged


METHODS = (
    Method(
        "bicycle model, Student's t",
        lambda **settings: partial(ways.ours, Noise(**settings)),
        {
            "heading": (0.02, 0.05, 0.1, 0.2),
            "jerk": (0.7, 1.0, 1.5, 2.0, 3.0),
            "bend": (0.01, 0.02, 0.04),
            "tails": (4.0, 30.0),
        },
    ),
    Method(
        "constant acceleration (Rauch-Tung-Striebel)",
        lambda jerk: partial(ways.constant_acceleration, jerk),
        {"jerk": (0.5, 0.7, 1.0, 1.2, 1.5, 1.7, 2.0, 3.0)},
    ),
    Method(
        "Savitzky-Golay (SciPy)",
        lambda window, order: partial(ways.savitzky_golay, window, int(order)),
        {"window": (1.0, 1.4, 2.0, 2.4, 3.0, 4.0), "order": (2, 3, 4)},
    ),
    Method(
        "smoothing spline (SciPy)",
        lambda weight: partial(ways.spline, weight),
        {"weight": (0.003, 0.01, 0.03, 0.1, 0.2, 0.3)},
    ),
    Method("smoothing spline by cross-validation (SciPy)", lambda: partial(ways.spline, None), {}),
)
"""Ours first, then those of libraries and of the field"""
BY_HAND = Noise()._asdict()
"""Our settings; they are among those that are tried"""


def judged(way: Way, material: Material) -> Judged:
    """Score a method on all material."""
    return Judged(
        {name: score(way, cases) for name, cases in material.recordings.items()},
        score(way, material.exact),
    )


def searched(method: Method, material: Material) -> list[Trial]:
    """All settings of a method, tried."""
    grid = (
        dict(zip(method.values, values, strict=True)) for values in product(*method.values.values())
    )
    return [Trial(settings, judged(method.make(**settings), material)) for settings in grid]


def best(trials: Sequence[Trial], bar: float) -> Trial:
    """The trial with the greatest likelihood of hidden places, of those that are as exact as the
    bar.

    Settings that follow noise find hidden rows well, whose noise is that of the rows beside them;
    but not exact recordings.

    Args:
        bar: greatest error on exact recordings; where all have more, it is the trial with the
            least.
    """
    exact = [trial for trial in trials if trial.judged.error <= bar]
    if not exact:
        return min(trials, key=lambda trial: trial.judged.error)
    return max(exact, key=lambda trial: trial.judged.likelihood)
