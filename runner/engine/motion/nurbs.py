"""Non-uniform rational B-splines, as B-splines in homogeneous coordinates, sampled once by arc
length.

Piegl and Tiller, The NURBS Book, 2nd ed., section 4.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from runner.engine.motion.paths import Sample, Sampled

_SPACING = 0.25
"""Wanted distance (m) between samples."""
_FEWEST, _MOST = 16, 2000
"""Limits of the number of samples in one span between knots."""
_MOST_OF_ALL = 500_000
"""Most samples of a curve: 125 km, or 31,000 control points"""
_STILL = 1e-9


class ControlPoint(NamedTuple):
    """A control point: position (m), weight, and where prescribed the time (s) and heading (rad,
    not wrapped) there."""

    x: float
    y: float
    z: float
    weight: float
    time: float | None
    h: float | None


class Curve(NamedTuple):
    """A sampled curve, and the time (s) at each sample where all control points have times."""

    path: Sampled
    stations: tuple[float, ...]
    times: tuple[float | None, ...]


@lru_cache(maxsize=64)
def sampled(order: int, points: tuple[ControlPoint, ...], knots: tuple[float, ...]) -> Curve:
    """A NURBS curve by arc length.

    Times and headings, where every control point has one, are coordinates of the curve like x, y
    and z.

    Args:
        order: degree + 1.
        points: at least `order`.
        knots: as many as points and order together, not decreasing.

    Raises:
        ValueError: the numbers do not make a curve; the message says why.
    """
    from scipy.interpolate import BSpline  # takes half a second, and few scenarios need it

    _check(order, points, knots)
    timed = all(point.time is not None for point in points)
    turned = all(point.h is not None for point in points)
    # Weights make points (wx, wy, wz, w) of a polynomial spline; dividing by w gives the rational
    # one.
    homogeneous = [
        (w * x, w * y, w * z, w * (time or 0.0), w * (h or 0.0), w)
        for x, y, z, w, time, h in points
    ]
    spline, at = BSpline(knots, homogeneous, order - 1), _parameters(order, points, knots)
    samples: list[Sample] = []
    times: list[float | None] = []
    for (x, y, z, time, h, w), (dx, dy, *_, dw) in zip(
        spline(at).tolist(), spline(at, 1).tolist(), strict=True
    ):
        x, y, z, time, h = x / w, y / w, z / w, time / w, h / w
        # Quotient rule for (X/w)': its common factor 1/w > 0 does not change the direction.
        tangent = math.atan2(dy - y * dw, dx - x * dw)
        if samples:
            step = math.hypot(x - samples[-1].x, y - samples[-1].y)
            if step < _STILL:
                continue
            turn = math.remainder(tangent - samples[-1].tangent, math.tau)
            # arc and chord differ by the turn between the samples
            step *= 1.0 + turn * turn / 24.0
            tangent = samples[-1].tangent + turn
            s = samples[-1].s + step
        else:
            s = 0.0
        samples.append(Sample(s, x, y, z, tangent, h if turned else tangent))
        times.append(time if timed else None)
    if len(samples) < 2:
        raise ValueError("the control points describe a curve without length")
    return Curve(Sampled(samples), tuple(sample.s for sample in samples), tuple(times))


def _check(order: int, points: Sequence[ControlPoint], knots: Sequence[float]) -> None:
    if order < 2:
        raise ValueError(f"order={order} must be 2 or more")
    if len(points) < order:
        raise ValueError(
            f"a curve of order {order} needs {order} control points or more, not {len(points)}"
        )
    if len(knots) != len(points) + order:
        raise ValueError(
            f"{len(points)} control points of order {order} need {len(points) + order} knots, not "
            f"{len(knots)}"
        )
    if any(b < a for a, b in pairwise(knots)):
        raise ValueError("knots must not decrease")
    inside = knots[1:-1]
    # A knot that occurs as often as the order breaks the curve in two.
    if any(b <= a for a, b in zip(inside, inside[order - 1 :], strict=False)):
        raise ValueError(f"a knot inside the curve must not occur {order} times or more")
    if any(point.weight <= 0.0 for point in points):
        raise ValueError("weights must be positive")


def _parameters(order: int, points: Sequence[ControlPoint], knots: Sequence[float]) -> list[float]:
    """Curve parameters of the samples: the knots, and evenly between them as the control polygon's
    length suggests."""
    parameters = [knots[order - 1]]
    for index in range(order - 1, len(points)):
        start, end = knots[index], knots[index + 1]
        if end <= start:
            continue
        # Only these control points shape the span (local support): their polygon suggests its
        # length.
        shaping = points[index - order + 1 : index + 1]
        reach = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(shaping))
        count = int(min(max(_FEWEST, reach / _SPACING), _MOST))
        if len(parameters) + count > _MOST_OF_ALL:
            raise ValueError(
                f"a curve of more than {_MOST_OF_ALL} samples is too long, or has too many "
                "control points"
            )
        parameters += [start + (end - start) * step / count for step in range(1, count + 1)]
    return parameters
