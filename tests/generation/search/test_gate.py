"""The gate: traffic as simulated fails as rarely as traffic did, or its density is no judge."""

from __future__ import annotations

import numpy as np
import pytest

from generation.search.gate import TESTABLE, Gate, Share, Statement, replay_shares
from generation.search.outcomes import Evaluator, Outcomes
from generation.space import SpaceChoice
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from schemas.common.array_types import FloatArray

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


@pytest.mark.slow
def test_recorded_cut_ins_do_not_collide_with_their_own_values_and_neither_do_draws() -> None:
    space = Space.of(CUT_IN)
    recorded = of_samples(of_recordings(None, "cut_in"), space)
    replayable = recorded.replays(space)
    assert replayable is not None
    own, replays = replayable
    with Evaluator(CUT_IN, own) as run:
        generator = np.random.default_rng(0)
        draws = run(recorded.prior(space, "gaussian").sample(60, generator))
        units = replays[generator.permutation(len(replays))[:60]]
        replayed, unprevented = replay_shares(units, run(units), run)
        found = Gate(replayed, Share.of(draws), unprevented)
    assert found.replayed == Share(0, 60)
    assert found.drawn.runs == 60 and found.drawn.collisions <= 2
    assert found.refusal is None


def test_replays_have_their_own_values_of_what_is_pinned() -> None:
    space = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30.0"}))
    recorded = of_samples(of_recordings(None, "cut_in"), space)
    replayable = recorded.replays(space)
    assert replayable is not None
    own, replays = replayable
    assert own.names == (*space.names, "Ego_Speed_mps") and not own.pinned
    np.testing.assert_array_equal(replays[:, :-1], recorded.within(space).theta)
    assert replays[:, -1].std() > 4.0


@pytest.mark.parametrize(
    ("replayed", "drawn", "refused"),
    [
        (Share(0, 1000), Share(6, 2000), None),
        (Share(0, 1000), Share(400, 2000), "far more often"),
        (Share(50, 1000), Share(50, 1000), "none of the recordings did"),
        (Share(0, 30), Share(3, 30), None),
        (None, Share(30, 30), None),
    ],
)
def test_a_density_is_refused_where_its_draws_or_replays_collide_far_more_often(
    replayed: Share | None, drawn: Share, refused: str | None
) -> None:
    found = Gate(replayed, drawn).refusal
    assert (found is None) == (refused is None)
    assert refused is None or refused in str(found)


def test_intervals_are_exact() -> None:
    assert Share(0, 1000).interval == pytest.approx((0.0, 1 - 0.025 ** (1 / 1000)))
    assert Share(0, 0).interval == (0.0, 1.0)
    assert str(Share(6, 2000)) == "6 of 2000 (0.11% to 0.65%)"


def test_few_replays_or_draws_do_not_pass_a_density() -> None:
    for few in (
        Gate(Share(0, 30), Share(0, 30)),
        Gate(Share(0, 300), Share(0, 30)),
        Gate(Share(0, 30), Share(0, 1000)),
    ):
        assert not few.testable and "not testable" in str(few)
    many = Gate(Share(0, 300), Share(0, 1000))
    assert many.testable and str(many).endswith(
        f": the density passes, it would be refused if {many.power:.2%} of its draws collided"
    )
    least = round(many.power * 1000)
    assert Gate(many.replayed, Share(least, 1000)).refusal is not None
    assert Gate(many.replayed, Share(least - 1, 1000)).refusal is None
    assert Gate(many.replayed, Share(round(TESTABLE * 1000), 1000)).refusal is not None, (
        "it has the power that it claims"
    )


def test_a_gate_names_what_keeps_recordings_from_being_replayed() -> None:
    drawn = Share(0, 30)
    assert str(Gate(None, drawn)).endswith("; nothing is recorded that could be replayed")
    named = str(Gate(None, drawn, unrecorded=("sut_delay", "sut_reach")))
    assert named.endswith("; of sut_delay and sut_reach nothing is recorded that could be replayed")


def test_a_weak_system_under_test_is_no_fault_of_the_replays() -> None:
    weak, blind = SPACE_OF_GAPS[:, 0] < 0.2, SPACE_OF_GAPS[:, 0] < 0.1

    def drive(theta: FloatArray, sut: str = "weak") -> Outcomes:
        return Outcomes.of(len(theta), collision=theta[:, 0] < (0.2 if sut == "weak" else 0.1))

    replayed, unprevented = replay_shares(SPACE_OF_GAPS, drive(SPACE_OF_GAPS), drive)
    assert (replayed, unprevented) == (Share(int(weak.sum()), 500), Share(int(blind.sum()), 500))
    assert Gate(replayed, replayed, Share(0, 500)).refusal is None
    assert "with each careful driver too" in str(Gate(replayed, replayed, unprevented).refusal)


SPACE_OF_GAPS = np.random.default_rng(1).random((500, 1))
"""Rows of one parameter"""


def test_draws_without_a_failure_bound_what_is_unknown_by_the_rule_of_three() -> None:
    found = Statement.of(Outcomes.of(1000), np.ones(1000, bool))
    assert found.unknown == found.total == pytest.approx(1.0 - 0.05 ** (1.0 / 1000))
    assert "0 of 1,000 unguided draws fail: with 95 % confidence" in str(
        found
    ) and "below 0.003" in str(found)


def test_draws_that_fail_near_known_failures_leave_the_bound_on_unknown_ones() -> None:
    outcomes = Outcomes.of(
        400, collision=[True] * 8 + [False] * 392, status=["completed"] * 399 + ["error"]
    )
    unlike = np.ones(400, bool)
    known = Statement.of(outcomes, ~unlike)
    assert (known.draws, known.failing, known.outside) == (399, 8, 0)
    assert known.unknown == pytest.approx(1.0 - 0.05 ** (1.0 / 399))
    assert known.unknown < known.total
    assert Statement.of(outcomes, unlike).unknown == known.total


def test_no_draw_bounds_nothing() -> None:
    lost = Outcomes.of(3, status=["error"] * 3)
    assert Statement.of(lost, np.ones(3, bool)).unknown == 1.0
    assert "nothing bounds" in str(Statement.of(lost, np.ones(3, bool)))


def test_the_bound_covers_in_at_least_95_of_100_repetitions() -> None:
    """Unknown failures of probability 1 %: bounds from 300 draws lie above it."""
    generator, covered = np.random.default_rng(5), 0
    for _ in range(400):
        hits = generator.random(300) < 0.01
        covered += (
            Statement.of(Outcomes.of(300, collision=hits.tolist()), np.ones(300, bool)).unknown
            >= 0.01
        )
    assert covered >= 0.93 * 400
