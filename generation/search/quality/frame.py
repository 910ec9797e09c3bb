"""The coordinates of quality-diversity search: where parents are varied, and what an archive tells apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from generation.density.base import Whitening
from generation.density.prior import Prior
from generation.density.roles import roles_of
from generation.search.readings import LEAST, by_actor, reading
from generation.search.space import Space
from xodr.array_types import BoolArray, FloatArray


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

        Relative speed and time headway when the manoeuvre begins and its pace (lanes per second), of each actor, and the ego's
        speed, as far as the space has them; the varied parameters themselves where it has fewer than two.
        """
        values = self.space.by_name(theta)
        roles = roles_of(values)
        found = _read(by_actor(values, roles)) if len(roles) > 1 else []
        return np.stack(found, axis=1) if len(found) > 1 else self.space.unit(theta)[:, self.varied]


def _read(actors: Mapping[str, Mapping[str, FloatArray]]) -> list[FloatArray]:
    """The measures that the roles of each actor allow, each about 0 to 1."""
    found: list[FloatArray | None] = []
    ego = None
    for actor, of in actors.items():
        closing, headway, ego = reading(of, actor)
        found += [
            None if closing is None else 0.5 + closing / 60.0,
            None if headway is None else headway / 4.0,
            1.0 / np.maximum(of["duration"], LEAST) if "duration" in of else None,
        ]
    return [each for each in (*found, None if ego is None else ego / 40.0) if each is not None]
