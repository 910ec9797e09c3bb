"""Shapes of planted regions: scores of points, by what is drawn of a place.

The development generator plants boxes, ellipsoids, slabs, shells at the edge of the foreseeable,
interactions of two parameters, sleep at certain times of the scene, waves (thin curved bands) and
speckles. The reported one plants corners, curved bands, hollow shells, cones, tails beyond a
plane, sleep that depends on how long a danger has lasted, arcs (thin bands) and grains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from generation.search.methods.models import Frame
from generation.search.outcomes import Outcomes
from generation.space.density.prior import Prior
from generation.space.space import Space
from schemas.common.array_types import FloatArray, IntArray

Score = Callable[[FloatArray, Outcomes], FloatArray]
"""Distance (n,) of points (n, d), with their undriven outcomes, from the middle of a region, in a
measure of its shape"""
FAR = 1e6
"""Score of points outside any size of a region"""
_RARE = 0.2
"""Share of the draws that counts as the edge of the foreseeable"""


class Place(NamedTuple):
    """Place of a region: its middle as a point (1, d) with its undriven outcome, drawn columns of
    coordinates, scales (k,) of all coordinates, and a drawn number from 0.5 to 1 for shapes that
    need one."""

    frame: Frame
    space: Space
    prior: Prior
    middle: FloatArray
    undriven: Outcomes
    columns: IntArray
    scales: FloatArray
    drawn: float

    def off(self, theta: FloatArray) -> FloatArray:
        """Scaled differences (n, k) from the middle, in whitened coordinates."""
        return (self.frame.coordinates(theta) - self.frame.coordinates(self.middle)) / self.scales


def _box(place: Place) -> Score:
    return lambda theta, _: np.abs(place.off(theta)[:, place.columns]).max(axis=1)


def _ellipsoid(place: Place) -> Score:
    return lambda theta, _: np.sqrt(np.square(place.off(theta)[:, place.columns]).mean(axis=1))


def _slab(place: Place) -> Score:
    """Between two parallel planes: a sum of differences in some parameters."""
    return lambda theta, _: np.abs(place.off(theta)[:, place.columns].sum(axis=1))


def _shell(place: Place) -> Score:
    """A part of the rarest draws."""
    limit = float(
        np.quantile(
            place.prior.log_density(place.prior.sample(2000, np.random.default_rng(0))), _RARE
        )
    )

    def score(theta: FloatArray, undriven: Outcomes) -> FloatArray:
        return np.where(
            place.prior.log_density(theta) <= limit, _ellipsoid(place)(theta, undriven), FAR
        )

    return score


def _interaction(place: Place) -> Score:
    """A product of two parameters in a band: neither of them alone says anything."""
    one, other = place.columns[:2]

    def product(theta: FloatArray) -> FloatArray:
        z = place.frame.coordinates(theta) + 3.0  # positive for nearly all draws
        found: FloatArray = z[:, one] * z[:, other]
        return found

    middle = product(place.middle)
    return lambda theta, _: np.abs(product(theta) - middle)


def _timing(place: Place) -> Score:
    """Sleep during some time of the scene, for part of the manoeuvres."""
    column = [
        number for number, name in enumerate(place.space.names) if name in place.prior.nuisances
    ][:1]
    scale = max(float(np.ptp(place.prior.sample(200, np.random.default_rng(0))[:, column])), 1e-9)

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        late = np.abs(theta[:, column] - place.middle[:, column])[:, 0] / (0.1 * scale)
        return np.maximum(late, np.abs(place.off(theta)[:, place.columns[0]]))

    return score


def _corner(place: Place) -> Score:
    """All parameters of some beyond a value, away from the density's middle."""
    away = np.where(place.frame.coordinates(place.middle)[0, place.columns] >= 0.0, 1.0, -1.0)
    return lambda theta, _: np.max(-away * place.off(theta)[:, place.columns], axis=1)


def _ridge(place: Place) -> Score:
    """A curved band in two parameters."""
    one, other = place.columns[:2]

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        off = place.off(theta)
        found: FloatArray = np.abs(off[:, one] - place.drawn * np.square(off[:, other]))
        return found

    return score


def _ring(place: Place) -> Score:
    """Between two ellipsoids."""
    return lambda theta, _: np.abs(
        np.sqrt(np.square(place.off(theta)[:, place.columns]).mean(axis=1)) - place.drawn
    )


