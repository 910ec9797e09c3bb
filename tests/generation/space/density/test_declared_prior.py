"""Priors that are stated: distributions of the standard, ranges, and both beside recordings."""

from __future__ import annotations

import numpy as np
import pytest

from generation.space import SpaceChoice
from generation.space.density.marginals import Choices, Marginal, marginal, uniform
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples, of_statements
from generation.space.space import Space
from schemas.common.errors import UsageError
from xosc.distributions import (
    DistributionRange,
    DistributionSet,
    Histogram,
    HistogramBin,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    Range,
    UniformDistribution,
)

SIMPLE = SCENARIOS / "simple_cut_in.xosc"


def density(of: object) -> Marginal:
    found = marginal(of, "P")
    assert not isinstance(found, str)
    return found


@pytest.mark.parametrize(
    ("of", "low", "high", "mean"),
    [
        (DistributionRange(Range(10.0, 60.0), 5.0), 10.0, 60.0, 35.0),
        (UniformDistribution(Range(-3.0, 1.0)), -3.0, 1.0, -1.0),
        (NormalDistribution(20.0, 4.0, Range(18.0, 22.0)), 18.0, 22.0, 20.0),
        (NormalDistribution(20.0, 4.0), 12.56, 27.44, 20.0),
        (LogNormalDistribution(5.0, 1.0), 2.348, 10.24, 5.0),
        (
            Histogram((HistogramBin(Range(0.0, 1.0), 1.0), HistogramBin(Range(2.0, 4.0), 3.0))),
            0.0,
            4.0,
            2.375,
        ),
    ],
)
def test_continuous_distributions_are_densities(
    of: object, low: float, high: float, mean: float
) -> None:
    found = density(of)
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.01)
    points = np.linspace(found.low, found.high, 200_001)
    step = (found.high - found.low) / 200_000
    values = np.exp(found.log_density(points))
    assert values.sum() * step == pytest.approx(1.0, abs=1e-3)
    drawn = found.sample(4000, np.random.default_rng(0))
    assert ((drawn >= found.low) & (drawn <= found.high)).all()
    assert drawn.mean() == pytest.approx(mean, abs=0.1 * (found.high - found.low))
    assert np.isneginf(found.log_density(np.array([found.low - 1.0, found.high + 1.0]))).all()


def test_counts_and_numbers_are_choices_and_words_are_categories() -> None:
    counts = density(PoissonDistribution(3.0, Range(1.0, 5.0)))
    assert counts.choices == (1.0, 2.0, 3.0, 4.0, 5.0)
    sides = density(ProbabilityDistributionSet((("1", 3.0), ("-1", 1.0))))
    assert sides == Choices((-1.0, 1.0), (1.0, 3.0))
    assert set(sides.sample(50, np.random.default_rng(0))) == {-1.0, 1.0}
    assert np.exp(sides.log_density(np.array([0.9]))) / np.exp(
        sides.log_density(np.array([-0.9]))
    ) == pytest.approx(3.0)
    models = ProbabilityDistributionSet((("car", 1.0), ("truck", 2.0), ("bus", 0.0), ("car", 1.5)))
    words = {0.0: {"P": "car"}, 1.0: {"P": "truck"}}
    assert density(models) == Choices((0.0, 1.0), (2.5, 2.0), words)
    assert density(DistributionSet(("02", "1"))).follows == {1.0: {"P": "1"}, 2.0: {"P": "02"}}
    assert marginal(DistributionSet(("car", "car")), "P") == "car"
    assert marginal(NormalDistribution(3.0, 0.0), "P") == "3.0"
    with pytest.raises(UsageError, match="no density"):
        marginal(object(), "P")


def test_choices_become_the_nearest_value_in_files() -> None:
    space = Space.of(
        SIMPLE,
        SpaceChoice(marginals={"CutIn_Gap_m": Choices((10.0, 12.5), (1.0, 1.0))}, default=False),
    )
    assert space.names == ("CutIn_Gap_m",)
    assert [space.values([value])["CutIn_Gap_m"] for value in (10.9, 11.6)] == ["10", "12.5"]


