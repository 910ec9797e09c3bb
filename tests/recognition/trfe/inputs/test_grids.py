"""Occupancy grids: who and what is drawn where."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.trfe.inputs.grids import Grid, covered, rasterise
from schemas.common.errors import UsageError
from tests.recognition.built_scenes import STEP, Driver, recording
from xodr.builders import straight_highway
from xodr.reader import load

SMALL = Grid(
    length=40.0,
    width=20.0,
    cell_length=1.0,
    cell_width=1.0,
    channels=("others", "ego"),
    pose="window",
)
EGO = Driver("ego", speed=10.0)
NOW = [("ego", 2.0)]


def test_boxes_fill_the_cells_that_they_cover_left_is_up_and_ahead_is_to_the_right():
    there = Driver("there", 10.0 + 20.0, 5.0)  # at 2 s 10 m ahead of the ego and 5 m to its left
    (window,) = rasterise(recording([EGO, there]), NOW, SMALL)
    others, ego = window[1, 0], window[:, 1]
    expected = np.zeros((20, 40))
    expected[4:6, 28:32] = 255
    assert (others == expected).all()
    assert (np.nonzero(ego[1].any(axis=0))[0].mean() + 0.5) == pytest.approx(
        20.0 - 3.0, abs=0.51
    )  # at 1.7 s, the nearest frame


def test_the_ego_moves_through_grids_of_the_window_and_stays_in_grids_of_the_frame():
    columns = {}
    for pose in ("window", "frame"):
        grid = Grid(40.0, 20.0, 1.0, 1.0, channels=("ego",), pose=pose)
        (window,) = rasterise(recording([EGO]), NOW, grid)
        columns[pose] = [
            float(np.average(np.arange(40) + 0.5, weights=frame[0].sum(axis=0))) - 20.0
            for frame in window
        ]
    frames = [
        1.2,
        1.7,
        2.2,
        2.7,
    ]  # nearest to 1.25, 1.75, 2.25, 2.75 s, the earlier of two that are equally near
    assert columns["window"] == pytest.approx([10.0 * (time - 2.0) for time in frames], abs=1.01)
    assert columns["window"] == sorted(columns["window"])
    assert columns["frame"] == pytest.approx([0.0] * 4, abs=1e-6)


@given(
    st.floats(-3.2, 3.2),
    st.floats(-12.0, 12.0),
    st.floats(-5.0, 5.0),
    st.sampled_from([0.5, 1.0, 2.0]),
)
def test_the_drawn_area_is_the_boxs_whatever_its_heading(h, x, y, cell):
    grid = Grid(40.0, 20.0, cell, cell, channels=("others",))
    (window,) = rasterise(recording([Driver("ego"), Driver("there", x, y, h)]), NOW, grid)
    assert window[0].sum() / 255.0 * cell**2 == pytest.approx(8.0, rel=0.1)


@settings(max_examples=25)
@given(st.floats(-3.2, 3.2), st.floats(-500.0, 500.0), st.floats(-500.0, 500.0))
def test_where_the_world_has_its_origin_and_axes_makes_no_difference(turn, x, y):
    scene = [EGO, Driver("one", 12.3, 2.1, 0.4, 7.0), Driver("two", -3.2, -4.4, -1.0, 3.0)]
    grid = Grid(40.0, 20.0, 2.0, 1.0, channels=("others", "ego", "velocity_x", "velocity_y"))
    here, there = (
        rasterise(recording(scene, *moved), NOW, grid).astype(int) for moved in ((), (turn, (x, y)))
    )
    far = np.abs(here - there) > 64  # rounding moves single points into the next cell
    assert far.mean() < 0.002


def test_velocities_are_relative_to_the_egos_in_steps_of_a_quarter():
    scene = [
        EGO,
        Driver("ahead", 25.0, 0.0, 0.0, 8.0),
        Driver("crossing", 20.0, -16.0, np.pi / 2, 6.0),
    ]
    grid = Grid(40.0, 20.0, 1.0, 1.0, channels=("others", "velocity_x", "velocity_y"))
    (window,) = rasterise(recording(scene), NOW, grid)
    codes = {
        (int(x), int(y)) for x, y in zip(window[:, 1].ravel(), window[:, 2].ravel(), strict=True)
    }
    assert codes == {(0, 0), (128 - 8, 128), (128 - 40, 128 + 24)}
    (window,) = rasterise(
        recording(scene), NOW, Grid(40.0, 20.0, 1.0, 1.0, channels=("speed", "ego"))
    )
    assert set(window[:, 0].ravel().tolist()) == {0, 40}
    assert ((window[:, 0] > 0) == (window[:, 1] > 0)).all()


def test_only_those_are_drawn_who_are_there_in_that_frame():
    scene = [EGO, Driver("leaving", 25.0, 5.0, end=1.5), Driver("coming", 25.0, -5.0, start=2.5)]
    (window,) = rasterise(recording(scene), NOW, SMALL)
    above, below = window[:, 0, :10].any(axis=(1, 2)), window[:, 0, 10:].any(axis=(1, 2))
    assert above.tolist() == [True, False, False, False]
    assert below.tolist() == [False, False, False, True]


def test_grids_that_nobody_is_in_are_empty():
    assert not rasterise(
        recording([EGO]),
        NOW,
        Grid(10.0, 10.0, 1.0, 1.0, ahead=50.0, channels=("others", "ego", "speed")),
    ).any()


def test_each_window_is_drawn_the_same_alone_and_among_many():
    scene = recording(
        [
            EGO,
            *(Driver(str(k), 7.0 * k - 30.0, 3.0 * (k % 3) - 3.0, 0.1 * k, 9.0) for k in range(10)),
        ]
    )
    rng = np.random.default_rng(1)
    moments = [
        (name, float(time))
        for name, time in zip(
            rng.choice(list(scene.tracks), 600), rng.uniform(1, 3, 600), strict=True
        )
    ]
    together = rasterise(scene, moments, SMALL)
    for k in (0, 7, 299, 599):
        assert (rasterise(scene, [moments[k]], SMALL)[0] == together[k]).all()


def test_the_road_shows_in_its_channels(tmp_path):
    path = tmp_path / "highway.xodr"
    path.write_bytes(straight_highway(lanes=2, opposite_lanes=2, length=300.0).to_xml())
    network = load(path)
    x, y, *_, h = network.pose(network.lane_point("1", -1, 150.0))[:4]
    width = network.roads["1"].lane_width(150.0, -1)
    scene = recording([Driver("ego", x, y, h)])
    grid = Grid(20.0, 20.0, 1.0, 0.5, channels=("area", "borders"))
    (window,) = rasterise(scene, NOW, grid, SimpleNamespace(network=network))
    assert (window[0] == window[3]).all()
    area, borders = window[0, 0, :, 10], window[0, 1, :, 10].astype(float)
    assert area[20] == 255
    assert area[-1] == 0  # 10 m to the right there is no lane
    across = 10.0 - 0.5 * (np.arange(40) + 0.5)
    left, right = (
        across[side][borders[side].argmax()]
        for side in ((across > 0) & (across < width), (across < 0) & (across > -width))
    )
    assert (left, right) == pytest.approx((width / 2, -width / 2), abs=0.5)
    with pytest.raises(UsageError, match="need the site's road"):
        rasterise(scene, NOW, grid)


def test_times_that_the_egos_track_does_not_cover_are_refused():
    scene = recording([EGO, Driver("late", start=3.0)])
    assert covered(
        scene, [("ego", 2.0), ("ego", 0.0), ("late", 2.0), ("ego", 3.3)], SMALL.offsets
    ).tolist() == [
        True,
        False,
        False,
        True,
    ]
    with pytest.raises(UsageError, match="'late' does not cover"):
        rasterise(scene, [*NOW, ("late", 2.0)], SMALL)
    with pytest.raises(UsageError, match="no track 'nobody'"):
        rasterise(scene, [("nobody", 2.0)], SMALL)
    assert rasterise(scene, [], SMALL).shape == (0, *SMALL.shape)


def test_a_gap_of_a_few_frames_in_the_egos_track_is_bridged_by_the_nearest():
    scene = recording([EGO])
    columns = scene.tracks["ego"].columns
    kept = np.abs(columns["time"] - 1.2) > 1.5 * STEP
    scene.tracks["ego"].columns = {name: values[kept] for name, values in columns.items()}
    assert covered(scene, NOW, SMALL.offsets).all()
    assert rasterise(scene, NOW, SMALL)[0, :, 1].any(axis=(1, 2)).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"length": 0.0},
        {"cell_width": float("inf")},
        {"channels": ("others", "height")},
        {"channels": ()},
        {"pose": "x"},
        {"frames": 1},
    ],
)
def test_impossible_grids_are_refused(wrong):
    with pytest.raises(UsageError, match="grid"):
        Grid(**wrong)
