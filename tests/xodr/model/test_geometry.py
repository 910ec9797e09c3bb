"""Plan-view elements against closed forms, quadrature and each other."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from xodr.model.geometry import (
    Arc,
    Line,
    ParamPoly3,
    PlanElement,
    ReferenceLine,
    Spiral,
    Start,
    poly3,
)

HERE = Start(10.0, -5.0, 0.7, 100.0)


def integrated(
    curvature: float, rate: float, length: float, start: Start = HERE
) -> tuple[float, float, float]:
    """End of a clothoid by composite Simpson integration with many steps."""
    count = 20_000
    step = length / count
    angles = [
        start.h + s * (curvature + 0.5 * rate * s)
        for s in (step * index for index in range(count + 1))
    ]
    weights = [1 if index in (0, count) else 4 if index % 2 else 2 for index in range(count + 1)]
    x = start.x + step / 3 * math.fsum(
        w * math.cos(a) for w, a in zip(weights, angles, strict=True)
    )
    y = start.y + step / 3 * math.fsum(
        w * math.sin(a) for w, a in zip(weights, angles, strict=True)
    )
    return x, y, angles[-1]


def test_a_line_goes_straight() -> None:
    x, y, h = Line(HERE).at(10.0)
    assert (x, y, h) == pytest.approx(
        (10.0 + 10.0 * math.cos(0.7), -5.0 + 10.0 * math.sin(0.7), 0.7), abs=1e-12
    )


def test_an_arc_keeps_its_distance_from_the_centre() -> None:
    arc = Arc(HERE, 0.02)
    center = (HERE.x - 50.0 * math.sin(HERE.h), HERE.y + 50.0 * math.cos(HERE.h))
    assert all(
        math.dist(arc.at(float(ds))[:2], center) == pytest.approx(50.0, abs=1e-12)
        for ds in range(0, 101, 10)
    )
    assert arc.at(100.0)[2] == pytest.approx(0.7 + 2.0)


@pytest.mark.parametrize("curvature", [1e-18, 1e-12, -1e-9, 1e-6])
def test_an_arc_of_tiny_curvature_is_not_noisy(curvature: float) -> None:
    x, y, _ = Arc(HERE, curvature).at(100.0)
    straight = Line(HERE).at(100.0)
    assert math.dist((x, y), straight[:2]) == pytest.approx(
        0.5 * abs(curvature) * 100.0**2, rel=1e-6, abs=1e-12
    )


@pytest.mark.parametrize(
    ("start", "end", "length"),
    [
        (0.0, 0.01, 100.0),
        (-0.02, 0.05, 80.0),
        (0.3, -0.3, 30.0),
        (0.0, 1e-9, 500.0),
        (0.0, 2.0, 10.0),
        (1e-7, 1.1e-7, 5000.0),
    ],
)
def test_a_spiral_ends_where_integration_ends(start: float, end: float, length: float) -> None:
    spiral = Spiral(HERE._replace(length=length), start, end)
    assert spiral.at(length) == pytest.approx(
        integrated(start, (end - start) / length, length), abs=1e-9
    )
    assert spiral.curvature(length) == pytest.approx(end)


def test_a_spiral_is_exact_between_its_anchors() -> None:
    spiral = Spiral(HERE, 0.0, 0.1)
    for ds in (0.0, 3.7, 31.4, 62.9, 99.9):
        assert spiral.at(ds) == pytest.approx(
            integrated(0.0, 0.001, ds) if ds else HERE[:3], abs=1e-9
        )


def test_a_spiral_without_change_is_an_arc() -> None:
    assert Spiral(HERE, 0.03, 0.03).at(70.0) == pytest.approx(Arc(HERE, 0.03).at(70.0), abs=1e-10)


@pytest.mark.parametrize("build", [lambda: Spiral(HERE, 0.0, 1e9), lambda: Arc(HERE, 1e9).knots()])
def test_absurd_curvature_is_refused(build: object) -> None:
    with pytest.raises(ValueError, match="winds"):
        build()  # type: ignore[operator]


def test_a_parametric_cubic_is_followed_by_arc_length() -> None:
    # u = p, v = p²/2 for p in [0, 1], scaled to 100 m: length of the parabola in closed form
    u, v = (0.0, 100.0, 0.0, 0.0), (0.0, 0.0, 50.0, 0.0)
    length = 50.0 * (math.sqrt(2.0) + math.asinh(1.0))
    curve = ParamPoly3(Start(0.0, 0.0, 0.0, length), u, v, 1.0)
    assert curve.at(length) == pytest.approx((100.0, 50.0, math.pi / 4), abs=1e-6)
    p = 0.5
    part = 50.0 * (p * math.sqrt(1.0 + p * p) + math.asinh(p))
    assert curve.at(part)[:2] == pytest.approx((50.0, 12.5), abs=1e-6)
    assert curve.curvature(0.0) == pytest.approx(0.01)


def test_a_parametric_cubic_needs_few_pieces_and_turns_little_between_its_knots() -> None:
    """A file of such curves takes as long to load as its tables are long."""
    curve = turn(math.pi / 2, 20.0)
    assert len(curve._ss) <= 13  # 59 with cubics
    for p in (0.1, 0.37, 0.5, 0.93):
        total = curve._arc_length(0.0, 1.0)
        part = sum(curve._arc_length(p * i / 64, p * (i + 1) / 64) for i in range(64))
        assert curve.parameter(part) * total == pytest.approx(p * total, abs=1e-6)
    curve = turn(math.radians(70.0), 3.0)
    headings = [curve.at(ds)[2] for ds in curve.knots()]
    assert all(0.0 < after - before < 0.32 for before, after in pairwise(headings))


def turn(angle: float, radius: float) -> ParamPoly3:
    """A left turn as the cubic with the ends, directions and length of an arc."""
    length, ahead, aside = angle * radius, math.sin(angle), math.cos(angle)
    x, y = radius * ahead, radius * (1.0 - aside)
    u = (0.0, length, 3.0 * x - length * (2.0 + aside), length * (1.0 + aside) - 2.0 * x)
    v = (0.0, 0.0, 3.0 * y - length * ahead, length * ahead - 2.0 * y)
    return ParamPoly3(Start(0.0, 0.0, 0.0, length), u, v, 1.0)


def test_a_parametric_cubic_ends_where_its_polynomials_end_whatever_length_is_declared() -> None:
    curve = ParamPoly3(
        Start(0.0, 0.0, 0.0, 30.03), (0.0, 30.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), 1.0
    )
    assert curve.at(30.03)[0] == pytest.approx(30.0, abs=1e-9)


def test_a_polynomial_has_the_declared_length() -> None:
    curve = poly3(Start(0.0, 0.0, 0.0, 50.0), (0.0, 0.0, 0.01, 0.0))
    x, y, _ = curve.at(50.0)
    assert y == pytest.approx(0.01 * x * x, abs=1e-9)
    steps = [curve.at(50.0 * index / 5000)[:2] for index in range(5001)]
    assert sum(math.dist(a, b) for a, b in pairwise(steps)) == pytest.approx(50.0, abs=1e-5)


def test_a_curve_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match="without length"):
        ParamPoly3(HERE, (0.0,) * 4, (0.0,) * 4, 1.0)


shapes = st.one_of(
    st.builds(Arc, st.just(HERE), st.floats(-0.1, 0.1)),
    st.builds(Spiral, st.just(HERE), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    st.builds(
        lambda c, d, e, f: ParamPoly3(HERE, (0.0, 100.0, c, d), (0.0, 0.0, e, f), 1.0),
        *[st.floats(-20.0, 20.0) for _ in range(4)],
    ),
)


@given(shapes, st.floats(1.0, 99.0))
def test_heading_and_curvature_are_derivatives(shape: PlanElement, ds: float) -> None:
    x0, y0, h0 = shape.at(ds - 1e-4)
    x1, y1, h1 = shape.at(ds + 1e-4)
    _, _, h = shape.at(ds)
    assert math.remainder(math.atan2(y1 - y0, x1 - x0) - h, math.tau) == pytest.approx(
        0.0, abs=1e-4
    )
    speed = math.hypot(x1 - x0, y1 - y0) / 2e-4
    assert math.remainder(h1 - h0, math.tau) / 2e-4 == pytest.approx(
        shape.curvature(ds) * speed, abs=1e-4
    )


def test_a_reference_line_goes_on_straight_beyond_its_ends() -> None:
    line = ReferenceLine(
        [0.0, 100.0], [Line(Start(0.0, 0.0, 0.0, 100.0)), Arc(Start(100.0, 0.0, 0.0, 50.0), 0.02)]
    )
    assert line.at(-10.0) == pytest.approx((-10.0, 0.0, 0.0))
    x, y, h = line.at(150.0)
    assert line.at(160.0) == pytest.approx((x + 10.0 * math.cos(h), y + 10.0 * math.sin(h), h))
    assert (line.curvature(50.0), line.curvature(120.0), line.curvature(151.0)) == (0.0, 0.02, 0.0)


def test_a_poly3_ends_at_its_declared_length_as_if_tabulated_to_there() -> None:
    for v in ((0.0, 0.2, 0.03, -0.001), (0.0, 0.0, -0.05, 0.002)):
        start = Start(1.0, 2.0, 0.3, 60.0)
        whole = ParamPoly3(start, (0.0, 1.0, 0.0, 0.0), v, start.length)
        exact = ParamPoly3(start, (0.0, 1.0, 0.0, 0.0), v, whole.parameter(start.length))
        for ds in (0.0, 13.0, 47.5, 60.0):
            assert poly3(start, v).at(ds) == pytest.approx(exact.at(ds), abs=1e-6)
