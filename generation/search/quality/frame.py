"""The coordinates of quality-diversity search: where parents are varied, and what an archive tells apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.density.base import Whitening
from generation.density.prior import Prior
from generation.density.roles import EGO_SPEED, roles_of
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray

_LEAST = 0.1
"""Least duration (s) and speed (m/s) to divide by"""


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of points θ (n, d) of a space.

    Attributes:
        varied: the parameters that are searched (d,); nuisances are drawn with them.
        whitening: of recorded points in the unit cube: steps are as long as traffic varies, in the directions in which it does.
    """

    space: Space
    prior: Prior
    varied: BoolArray
    whitening: Whitening

    @classmethod
    def of(cls, space: Space, prior: Prior, generator: np.random.Generator) -> Frame:
        """That of a prior's recorded points, or of draws where there are too few."""
        varied = np.array([name not in prior.nuisances for name in space.names])
        rows = prior.theta if len(prior.theta) > 2 * len(varied) else prior.sample(1000, generator)
        return cls(space, prior, varied, Whitening.of(space.unit(rows)[:, varied]))

    @property
    def dimension(self) -> int:
        """Number of coordinates k."""
        return int(self.varied.sum())

    def coordinates(self, theta: FloatArray) -> FloatArray:
        """Whitened coordinates (n, k)."""
        return self.whitening.forward(self.space.unit(theta)[:, self.varied])

    def points(self, coordinates: FloatArray) -> FloatArray:
        """Points of coordinates (n, k), with nuisances as recorded; some may lie outside the box."""
        unit = np.full((len(coordinates), len(self.varied)), 0.5)
        unit[:, self.varied] = self.whitening.mean + coordinates @ self.whitening.factor.T
        return self.prior.with_nuisances(self.space.scaled(unit))

    def measures(self, theta: FloatArray) -> FloatArray:
        """What a tester reads, in the unit cube (n, m).

        Relative speed and time headway when the manoeuvre begins, its pace (lanes per second) and the ego's speed, as far as the
        space has them; the varied parameters themselves where it has fewer than two.
        """
        values = self.space.by_name(theta)
        by_role = {role.role: values[name] for name, role in roles_of(values).items()}
        found = list(_read(by_role)) if len(by_role) > 1 else []
        return np.stack(found, axis=1) if len(found) > 1 else self.space.unit(theta)[:, self.varied]


def _read(by_role: dict[str, FloatArray]) -> list[FloatArray]:
    """The measures that the roles allow, each about 0 to 1."""
    gap, start, ego, duration = (by_role.get(role) for role in ("gap", "start_speed", EGO_SPEED, "duration"))
    found = []
    if start is not None and ego is not None:
        found.append(0.5 + (ego - start) / 60.0)
    if gap is not None and ego is not None:
        found.append(gap / np.maximum(ego, _LEAST) / 4.0)
    if duration is not None:
        found.append(1.0 / np.maximum(duration, _LEAST))
    if ego is not None:
        found.append(ego / 40.0)
    return found
