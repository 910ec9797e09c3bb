"""The gate: traffic as simulated fails as rarely as traffic did, or its density is no judge."""

from __future__ import annotations

import numpy as np
import pytest

from generation.density.gate import Gate, Share, measured
from generation.logical.library import SCENARIOS
from generation.outcomes.evaluator import Evaluator
from generation.recorded import of_recordings, of_samples
from generation.search.space import Space

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


def test_recorded_cut_ins_do_not_collide_with_their_own_values_and_neither_do_draws() -> None:
    space = Space.of(CUT_IN)
    recorded = of_samples(of_recordings(None, "cut_in"), space)
    own, replays = recorded.replays(space)
    with Evaluator(CUT_IN, own) as run:
        found = measured(recorded.prior(space, "gaussian"), run, replays, run, 60)
    assert found.replayed == Share(0, 60)
    assert found.drawn.runs == 60 and found.drawn.collisions <= 2
    assert found.refusal is None


def test_replays_have_their_own_values_of_what_is_pinned() -> None:
    space = Space.of(CUT_IN, {"Ego_Speed_mps": "30.0"})
    recorded = of_samples(of_recordings(None, "cut_in"), space)
    own, replays = recorded.replays(space)
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
