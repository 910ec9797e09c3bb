"""How often a system fails, where the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.estimation.estimate import (
    FAILURE,
    PREVENTABLE,
    Allowance,
    EstimateSettings,
    Known,
    Proposal,
    Stage,
    Stages,
    estimate,
)
from generation.estimation.probability import FailingDraws, WeightedRows
from generation.search.outcomes import Outcomes
from generation.search.problem import Plays
from generation.space.density.marginals import Choices, DeclaredPrior, uniform
from schemas.common.array_types import BoolArray, FloatArray

EDGE, TRUTH = 0.04, 0.04**2
PRIOR = DeclaredPrior({"a": uniform(0.0, 1.0), "b": uniform(-1.0, 0.0)}, None)
NONE = Known.nothing(PRIOR)


def failing(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """In a corner; a careful driver fails in half of it."""
    edge = EDGE if sut is None else EDGE / 2
    collision = (theta[:, 0] < edge) & (theta[:, 1] > -EDGE)
    speeds = np.where(collision, 12.0, 0.0)
    return Outcomes.of(
        len(theta), collision=collision, impact_speed=speeds, status=["completed"] * len(theta)
    )


def surviving(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """Nowhere."""
    return Outcomes.of(len(theta), status=["completed"] * len(theta))


def misled(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """Plays whose corner is a little larger on one side, and smaller on the other."""
    return failing(theta + np.array([0.002, -0.002]), sut)


def test_weights_of_draws_have_the_mean_1() -> None:
    generator = np.random.default_rng(0)
    known = PRIOR.sample(40_000, generator)
    proposal = Proposal(PRIOR, 0.2, known[failing(known).collision])
    theta = proposal.sample(20_000, generator)
    weights = proposal.weights(theta)
    assert PRIOR.possible(theta).all()
    assert weights.max() <= 5.0 + 1e-9
    assert weights.mean() == pytest.approx(1.0, abs=4 * weights.std() / np.sqrt(20_000))


def erring(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """No run takes place."""
    return Outcomes.of(len(theta), status=["error"] * len(theta))


def test_runs_with_errors_are_not_known_to_pass() -> None:
    theta = np.array([[0.01, -0.01], [0.5, -0.5], [0.6, -0.6]])
    known = Known.of(theta, replace(failing(theta), status=np.array(["completed", "error", "x"])))
    assert known.theta.tolist() == theta[[0, 2]].tolist()
    assert known.failing.tolist() == [True, False]


@pytest.mark.parametrize("plays", [None, failing])
def test_an_estimate_without_a_run_knows_nothing(plays: Plays | None) -> None:
    found = estimate(PRIOR, erring, erring, NONE, plays, EstimateSettings(5, 0))
    chance = found.probabilities[FAILURE]
    assert (chance.value, chance.interval, chance.stable) == (0.0, (0.0, 1.0), False)
    assert (found.runs, found.failed, found.failing) == (0, 5, None)


@pytest.mark.parametrize("runs", [1, 2])
def test_an_estimate_of_few_runs_spends_them_all_and_is_wide(runs: int) -> None:
    found = estimate(PRIOR, failing, failing, NONE, None, EstimateSettings(runs, 0))
    assert (found.runs, found.failed) == (runs, 0)
    assert found.probabilities[FAILURE].interval[1] > 0.7


CHOSEN = DeclaredPrior({"a": uniform(0.0, 1.0), "c": Choices((0.0, 1.0), (0.75, 0.25))}, None)


def failing_by_choice(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """Four in a hundred of one choice, one in a hundred of the other."""
    collision = theta[:, 0] > np.where(theta[:, 1] > 0.5, 0.96, 0.99)
    return Outcomes.of(len(theta), collision=collision, status=["completed"] * len(theta))


def test_draws_stand_for_each_choice_as_often_as_it_has_probability() -> None:
    generator = np.random.default_rng(0)
    known = CHOSEN.sample(20_000, generator)
    proposal = Proposal(CHOSEN, 0.2, known[failing_by_choice(known).collision])
    theta = proposal.sample(8_000, generator)
    weights = proposal.weights(theta)
    second = np.where(theta[:, 1] > 0.5, weights, 0.0)
    assert second.mean() == pytest.approx(0.25, abs=4 * second.std() / np.sqrt(8_000))
    assert weights.mean() == pytest.approx(1.0, abs=4 * weights.std() / np.sqrt(8_000))


@pytest.mark.parametrize("only", [False, True])
def test_failures_of_choices_are_as_probable_as_they_are(only: bool) -> None:
    truth = 0.25 * 0.04 + (0.0 if only else 0.75 * 0.01)

    def fails(theta: FloatArray, sut: str | None = None) -> Outcomes:
        found = failing_by_choice(theta)
        return replace(found, collision=found.collision & ~(only & (theta[:, 1] < 0.5)))

    settings = EstimateSettings(300, 0, resampled=0)
    found = estimate(CHOSEN, fails, fails, Known.nothing(CHOSEN), fails, settings)
    chance = found.probabilities[FAILURE]
    assert chance.interval[0] <= truth <= chance.interval[1]
    assert chance.value == pytest.approx(truth, rel=0.05)
    assert found.failing is not None
    assert set(found.failing.theta[:, 1].tolist()) <= {0.0, 1.0}, "the choices themselves"


@pytest.mark.slow
@pytest.mark.parametrize("controlled", [False, True])
def test_intervals_cover_the_truth(controlled: bool) -> None:
    found = [
        estimate(
            PRIOR, failing, failing, NONE, misled, EstimateSettings(300, seed, controlled)
        ).probabilities
        for seed in range(10)
    ]
    for event, truth in (
        (FAILURE, TRUTH),
        (PREVENTABLE, TRUTH / 2),
        ("impact at 10 to 20 m/s", TRUTH),
    ):
        covered = sum(each[event].interval[0] <= truth <= each[event].interval[1] for each in found)
        assert covered >= 8, event
    variation = np.mean([each[FAILURE].variation for each in found])
    assert variation < (0.07 if controlled else 0.12)


class Unsure(DeclaredPrior):
    """A prior whose refitted densities are 0.6 to 1.6 times as great everywhere."""

    def log_ratios(self, theta: FloatArray, n: int, generator: np.random.Generator) -> FloatArray:
        return np.repeat(np.linspace(-0.5, 0.5, n)[:, None], len(theta), axis=1)


def test_an_unsure_density_widens_the_interval_and_leaves_the_value() -> None:
    unsure = Unsure({"a": uniform(0.0, 1.0), "b": uniform(-1.0, 0.0)}, None)
    settings = EstimateSettings(300, 0)
    both = [estimate(each, failing, failing, NONE, misled, settings) for each in (PRIOR, unsure)]
    sure, found = (each.probabilities[FAILURE] for each in both)
    assert found.value == sure.value
    assert found.density == pytest.approx(np.linspace(-0.5, 0.5, settings.resampled).std(ddof=1))
    assert sure.density == pytest.approx(0.0)
    assert found.interval[0] < 0.8 * sure.interval[0] and found.interval[1] > 1.2 * sure.interval[1]


def searched(seed: int) -> Known:
    """Runs of a search: evenly spread over twice the corner, and a few elsewhere."""
    generator = np.random.default_rng(seed)
    corner = np.stack(
        [generator.uniform(0, 2 * EDGE, 200), generator.uniform(-2 * EDGE, 0, 200)], axis=1
    )
    theta = np.concatenate([corner, PRIOR.sample(60, generator)])
    return Known(theta, failing(theta).collision)


@pytest.mark.slow
def test_runs_of_before_make_the_proposal_without_plays() -> None:
    found = [
        estimate(PRIOR, failing, failing, searched(seed), None, EstimateSettings(300, seed))
        for seed in range(2)
    ]
    chances = [each.probabilities[FAILURE] for each in found]
    assert all(each.interval[0] <= TRUTH <= each.interval[1] for each in chances)
    assert np.mean([each.variation for each in chances]) < 0.15
    assert all(each.known > searched(seed).failing.sum() for seed, each in enumerate(found)), (
        "the first stage's are known too"
    )


@pytest.mark.slow
def test_failures_alone_make_the_proposal_where_no_run_is_known_to_pass() -> None:
    theta, fails = searched(5)
    found = estimate(
        PRIOR, failing, failing, Known(theta[fails], fails[fails]), None, EstimateSettings(400)
    )
    low, high = found.probabilities[FAILURE].interval
    assert low <= TRUTH <= high


def test_draws_of_several_stages_have_weights_of_the_mean_1() -> None:
    generator = np.random.default_rng(0)
    known = PRIOR.sample(40_000, generator)
    proposal = Proposal(
        PRIOR, 0.2, known[failing(known).collision], known[failing(known / 2).collision]
    )
    stages = Stages([Stage(5_000, None), Stage(15_000, proposal)])
    theta = np.concatenate([PRIOR.sample(5_000, generator), proposal.sample(15_000, generator)])
    weights = stages.weights(theta)
    assert stages.greatest == pytest.approx(1 / (0.25 + 0.75 * 0.2))
    assert weights.max() <= stages.greatest + 1e-9
    assert weights.mean() == pytest.approx(1.0, abs=4 * weights.std() / np.sqrt(20_000))


def test_too_few_failures_leave_draws_of_the_prior() -> None:
    found = estimate(PRIOR, failing, failing, NONE, None, EstimateSettings(200))
    assert found.known == 0
    assert "too few failures are known" in next(found.lines())
    assert found.probabilities[FAILURE].interval[1] > TRUTH


def test_where_nothing_fails_its_parts_are_not_told() -> None:
    told = list(estimate(PRIOR, surviving, surviving, NONE, None, EstimateSettings(200)).lines())
    assert [line for line in told if "no draw fails" in line] == [
        "  collision: below 1.5e-02 (no draw fails)"
    ]


def test_runs_that_fail_count_for_nothing_and_are_told() -> None:
    def broken(theta: FloatArray) -> Outcomes:
        outcomes = failing(theta)
        outcomes.status[::4] = "error"
        return outcomes

    found = estimate(PRIOR, broken, failing, NONE, failing, EstimateSettings(200))
    assert (found.runs, found.failed) == (150, 50)
    assert "50 more runs failed" in "\n".join(found.lines())
    assert found.as_json()["failed_runs"] == 50


def two_regions(theta: FloatArray, sut: str | None = None) -> Outcomes:
    """Two corners, one three times as probable as the other, and nothing else."""
    return Outcomes.of(len(theta), collision=left(theta) | right(theta))


def left(theta: FloatArray) -> BoolArray:
    """The corner of probability 0.0024."""
    return (theta[:, 0] < 0.06) & (theta[:, 1] > -0.04)


def right(theta: FloatArray) -> BoolArray:
    """The corner of probability 0.0008."""
    return (theta[:, 0] > 0.98) & (theta[:, 1] > -0.04)


@pytest.mark.parametrize("played", [True, False])
def test_planted_regions_have_probabilities_that_add_up_to_that_of_a_failure(played: bool) -> None:
    generator = np.random.default_rng(3)
    theta = PRIOR.sample(40_000, generator)
    known = Known(theta, two_regions(theta).collision)
    plays = (
        (lambda rows, sut=None: two_regions(rows + np.array([0.002, -0.002]))) if played else None
    )
    covered = {left: 0, right: 0}
    for seed in range(5):
        found = estimate(
            PRIOR, two_regions, failing, known, plays, EstimateSettings(300, seed, resampled=0)
        )
        failing_draws, whole = found.failing, found.probabilities[FAILURE]
        assert failing_draws is not None
        every = failing_draws.part(lambda rows: np.ones(len(rows), bool))
        assert (every.value, every.deviation) == pytest.approx(
            (whole.value, whole.deviation), rel=1e-2
        )
        assert every.effective == pytest.approx(whole.effective)
        # Parts of the space: failures in plays are not quite where the system fails.
        parts = {
            left: failing_draws.part(lambda rows: rows[:, 0] < 0.5),
            right: failing_draws.part(lambda rows: rows[:, 0] >= 0.5),
        }
        assert sum(part.value for part in parts.values()) == pytest.approx(every.value, rel=1e-9)
        for of, truth in ((left, 0.0024), (right, 0.0008)):
            low, high = parts[of].interval
            covered[of] += low <= truth <= high
        nowhere = failing_draws.part(lambda rows: np.zeros(len(rows), bool)).within(whole)
        assert nowhere.value == 0.0 and nowhere.interval == (0.0, pytest.approx(min(
            nowhere.bound, whole.interval[1]
        )))  # fmt: skip
    assert min(covered.values()) >= 4


@pytest.mark.parametrize(("part", "share"), [(1e-4, 0.1), (3e-5, 0.6), (3e-5, 1.0), (5e-4, 0.3)])
def test_intervals_of_parts_hold_the_truth_where_plays_fail_too_often(
    part: float, share: float
) -> None:
    """Plant a system of which plays fail in 1 %, rightly but in a part of it: a share fails."""
    generator, all_plays, truth, repetitions, held = np.random.default_rng(7), 0.01, 0.0, 60, 0

    def drawn(number: int) -> tuple[FloatArray, FloatArray]:
        wide = generator.random(number) < 0.2
        theta = np.where(wide, 1.0, all_plays) * generator.random(number)
        return theta, 1.0 / (0.2 + 0.8 / all_plays * (theta < all_plays))

    for _ in range(repetitions):
        (theta, weights), (many, others) = drawn(600), drawn(8192)
        own = theta < all_plays - part * (1.0 - share)
        played, more = theta < all_plays, many < all_plays
        failing = FailingDraws(
            theta[own, None], weights[own], 600, 5.0, np.zeros((0, int(own.sum()))),
            (
                WeightedRows(theta[played, None], weights[played], 600),
                WeightedRows(many[more, None], others[more], 8192),
            ),
        )  # fmt: skip
        whole = failing.part(lambda rows: np.ones(len(rows), bool))
        found = failing.part(lambda rows: rows[:, 0] >= all_plays - part).within(whole)
        truth = part * share
        held += found.interval[0] <= truth <= found.interval[1]
    assert held >= 0.9 * repetitions


@pytest.mark.parametrize("plays", [None, failing])
def test_an_estimate_in_little_time_counts_draws_that_were_made(plays: Plays | None) -> None:
    """Two parts of its runs, then the time is over; the interval holds the truth."""
    generator = np.random.default_rng(3)
    drawn, ran = PRIOR.sample(500, generator), list[int]()

    def evaluate(theta: FloatArray) -> Outcomes:
        ran.append(len(theta))
        return failing(theta)

    allowed = Allowance(lambda: len(ran) >= 2, lambda share: share * 1e5, drawn, failing(drawn))
    found = estimate(PRIOR, evaluate, failing, NONE, plays, EstimateSettings(200), allowed)
    assert (found.runs, found.drawn, ran) == (540, 500, [20, 20])
    low, high = found.probabilities[FAILURE].interval
    assert low < TRUTH < high and found.drawn + 40 == found.runs
    assert plays is None or low > 0.0
    none = Allowance(lambda: True, lambda share: 0.0, drawn, failing(drawn))
    least = estimate(PRIOR, evaluate, failing, NONE, plays, EstimateSettings(200), none)
    assert (least.runs, least.drawn, len(ran)) == (20, 20, 2)