def _cone(place: Place) -> Score:
    """About a direction from the density's middle: from the likely outwards."""
    middle = place.frame.coordinates(place.middle)[0] / place.scales
    away = middle / np.linalg.norm(middle)

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        rows = place.frame.coordinates(theta) / place.scales
        found: FloatArray = 1.0 - rows @ away / np.maximum(np.linalg.norm(rows, axis=1), 1e-9)
        return found

    return score


def _tail(place: Place) -> Score:
    """Beyond a plane, away from the density's middle: a sum of some parameters."""
    away = np.where(place.frame.coordinates(place.middle)[0, place.columns] >= 0.0, 1.0, -1.0)
    return lambda theta, _: -(place.off(theta)[:, place.columns] @ away)


def _history(place: Place) -> Score:
    """Sleep once a danger has lasted for some share of the scene, at contacts about a time."""
    middle = place.undriven

    def score(theta: FloatArray, undriven: Outcomes) -> FloatArray:
        late = np.abs(undriven.conflict - middle.conflict) / _SECONDS
        return np.maximum(late, np.abs(undriven.r_risk - middle.r_risk) / (_LASTING * place.drawn))

    return score


_SECONDS, _LASTING = 3.0, 0.2
"""Scales of the time (s) of contact, and of the share of the scene in danger"""


def _wave(place: Place) -> Score:
    """A thin curved band: a sine of one parameter in another one."""
    one, other = place.columns[:2]

    def height(theta: FloatArray) -> FloatArray:
        z = place.frame.coordinates(theta)
        found: FloatArray = z[:, one] - np.sin(2.0 * z[:, other] / place.drawn)
        return found

    middle = height(place.middle)
    return lambda theta, _: np.abs(height(theta) - middle)


def _speckles(place: Place) -> Score:
    """A third of the cells of a lattice in an ellipsoid, without any order."""
    factors = np.array([73_856_093, 19_349_663, 83_492_791, 49_979_687, 86_028_121, 67_867_967])

    def cells(theta: FloatArray) -> IntArray:
        lattice = np.floor(place.frame.coordinates(theta) / _CELL).astype(np.int64)
        mixed = lattice * np.resize(factors, lattice.shape[1])
        return np.asarray((np.bitwise_xor.reduce(mixed, axis=1) >> 3) % _THIRD)

    middle = cells(place.middle)

    def score(theta: FloatArray, undriven: Outcomes) -> FloatArray:
        return np.where(cells(theta) == middle, _ellipsoid(place)(theta, undriven), FAR)

    return score


def _arc(place: Place) -> Score:
    """A thin band: a circle in two parameters, about a point beside the density's middle."""
    columns = place.columns[:2]
    centre = np.array([1.0, -1.0]) * place.drawn

    def radius(theta: FloatArray) -> FloatArray:
        off = place.frame.coordinates(theta)[:, columns] - centre
        found: FloatArray = np.sqrt(np.square(off).sum(axis=1))
        return found

    middle = radius(place.middle)
    return lambda theta, _: np.abs(radius(theta) - middle)


def _grains(place: Place) -> Score:
    """Small balls, scattered about the middle."""
    generator = np.random.default_rng(round(1e6 * place.drawn))
    scattered = generator.normal(0.0, _SCATTERED, (_GRAINS, place.frame.dimension))
    scattered[0] = 0.0

    def score(theta: FloatArray, _: Outcomes) -> FloatArray:
        off = place.frame.coordinates(theta) - place.frame.coordinates(place.middle)
        found: FloatArray = cdist(off, scattered).min(axis=1)
        return found

    return score


_CELL, _THIRD = 0.8, 3
"""Width of a lattice's cells in whitened coordinates, and how many cells one of them fails"""
_GRAINS, _SCATTERED = 40, 1.0
"""Number of grains, and the standard deviation of their places in whitened coordinates"""
DEVELOPMENT: Mapping[str, Callable[[Place], Score]] = {
    "box": _box,
    "ellipsoid": _ellipsoid,
    "interaction": _interaction,
    "shell": _shell,
    "slab": _slab,
    "speckles": _speckles,
    "timing": _timing,
    "wave": _wave,
}
REPORTED: Mapping[str, Callable[[Place], Score]] = {
    "arc": _arc,
    "cone": _cone,
    "corner": _corner,
    "grains": _grains,
    "history": _history,
    "ridge": _ridge,
    "ring": _ring,
    "tail": _tail,
}
SHAPES = {**DEVELOPMENT, **REPORTED}
