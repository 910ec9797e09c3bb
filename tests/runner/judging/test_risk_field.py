"""The probabilistic risk field: its limits, and that it grows with what is riskier."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

import runner
from runner.engine.participants.declaration import BoundingBox
from runner.judging.measures.criticality import criticality
from runner.judging.measures.relations import MotionRows
from runner.judging.measures.risk_field import FieldParameters, _inside, risk_field
from tests.commands import Command

CAR = BoundingBox(1.35, 0.0, 0.75, 4.5, 1.8, 1.5)
CUT_IN = Path(__file__).parents[3] / "xosc" / "library" / "cut_in_highway.xosc"


def car(
    x: float | list[float], y: float = 0.0, speed: float | list[float] = 25.0, h: float = 0.0
) -> MotionRows:
    """A car at places x, one an instant."""
    places = np.atleast_1d(np.asarray(x, float))
    n = len(places)
    zero = np.zeros(n)
    columns = {
        "time": np.arange(n) * 0.1,
        "x": places,
        "y": zero + y,
        "z": zero,
        "h": zero + h,
        "speed": zero + speed,
    }
    return MotionRows.from_columns(
        "car", CAR, {**columns, "road_id": [None] * n, "s": zero, "t": zero}
    )


def field(
    gap: float, closing: float = 0.0, aside: float = 0.0, parameters: FieldParameters | None = None
) -> tuple[float, float]:
    """Probability and risk of a car so far ahead (m) of an ego at 25 m/s that
    closes in on it (m/s).
    """
    found = risk_field(
        car(0.0), car(4.5 + gap, aside, 25.0 - closing), parameters or FieldParameters()
    )
    return float(found.probability[0]), float(found.risk[0])


def test_boxes_that_touch_have_collided() -> None:
    assert field(0.0, 3.0)[0] == 1.0
    assert field(-2.0, 3.0) == (1.0, pytest.approx(0.5 * 1500.0 * 0.25 * 9.0 / 1000.0))


def test_far_away_there_is_no_risk() -> None:
    assert field(300.0, 10.0) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.0, abs=1e-12))
    assert field(20.0, 10.0, aside=15.0)[0] == pytest.approx(0.0, abs=1e-12)


def test_without_doubt_it_is_known_who_is_hit() -> None:
    sure = FieldParameters(along=0.0, across=0.0)
    assert field(20.0, 10.0, parameters=sure)[0] == 1.0, "in 2 s"
    assert field(40.0, 10.0, parameters=sure)[0] == 0.0, "in 4 s, further ahead than is looked"
    assert field(20.0, 10.0, aside=2.0, parameters=sure)[0] == 0.0, "beside"
    assert field(20.0, -1.0, parameters=sure)[0] == 0.0, "drives away"


def test_one_who_cuts_across_is_hit() -> None:
    sure = FieldParameters(along=0.0, across=0.0)
    crossing = risk_field(car(0.0), car(25.0, -10.0, 10.0, np.pi / 2), sure)
    assert crossing.probability[0] == 1.0, "both are there in a second"
    assert risk_field(car(0.0), car(25.0, -10.0, 10.0, -np.pi / 2), sure).probability[0] == 0.0


@pytest.mark.parametrize("aside", [0.0, 1.0])
def test_risk_falls_with_the_gap_and_grows_with_closing_speed(aside: float) -> None:
    for closing in (0.0, 2.0, 5.0, 10.0):
        found = np.array([field(gap, closing, aside) for gap in np.linspace(1.0, 60.0, 30)])
        assert (np.diff(found, axis=0) <= 1e-12).all()
    for gap in (5.0, 15.0, 30.0):
        found = np.array([field(gap, closing, aside) for closing in np.linspace(0.0, 10.0, 20)])
        assert (np.diff(found, axis=0) >= -1e-12).all()


def test_risk_falls_with_the_distance_aside_and_is_the_same_on_both_sides() -> None:
    found = np.array([field(15.0, 5.0, aside) for aside in np.linspace(0.0, 6.0, 20)])
    assert (np.diff(found, axis=0) <= 1e-12).all()
    for aside in (0.5, 2.0, 3.5):
        assert field(15.0, 5.0, aside) == pytest.approx(field(15.0, 5.0, -aside))


def test_probability_is_that_of_draws() -> None:
    parameters, generator = FieldParameters(), np.random.default_rng(0)
    along, across = generator.normal(0.0, (1.5, 0.3), (200_000, 2)).T
    shares = []
    for time in parameters.times:
        x, y = 4.5 + 12.0 - 3.0 * time + 0.5 * along * time**2, 2.5 + 0.5 * across * time**2
        shares.append(((np.abs(x) < 4.5) & (np.abs(y) < 1.8)).mean())
    assert field(12.0, 3.0, 2.5)[0] == pytest.approx(max(shares), abs=3e-3)


def test_a_run_has_the_greatest_of_both_and_can_fail_by_them(command: Command) -> None:
    result = runner.run(CUT_IN, sut="cas", world="kinematic")
    assert result.criticality is not None
    summary = result.criticality.summary
    probability, risk = summary["max_collision_probability"], summary["max_risk_field"]
    assert 0.0 < probability["value"] <= 1.0
    assert risk["other"] == probability["other"] == "CutIn"
    answer = command(
        "xosc-run",
        "--world",
        "kinematic",
        CUT_IN,
        "--fail-if",
        "max_collision_probability>0.000001",
    )
    assert answer.code == 1
    assert "max_collision_probability is" in answer.out
    assert (
        command("xosc-run", "--world", "kinematic", CUT_IN, "--fail-if", "max_risk_field>1000").code
        == 0
    )


def test_who_meets_nobody_has_no_field() -> None:
    assert criticality(car([0.0, 2.5]), []).summary["max_risk_field"] is None


@given(
    st.lists(st.tuples(st.floats(-200.0, 200.0), st.floats(0.01, 20.0)), min_size=1, max_size=5),
    st.one_of(st.just(0.0), st.floats(1e-6, 100.0)),
)
def test_probabilities_are_those_of_the_normal_distribution(
    places: list[tuple[float, float]], deviation: float
) -> None:
    mean, half = np.array(places).T
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        expected = norm.cdf(half, mean, max(deviation, 1e-300)) - norm.cdf(
            -half, mean, max(deviation, 1e-300)
        )
    assert _inside(mean, half, deviation) == pytest.approx(expected, abs=1e-14)