def test_what_is_stated_is_a_prior_within_the_constraints_of_the_scenario() -> None:
    stated = {
        "CutIn_Gap_m": uniform(2.0, 70.0),
        "CutIn_Speed_mps": density(NormalDistribution(20.0, 9.0)),
    }
    space = Space.of(SIMPLE, SpaceChoice(marginals=stated, default=False))
    recorded = of_statements(stated, space)
    prior = recorded.prior(space, "kde")
    drawn = prior.sample(300, np.random.default_rng(1))
    assert prior.possible(drawn).all() and space.admits(drawn).all()
    assert prior.foreseeable(drawn).mean() > 0.95
    gap = space.names.index("CutIn_Gap_m")
    outside = drawn.copy()
    outside[:, gap] = 90.0
    assert not prior.foreseeable(outside).any()
    assert recorded.replays(space) is None


def test_recordings_and_ranges_make_one_prior() -> None:
    samples = of_recordings(None, "cut_out").where(np.arange(0, 2900, 8))
    path, slow = SCENARIOS / "cut_out_highway.xosc", {"Slow_Speed_mps": uniform(5.0, 15.0)}
    space = Space.of(path, SpaceChoice(marginals=slow))
    prior = of_samples(samples, space, marginals=slow).prior(space, "gaussian")
    assert prior.names == space.names
    drawn = prior.sample(200, np.random.default_rng(0))
    column = space.names.index("Slow_Speed_mps")
    assert ((drawn[:, column] >= 5.0) & (drawn[:, column] <= 15.0)).all()
    assert prior.foreseeable(drawn).mean() > 0.9 and np.isfinite(prior.log_density(drawn)).all()
    assert set(prior.nuisances) == {"CutOut_StartTime_s", "CutOut_RestTime_s"}
    np.testing.assert_array_equal(prior.with_nuisances(drawn)[:, column], drawn[:, column])


def test_a_range_far_above_the_mean_has_a_density() -> None:
    above, below = (
        density(NormalDistribution(0.0, 1.0, limits))
        for limits in (Range(9.0, 10.0), Range(-10.0, -9.0))
    )
    values = np.array([9.1, 9.5])
    assert above.log_density(values) == pytest.approx(below.log_density(-values))
    drawn = above.sample(1000, np.random.default_rng(0))
    assert drawn.min() >= 9.0 and drawn.max() < 10.0
    assert drawn.mean() == pytest.approx(9.11, abs=0.02)


@pytest.mark.parametrize(
    "of",
    [UniformDistribution(Range(1.5, 1.5)), NormalDistribution(1.5, 2.0, Range(1.5, 1.5))],
)
def test_a_range_of_one_value_is_that_value(of: object) -> None:
    assert marginal(of, "P") == "1.5"


def test_a_bin_without_width_has_no_density() -> None:
    wide, narrow = HistogramBin(Range(0.0, 1.0), 1.0), HistogramBin(Range(1.0, 1.0), 1.0)
    with pytest.raises(UsageError, match="a bin of this Histogram holds a single value: pin"):
        marginal(Histogram((wide, narrow)), "P")
    none = HistogramBin(Range(1.0, 1.0), 0.0)
    assert density(Histogram((wide, none))).log_density(np.array([0.5])) == pytest.approx(0.0)


def test_words_that_read_as_no_finite_number_are_categories() -> None:
    found = density(DistributionSet(("inf", "1", "nan")))
    assert (found.choices, dict(found.follows[2.0])) == ((0.0, 1.0, 2.0), {"P": "nan"})


def test_counts_beyond_number_are_refused_before_they_are_listed() -> None:
    with pytest.raises(UsageError, match="2000000001 counts has more than can be searched"):
        marginal(PoissonDistribution(10.0, Range(0.0, 2e9)), "P")
