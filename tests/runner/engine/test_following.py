"""Gears on a path: the first motion leads on, the other gear back; headings that
the path prescribes hold.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.engine.motion.following import PathMotion
from runner.engine.motion.on_roads import Roads
from runner.engine.motion.paths import Corner, Polyline, tangent

DT = 0.1


def entity(h: float = 0.0) -> SimpleNamespace:
    """Someone at the origin."""
    return SimpleNamespace(x=0.0, y=0.0, z=0.0, h=h, pitch=0.0, roll=0.0, speed=0.0)


def motion(heading: float | None = None, s: float = 0.0) -> PathMotion:
    """Along the x axis, 100 m, from s (m) on."""
    path = Polyline([Corner(0.0, 0.0, 0.0, heading), Corner(100.0, 0.0, 0.0, heading)])
    return PathMotion(Roads(None), path, s, oriented=heading is not None)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_other_gear_leads_back_without_a_turn(sign: float) -> None:
    who, way = entity(), motion()
    facing = 0.0 if sign > 0.0 else math.pi
    for speed, x in ((10.0, 1.0), (10.0, 2.0), (-5.0, 1.5), (-5.0, 1.0), (-20.0, 0.0), (10.0, 1.0)):
        way.advance(who, sign * speed, DT)
        assert (who.x, who.h) == pytest.approx((x, facing))


def test_at_the_beginning_it_goes_no_further_back() -> None:
    who, way = entity(), motion()
    way.advance(who, 10.0, DT)
    assert way.advance(who, -20.0, DT) == pytest.approx(-10.0)


def test_who_stands_keeps_facing_as_before() -> None:
    who, way = entity(math.pi), motion()
    way.put(who, 0.0)
    assert math.cos(who.h) == pytest.approx(-1.0)
    way.advance(who, -10.0, DT)
    assert (who.x, math.cos(who.h)) == pytest.approx((1.0, -1.0))


@pytest.mark.parametrize("heading", [0.3, 3.0])
@pytest.mark.parametrize("speed", [10.0, -10.0])
def test_prescribed_headings_hold_in_either_gear(heading: float, speed: float) -> None:
    who, way = entity(), motion(heading)
    way.advance(who, speed, DT)
    assert (who.x, who.h) == pytest.approx((1.0, heading))


@pytest.mark.parametrize(("heading", "speed"), [(0.0, -10.0), (math.pi, 10.0)])
def test_inside_a_path_one_moves_as_the_prescribed_heading_and_the_gear_say_and_ends_at_the_beginning(
    heading: float, speed: float
) -> None:
    who, way = entity(heading), motion(heading, 3.0)
    for x in (2.0, 1.0):
        assert not way.ends(speed, DT)
        way.advance(who, speed, DT)
        assert (who.x, who.h) == pytest.approx((x, heading))
    way.advance(who, -speed, DT)
    assert who.x == pytest.approx(2.0)
    way.advance(who, speed, DT)
    assert way.ends(speed, DT)


def test_from_the_end_one_goes_back_and_no_further_than_there_in_the_other_gear() -> None:
    who, way = entity(0.0), motion(0.0, 100.0)
    assert not way.ends(-10.0, DT)
    way.advance(who, -10.0, DT)
    assert way.advance(who, 20.0, DT) == pytest.approx(10.0)
    assert who.x == pytest.approx(100.0)


def test_from_the_end_one_does_not_go_on() -> None:
    assert motion(0.0, 100.0).ends(10.0, DT)


@given(
    st.lists(
        st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.none() | st.floats(-4.0, 4.0)),
        min_size=2,
        max_size=5,
    ),
    st.floats(0.0, 1.0),
)
def test_a_path_that_faces_ahead_is_nowhere_backwards(
    corners: list[tuple[float, float, float | None]], share: float
) -> None:
    path = Polyline([Corner(x, y, 0.0, h) for x, y, h in corners])
    near = [s for knot in path.knots() for s in (knot - 5e-5, knot, knot + 5e-5)]
    for s in (share * path.length, *near):
        if path.faces_ahead:
            assert math.cos(path.at(s).h - tangent(path, s)) > 0.0


@pytest.mark.parametrize(("heading", "ahead"), [(None, True), (0.5, True), (math.pi, False)])
def test_headings_say_whether_a_path_faces_ahead(heading: float | None, ahead: bool) -> None:
    way = motion(heading)
    assert isinstance(way.path, Polyline) and way.path.faces_ahead == ahead
    assert way.backwards() != ahead
