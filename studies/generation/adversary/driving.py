"""Density of the next accelerations of recorded drivers given their state, and its limits.

p(action | state) = p(state, action) / p(state) of a mixture of Gaussians over both. An episode is
foreseeable as long as its decisions are, on average, no less likely than those of 99 % of recorded
episodes after as many decisions, each judged by the density of other recordings. This is a
constraint and no part of a reward: `Driving.kept` brings an action that would break it as far back
towards the likeliest one as it takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.space.density.base import Components, folds
from generation.space.density.models.mixtures import Mixture
from generation.space.density.prior import FORESEEABLE, QUANTILE
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError
from studies.generation.adversary.actions import ACTION, DECISIONS, INTERVAL, STATE, Actions

_COMPONENTS = 8
_GIVEN = range(len(STATE))
_SHARES = np.linspace(1.0, 0.0, 11)
"""Tried shares of the difference from the likeliest action to the wanted one, in this order"""
_LEAST = 30
"""Fewest recorded episodes"""


@dataclass(frozen=True)
class Limits:
    """Limits that all but 0.1 % of recorded decisions keep.

    Attributes:
        low, high: least and greatest acceleration along and across (2,), m/s². change: greatest
            change of them in an interval (2,), m/s².
    """

    low: FloatArray
    high: FloatArray
    change: FloatArray

    @classmethod
    def of(cls, actions: Actions) -> Limits:
        """Return the limits of recorded decisions."""
        rare = 0.5 * (1.0 - QUANTILE)
        low, high = np.quantile(actions.actions, [rare, 1.0 - rare], axis=0)
        return cls(
            low,
            high,
            np.quantile(
                np.abs(actions.actions - actions.states[:, -len(ACTION) :]), QUANTILE, axis=0
            ),
        )

    @property
    def jerk(self) -> FloatArray:
        """Greatest jerk along and across (2,), m/s³."""
        return self.change / INTERVAL

    def kept(self, states: FloatArray, actions: FloatArray) -> FloatArray:
        """Actions (n, 2) brought within the limits, from states (n, 7)."""
        now = states[:, -len(ACTION) :]
        return np.clip(np.clip(actions, now - self.change, now + self.change), self.low, self.high)


class Driving:
    """See the module.

    Args:
        actions: of recorded drivers.

    Attributes:
        limits: of their accelerations and jerks.
        least: mean log-density (k,) of the first 1 … k decisions that all but 1 % of recorded
            episodes reach.
        held_out: log p(action | state) (m,) of each recorded decision by the density of other
            recordings.

    Raises:
        UsageError: there are too few episodes, or all are of one recording.
    """

    def __init__(self, actions: Actions) -> None:
        count = len(np.unique(actions.episodes))
        if count < _LEAST:
            raise UsageError(
                f"{count} recorded episodes are too few to say how drivers act, at "
                f"least {_LEAST} are needed"
            )
        self.limits = Limits.of(actions)
        rows = actions.joint
        self.held_out = np.empty(len(rows))
        for fitted, tested in folds(actions.recordings):
            self.held_out[tested] = _log_density(*_fit(rows[fitted]), rows[tested])
        self._joint, self._state = _fit(rows)
        self.least = _least(actions, self.held_out)
        usual = np.quantile(
            self.log_density(actions.states, self.likeliest(actions.states)), FORESEEABLE
        )
        self._needed = _needed(self.least, float(usual))
        self.mean, self.spread = actions.states.mean(axis=0), actions.states.std(axis=0)

    def log_density(self, states: FloatArray, actions: FloatArray) -> FloatArray:
        """log p(action | state) of states (n, 7) and actions (n, 2): (n,)."""
        return _log_density(self._joint, self._state, np.hstack([states, actions]))

    def likeliest(self, states: FloatArray) -> FloatArray:
        """The likeliest (n, 2) of the means that the parts of the mixture have for the actions in
        states (n, 7)."""
        given, free = np.array(_GIVEN), np.arange(len(STATE), len(STATE) + len(ACTION))
        joint, candidates = self._joint, []
        for mean, covariance in zip(joint.means, joint.covariances, strict=True):
            gain = np.linalg.solve(
                covariance[np.ix_(given, given)], covariance[np.ix_(given, free)]
            )
            candidates.append(mean[free] + (states - mean[given]) @ gain)
        found = np.array([self.limits.kept(states, each) for each in candidates])
        best = np.argmax([self.log_density(states, each) for each in found], axis=0)
        return found[best, np.arange(len(states))]

    def kept(
        self, states: FloatArray, wanted: FloatArray, sums: FloatArray, before: int
    ) -> tuple[FloatArray, FloatArray]:
        """Actions (n, 2) as near to the wanted ones as limits and likelihood allow, and their
        log-densities (n,).

        Args:
            states: (n, 7). wanted: (n, 2), m/s².
            sums: of the log-densities of each episode's decisions so far (n,). before: how many
                these are.
        """
        likeliest, wanted = self.likeliest(states), self.limits.kept(states, wanted)
        needed = self._needed[before] - sums
        chosen, density = likeliest.copy(), self.log_density(states, likeliest)
        open_ = np.ones(len(states), bool)
        for share in _SHARES[:-1]:
            rows = np.flatnonzero(open_)
            tried = likeliest[rows] + share * (wanted[rows] - likeliest[rows])
            found = self.log_density(states[rows], tried)
            enough = found >= needed[rows]
            chosen[rows[enough]], density[rows[enough]] = tried[enough], found[enough]
            open_[rows[enough]] = False
        return chosen, density

    def foreseeable(self, sums: FloatArray, decisions: int) -> BoolArray:
        """Whether episodes with these sums of log-densities (n,) over so many
        decisions are (n,).
        """
        return sums >= self.least[decisions - 1] * decisions - 1e-9


def _fit(rows: FloatArray) -> tuple[Components, Components]:
    """The density of states and actions, and that of states."""
    found = Mixture(_COMPONENTS).fit(rows).gaussians
    return found, found.marginal(list(_GIVEN))


def _log_density(joint: Components, state: Components, rows: FloatArray) -> FloatArray:
    return joint.log_density(rows) - state.log_density(rows[:, : len(STATE)])


def _least(actions: Actions, log_density: FloatArray) -> FloatArray:
    """Mean log-densities (k,) that all but 1 % of the episodes reach after 1 … k decisions; the
    last holds for longer ones."""
    rank, least = actions.rank, []
    for count in range(1, DECISIONS + 1):
        long = np.isin(actions.episodes, actions.episodes[rank == count - 1]) & (rank < count)
        if not long.any():
            break
        sums = np.bincount(actions.episodes[long], log_density[long])[
            np.unique(actions.episodes[long])
        ]
        least.append(float(np.quantile(sums / count, FORESEEABLE)))
    return np.array(least + least[-1:] * (DECISIONS - len(least)))


def _needed(least: FloatArray, usual: float) -> FloatArray:
    """Sums of log-densities (k,) after 1 … k decisions from which all later ones can be reached by
    the likeliest actions.

    Args:
        least: means after 1 … k decisions. usual: log-density that the likeliest action has nearly
            everywhere.
    """
    sums = least * np.arange(1, len(least) + 1)
    ahead = sums - usual * np.arange(len(sums))
    return np.maximum.accumulate(ahead[::-1])[::-1] + usual * np.arange(len(sums))
