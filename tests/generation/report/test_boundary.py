"""Boundaries where the truth is known, and measures as a tester reads them."""

from __future__ import annotations

import numpy as np
import pytest

from generation.report.counterexamples import Measure, Region, measures, region, unit_of
from generation.space.density.roles import Role, roles_of
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter

NAMES = (
    "CutIn_Gap_m",
    "CutIn_StartSpeed_mps",
    "CutIn_EndSpeed_mps",
    "CutIn_Duration_s",
    "CutIn_StartTime_s",
    "Ego_Speed_mps",
)
SPACE = Space(tuple(Parameter(name, 1.0, 90.0) for name in NAMES))
POINT = np.array([[30.0, 20.0, 16.0, 4.0, 3.0, 25.0], [60.0, 30.0, 30.0, 2.0, 1.0, 30.0]])


def drawn(n: int = 600) -> list[Measure]:
    generator = np.random.default_rng(1)
    return [Measure(name, "m", generator.uniform(-1.0, 1.0, n)) for name in ("a", "b", "idle")]


def test_the_boundary_is_where_the_truth_has_it() -> None:
    of = drawn()
    radius = np.hypot(of[0].values, of[1].values)
    found = region(of, radius < 0.6)
    assert isinstance(found, Region)
    assert found.accuracy > 0.95
    assert found.area > 0.99
    assert set(list(found.weights)[:2]) == {0, 1}
    (chosen,) = [each for each in found.slices if {each.across, each.up} == {0, 1}]
    lines = np.concatenate(chosen.boundary)
    assert np.hypot(*lines.T) == pytest.approx(np.full(len(lines), 0.6), abs=0.08)


def test_a_boundary_ends_where_runs_end() -> None:
    of = drawn()
    found = region(of, of[0].values + of[1].values > 0.3)
    assert isinstance(found, Region)
    for each in found.slices:
        for line in each.boundary:
            assert (np.abs(line) <= 1.0).all()


def test_what_chance_decides_scores_like_chance() -> None:
    found = region(drawn(), np.random.default_rng(7).uniform(size=600) < 0.5)
    assert isinstance(found, Region)
    assert found.accuracy == pytest.approx(0.5, abs=0.06)


def test_measures_that_follow_from_another_one_are_not_drawn_over_it() -> None:
    of = drawn()
    closing = Measure("closing speed", "m/s", of[0].values - 7.3)
    found = region([of[0], closing, of[1]], of[0].values + of[1].values > 0.3)
    assert isinstance(found, Region)
    assert [{each.across, each.up} for each in found.slices] in ([{0, 2}], [{1, 2}])
    assert region([of[0], closing], of[0].values > 0.3) == (
        "all measures that vary follow from one: there is nothing to draw over two"
    )


def test_too_few_failures_have_no_boundary() -> None:
    assert (
        region(drawn(), np.arange(600) < 5)
        == "600 runs, 5 failures: a boundary needs 20 that fail and 20 that do not"
    )
    assert "one measure" in str(region(drawn()[:1], drawn()[0].values > 0.0))


def test_measures_are_those_of_a_tester() -> None:
    found = {each.name: each for each in measures(SPACE, roles_of(SPACE.names), POINT)}
    np.testing.assert_allclose(found["closing speed"].values, [5.0, 0.0])
    np.testing.assert_allclose(found["time headway"].values, [30.0 / 25.0, 2.0])
    np.testing.assert_allclose(found["acceleration of CutIn"].values, [-1.0, 0.0])
    np.testing.assert_allclose(found["duration of the manoeuvre"].values, [4.0, 2.0])
    assert found["speed of the ego"].unit == "m/s"
    assert not any("Time_s" in name for name in found), "when a scene begins is no measure"


def test_where_the_ego_acts_it_is_the_one_behind() -> None:
    names = ("Ego_Gap_m", "Ego_StartSpeed_mps", "Lead_Speed_mps")
    space = Space(tuple(Parameter(name, 1.0, 90.0) for name in names))
    found = {
        each.name: each.values[0]
        for each in measures(space, roles_of(names), np.array([[30.0, 25.0, 20.0]]))
    }
    assert (found["closing speed"], found["time headway"]) == (5.0, pytest.approx(1.2))
    assert found["speed of the leader"] == 20.0


def test_what_has_no_role_is_a_measure_itself() -> None:
    space = Space(
        (Parameter("Overlap_percent", 0.0, 100.0), Parameter("Ego_speed_kph", 10.0, 60.0))
    )
    found = measures(
        space, {"Ego_speed_kph": Role("Ego", "ego_speed", 3.6)}, np.array([[50.0, 36.0]])
    )
    assert [(each.name, each.unit) for each in found] == [
        ("Overlap_percent", "percent"),
        ("Ego_speed_kph", "km/h"),
    ]
    assert unit_of("speed") == ""
