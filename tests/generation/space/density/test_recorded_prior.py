"""The prior of recordings: conditioned, within limits, without clipping."""

from __future__ import annotations

import numpy as np
import pytest

from generation.space import SpaceChoice
from generation.space.density.marginals import DeclaredPrior, JointPrior, uniform
from generation.space.density.prior import Box, Limits, RecordedPrior, quantities
from generation.space.density.roles import BEHIND, EGO_SPEED, Role
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import PARAMETERS
from schemas.common.errors import UsageError

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
ROWS, FEW = slice(None, None, 8), slice(None, None, 80)


def prior(density: str = "kde", rows: slice = ROWS, **pinned: str) -> tuple[RecordedPrior, Space]:
    samples = of_recordings(None, "cut_in")
    space = Space.of(CUT_IN, SpaceChoice(pinned=pinned))
    return of_samples(samples.where(np.arange(len(samples.theta))[rows]), space).prior(
        space, density
    ), space


def test_the_speed_of_the_ego_is_searched_and_times_before_and_after_are_nuisances() -> None:
    found, space = prior()
    assert "Ego_Speed_mps" in found.searched
    assert found.nuisances == ("CutIn_StartTime_s", "CutIn_RestTime_s")
    assert found.names == space.names
    assert len(found.theta) == len(found.recordings) > 300


@pytest.mark.parametrize("density", ["kde", "mixture", "gaussian"])
def test_draws_need_no_clipping_and_are_possible(density: str) -> None:
    found, space = prior(density)
    drawn = found.sample(500, np.random.default_rng(0))
    assert drawn.shape == (500, 8)
    assert found.possible(drawn).all()
    searched = found.columns(found.searched)
    assert not (np.isclose(drawn, space.low) | np.isclose(drawn, space.high))[:, searched].any()
    assert np.isfinite(found.log_density(drawn)).all()
    assert found.foreseeable(drawn).mean() > 0.9


def test_the_density_integrates_to_one_over_what_is_possible() -> None:
    found, space = prior(
        "gaussian",
        CutIn_FinalSpeed_mps="25",
        CutIn_EndSpeed_mps="25",
        CutIn_RestTime_s="5",
        CutIn_StartTime_s="3",
    )
    theta = space.draw(200_000, np.random.default_rng(0))
    volume = float(np.prod(space.high - space.low))
    assert np.exp(found.log_density(theta)).mean() * volume == pytest.approx(1.0, abs=0.05)


def test_what_is_pinned_moves_what_is_drawn() -> None:
    slow, _ = prior(Ego_Speed_mps="14")
    fast, _ = prior(Ego_Speed_mps="30")
    speeds = [each.sample(300, np.random.default_rng(0))[:, 1].mean() for each in (slow, fast)]
    assert speeds[0] < 18 < 25 < speeds[1]


@pytest.mark.slow
def test_a_flow_can_not_be_conditioned_and_pins_at_zero_have_no_density() -> None:
    found, _ = prior("flow", FEW, Ego_Speed_mps="14")
    with pytest.raises(UsageError, match="flow can't be conditioned"):
        assert found.limit


def test_what_is_outside_is_neither_possible_nor_foreseeable() -> None:
    found, space = prior()
    drawn = found.sample(50, np.random.default_rng(1))
    violent = drawn.copy()
    violent[:, 4], violent[:, 3] = 1.0, np.minimum(drawn[:, 1] + 9.0, space.high[3])
    below = drawn.copy()
    below[:, 0] = space.low[0] - 1.0
    for rows in (violent, below):
        assert not found.possible(rows).any()
        assert not found.foreseeable(rows).any()
        assert np.isneginf(found.log_density(rows)).all()


def test_about_all_recorded_units_are_foreseeable_and_hardly_anything_drawn_anywhere() -> None:
    found, space = prior()
    assert found.foreseeable(found.theta).mean() > 0.97
    assert found.foreseeable(space.draw(500, np.random.default_rng(0))).mean() < 0.3


def test_accelerations_follow_from_speeds_and_times() -> None:
    found = quantities(
        {
            "start_speed": np.array([20.0, 20.0]),
            "end_speed": np.array([16.0, 24.0]),
            "final_speed": np.array([16.0, 14.0]),
            "duration": np.array([2.0, 4.0]),
            "rest_time": np.array([0.5, 5.0]),
        }
    )
    assert found["deceleration"].tolist() == [2.0, 2.0]
    assert found["acceleration"].tolist() == [0.0, 1.0]
    assert found["jerk"].tolist() == [0.0, pytest.approx(3.0 / 4.5)]
    assert found["lateral acceleration"][0] == pytest.approx(0.5 * np.pi**2 * 3.5 / 4.0)


