"""From bumpers to vehicles, and who is where among them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity, box

from recognition.recorder.recorder import ABSENT, Traffic
from recognition.recorder.simulation import STEPS, Fronts, VehicleMotion, motion, overlaps

LENGTH = 5.0


def fronts(x: np.ndarray, y: np.ndarray, h: float) -> Fronts:
    steps = np.arange(len(x)) + 600
    return Fronts(np.zeros(len(x), np.int64), steps, x, y, np.full(len(x), h))


@pytest.mark.parametrize("rate", [10, 25])
def test_steady_motion_stays_as_it_is(rate: int) -> None:
    time = np.arange(0, 8 * STEPS) / STEPS
    moving = motion(fronts(20.0 * time, np.full(len(time), 3.0), 0.0), [LENGTH], rate)
    assert moving.frame[0] == 60 * rate
    assert moving.x == pytest.approx(20.0 * (moving.frame / rate - 60.0) - 0.5 * LENGTH)
    assert moving.y == pytest.approx(3.0)
    assert moving.h == pytest.approx(0.0)
    assert moving.vx == pytest.approx(20.0)
    assert moving.ax == pytest.approx(0.0, abs=1e-6)


def test_in_a_circle_the_axles_follow_each_other_and_the_box_stays_near_the_lane() -> None:
    radius, speed = 15.0, 6.0
    angle = speed / radius * np.arange(0, 20 * STEPS) / STEPS
    moving = motion(fronts(radius * np.cos(angle), radius * np.sin(angle), np.pi / 2), [LENGTH], 10)
    steady = slice(60, -60)
    assert np.hypot(moving.x, moving.y)[steady] == pytest.approx(radius, abs=0.4)
    assert np.hypot(moving.vx, moving.vy)[steady] == pytest.approx(speed, rel=0.03)
    rear = np.stack(
        [moving.x - 0.3 * LENGTH * np.cos(moving.h), moving.y - 0.3 * LENGTH * np.sin(moving.h)]
    )
    velocity = np.gradient(rear, axis=1)
    aside = velocity[1] * np.cos(moving.h) - velocity[0] * np.sin(moving.h)
    assert np.abs(aside[steady]).max() < 1e-3  # the rear axle does not slip


def test_who_stands_keeps_the_heading() -> None:
    x = np.concatenate([np.linspace(0.0, 20.0, 40), np.full(40, 20.0)])
    y = np.concatenate([np.linspace(0.0, 20.0, 40), np.full(40, 20.0)])
    moving = motion(fronts(x, y, np.pi / 4), [LENGTH], 25)
    assert moving.h == pytest.approx(np.pi / 4)
    assert np.hypot(moving.vx, moving.vy)[-25:] == pytest.approx(0.0, abs=1e-6)


places = st.tuples(
    st.floats(-6, 6), st.floats(-6, 6), st.floats(-4, 4), st.floats(1, 8), st.floats(0.5, 3)
)


@given(st.lists(places, min_size=2, max_size=6))
def test_overlaps_are_those_of_polygons(
    boxes: list[tuple[float, float, float, float, float]],
) -> None:
    x, y, h, length, width = np.array(boxes).T
    zero = np.zeros(len(x))
    still = VehicleMotion(
        np.arange(len(x)), np.zeros(len(x), np.int64), x, y, h, zero, zero, zero, zero
    )
    outlines = [
        affinity.translate(
            affinity.rotate(box(-a / 2, -b / 2, a / 2, b / 2), turn, (0, 0), use_radians=True),
            left,
            up,
        )
        for left, up, turn, a, b in boxes
    ]
    found = {frozenset(pair) for pair in np.stack(overlaps(still, length, width), axis=1).tolist()}
    for i in range(len(x)):
        for j in range(i):
            shared = outlines[i].intersection(outlines[j]).area
            if shared > 1e-6:
                assert frozenset((i, j)) in found
            elif outlines[i].distance(outlines[j]) > 1e-6:
                assert frozenset((i, j)) not in found


def test_vehicles_of_other_frames_do_not_overlap() -> None:
    zero = np.zeros(2)
    still = VehicleMotion(np.arange(2), np.arange(2), zero, zero, zero, zero, zero, zero, zero)
    assert not len(overlaps(still, np.full(2, 5.0), np.full(2, 2.0))[0])


def test_neighbours_beside_are_told_from_those_ahead_and_behind() -> None:
    #          ego   alongside  ahead  behind  own lead  another frame
    frame = np.array([1, 1, 1, 1, 1, 2])
    lane = np.array([2, 3, 3, 3, 2, 3])
    along = np.array([0.0, 3.0, 30.0, -40.0, 20.0, 1.0])
    traffic = Traffic(frame, lane, along, np.full(6, 5.0))
    preceding, alongside, following = traffic.beside(1)
    assert (preceding[0], alongside[0], following[0]) == (2, 1, 3)
    assert traffic.ahead()[0] == 4 and traffic.behind()[4] == 0
    assert {int(rows[0]) for rows in traffic.beside(-1)} == {ABSENT}
    assert traffic.ahead()[5] == ABSENT


def test_a_lorry_beside_two_cars_has_nobody_of_them_ahead_or_behind() -> None:
    traffic = Traffic(
        np.ones(3, np.int64),
        np.array([1, 2, 2]),
        np.array([0.0, -4.0, 4.0]),
        np.array([16.0, 4.0, 4.0]),
    )
    preceding, alongside, following = traffic.beside(1)
    assert preceding[0] == ABSENT and following[0] == ABSENT and alongside[0] in (1, 2)
