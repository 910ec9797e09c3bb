"""The motion that seven parameters stand for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.labels.maneuvers.estimation import reconstruct
from recognition.labels.maneuvers.parameters import PARAMETERS
from tests.recognition.labels.maneuvers.runs import STEP, recorded

SMALL = 1e-5
LEAST = {"start_time": 0.5, "rest_time": 0.5}
"""Phases of so many seconds have speeds that differences of `SMALL` seconds tell"""
Row = st.tuples(
    *(
        st.floats(max(each.low, LEAST.get(role, 0.0)), each.high)
        for role, each in PARAMETERS.items()
    )
)


@given(Row, st.sampled_from([-3.75, 0.0, 3.5]))
def test_speeds_at_the_ends_of_the_phases_are_the_parameters(
    values: tuple[float, ...], shift: float
) -> None:
    _, start, before, end, duration, final, rest = values
    edges = np.array([-before, 0.0, duration, duration + rest])
    for edge, sign, speed in zip(edges, (1, -1, 1, -1), (start, start, end, final), strict=True):
        way, _ = reconstruct(np.array(values), shift, np.array([edge, edge + sign * SMALL]))
        assert (way[1] - way[0]) / (sign * SMALL) == pytest.approx(speed, abs=1e-3)
    _, aside = reconstruct(np.array(values), shift, edges)
    np.testing.assert_allclose(aside, [0.0, 0.0, shift, shift], atol=1e-12)


def test_a_scene_may_begin_and_end_with_the_manoeuvre() -> None:
    way, aside = reconstruct(
        np.array([20.0, 30.0, 0.0, 20.0, 4.0, 25.0, 0.0]), 3.5, np.array([0.0, 2.0, 4.0])
    )
    np.testing.assert_allclose(way, [0.0, 55.0, 100.0])
    np.testing.assert_allclose(aside, [0.0, 1.75, 3.5])


def test_the_reconstruction_is_what_the_scenario_scripts(tmp_path: Path) -> None:
    values = (20.0, 27.0, 3.0, 25.0, 5.0, 30.0, 6.0)
    motion = recorded(
        "cut_in_highway", "highway_straight", "CutIn", values, tmp_path, Ego_Speed_mps=25.0
    )
    scene = motion.scene
    rows = np.flatnonzero(scene.track == scene.names.index("CutIn"))
    start = rows[round(3.0 / STEP)]
    way, aside = reconstruct(np.array(values), -3.75, scene.time[rows] - 3.0)
    np.testing.assert_allclose(
        motion.longitudinal[rows] - motion.longitudinal[start], way, atol=0.25
    )
    np.testing.assert_allclose(motion.lateral[rows] - motion.lateral[start], aside, atol=0.08)