def test_a_jerk_that_traffic_does_not_have_is_not_possible() -> None:
    """Braking and accelerating within the limits of each, one right after the other."""
    units = of_recordings(None, "cut_in")
    limits = Limits.of(dict(zip(PARAMETERS, units.theta.T, strict=True)))
    most, duration, rest = limits.most, 4.0, 1.0
    braked, regained = -0.9 * most["deceleration"], 0.9 * most["acceleration"]
    values = {
        "start_speed": 30.0,
        "end_speed": 30.0 + braked * duration,
        "duration": duration,
        "rest_time": rest,
    }
    jerky = values | {"final_speed": values["end_speed"] + regained * rest}
    gentle = values | {"final_speed": values["end_speed"] + braked * rest}
    alone, other = (
        {name: np.array([value]) for name, value in each.items()} for each in (jerky, gentle)
    )
    exceeded = [name for name, found in quantities(alone).items() if found[0] > most[name]]
    assert exceeded == ["jerk"]
    assert (limits.kept(alone)[0], limits.kept(other)[0]) == (False, True)


def test_a_jerk_at_the_onset_that_traffic_does_not_have_is_not_possible() -> None:
    limits = Limits.of({"jerk": np.linspace(0.1, 4.0, 1001)})
    assert limits.kept({"jerk": np.array([3.9, 4.1])}).tolist() == [True, False]


def followed(**pinned: float) -> tuple[RecordedPrior, np.ndarray]:
    """A prior of followers who keep half a second and more, and their headways."""
    generator = np.random.default_rng(0)
    speeds, headways = (
        generator.uniform(10.0, 30.0, 2000),
        0.5 + generator.lognormal(0.0, 0.5, 2000),
    )
    values = {"Gap": headways * speeds, "Speed": speeds}
    searched = {
        name: limits
        for name, limits in {"Gap": (0.5, 150.0), "Speed": (5.0, 45.0)}.items()
        if name not in pinned
    }
    low, high = np.array(list(searched.values())).T
    roles = {"Gap": Role("Follower", BEHIND), "Speed": Role("Ego", EGO_SPEED)}
    return RecordedPrior(
        Box(tuple(searched), low, high, pinned),
        values,
        np.arange(2000).astype(np.str_),
        roles,
        "gaussian",
    ), headways


def test_nobody_is_followed_more_closely_than_recorded_followers_do() -> None:
    found, headways = followed()
    drawn = found.sample(4000, np.random.default_rng(1))
    behind = drawn[:, 0] / drawn[:, 1]
    assert found.left_out == 2
    assert behind.min() > np.sort(headways)[1]
    assert np.quantile(behind, 0.01) == pytest.approx(np.quantile(headways, 0.01), abs=0.05)
    tailgating = np.stack([0.4 * drawn[:, 1], drawn[:, 1]], axis=1)
    assert not found.possible(tailgating).any()
    assert np.isneginf(found.log_density(tailgating)).all()


@pytest.mark.parametrize("pinned", [{}, {"Speed": 20.0}, {"Gap": 30.0}])
def test_a_density_of_gaps_behind_integrates_to_one(pinned: dict[str, float]) -> None:
    found, _ = followed(**pinned)
    theta = np.random.default_rng(2).uniform(found.low, found.high, (200_000, len(found.names)))
    assert np.exp(found.log_density(theta)).mean() * np.prod(
        found.high - found.low
    ) == pytest.approx(1.0, abs=0.05)


def test_what_is_likely_and_far_from_any_recording_is_not_foreseeable() -> None:
    found, _ = prior("gaussian")
    drawn = found.sample(2000, np.random.default_rng(0))
    likely = found.log_density(drawn) + np.log(found.possible_share) >= found.limit
    far = likely & ~found.foreseeable(drawn)
    assert 0 < far.sum() < 0.1 * len(drawn)


def test_densities_of_resampled_recordings_differ_most_where_little_is_recorded() -> None:
    found, _ = prior("gaussian")
    drawn = found.sample(1000, np.random.default_rng(0))
    order = np.argsort(found.log_density(drawn))
    stated = DeclaredPrior({"x": uniform(0.0, 1.0)}, None)
    both = JointPrior((*found.names, "x"), (found, stated), lambda rows: np.ones(len(rows), bool))
    wider = np.hstack([drawn, np.full((len(drawn), 1), 0.5)])
    np.testing.assert_array_equal(
        both.log_ratios(wider, 8, np.random.default_rng(1)),
        found.log_ratios(drawn, 8, np.random.default_rng(1)),
        "a stated parameter beside recorded ones takes nothing of the uncertainty",
    )
    ratios = found.log_ratios(drawn, 8, np.random.default_rng(1))
    np.testing.assert_array_equal(ratios, found.log_ratios(drawn, 8, np.random.default_rng(1)))
    assert ratios.shape == (8, 1000) and np.isfinite(ratios).all()
    rare, common = (
        ratios[:, order[:50]].std(axis=0).mean(),
        ratios[:, order[-50:]].std(axis=0).mean(),
    )
    assert rare > 1.5 * common > 0.0
