"""Draws until a bound holds, or a failure stands against it."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from generation.estimation.bound import DrawnBound, draws_needed, draws_until
from generation.search.gate import CONFIDENCE
from generation.search.outcomes import Outcomes
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray

CUT_IN = Path(__file__).parents[3] / "xosc" / "library" / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)
ASKED = 0.01
NEEDED = math.ceil(math.log(1.0 - CONFIDENCE) / math.log1p(-ASKED))


class Uniform:
    """Density over the whole box."""

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        return SPACE.draw(n, generator)


def failing(where: Callable[[FloatArray], BoolArray]) -> Any:
    """Runs that fail where the points of the unit cube say so."""

    def run(theta: FloatArray, sut: str | None = None) -> Outcomes:
        return Outcomes.of(
            len(theta),
            collision=where(SPACE.unit(theta)).tolist(),
            status=["completed"] * len(theta),
            error=[""] * len(theta),
        )

    return run


def bound(plays: Any, runs: Any, found: FloatArray | None = None) -> DrawnBound:
    known = SPACE.draw(1, np.random.default_rng(0))[:0] if found is None else found
    return draws_until(ASKED, SPACE, Uniform(), plays, runs, known, 0)  # type: ignore[arg-type]


NEVER = failing(lambda unit: np.zeros(len(unit), bool))
CORNER = failing(lambda unit: (unit < 0.45).all(axis=1))


def test_as_many_draws_as_the_bound_needs_hold_it() -> None:
    made = bound(NEVER, NEVER)
    assert made.holds and made.statement.draws == NEEDED
    assert made.statement.unknown <= ASKED < 1.0 - 0.05 ** (1.0 / (NEEDED - 1))
    assert str(made).startswith(
        "no failing region of probability above 0.01 (95% confidence): none of"
    )


def test_a_failure_unlike_the_found_ones_stands_against_it() -> None:
    made = bound(CORNER, CORNER)
    assert not made.holds and len(made.against) >= 1
    assert CORNER(made.against).collision.all()
    assert "stand" in str(made) and made.as_json()["holds"] is False


def test_failures_like_the_found_ones_do_not() -> None:
    unit = np.stack(np.meshgrid(*[np.arange(0.05, 0.5, 0.1)] * len(SPACE.names)), -1)
    known = SPACE.low + unit.reshape(-1, len(SPACE.names)) * (SPACE.high - SPACE.low)
    made = bound(CORNER, CORNER, known)
    assert made.holds and made.statement.failing > 0 and made.statement.outside == 0
    assert "are like found ones" in str(made)


def test_failures_that_single_runs_do_not_confirm_are_counted_as_defects_of_arrays() -> None:
    made = bound(CORNER, NEVER)
    assert not len(made.against) and made.unconfirmed > 0


def test_an_end_of_time_says_how_far_the_bound_came() -> None:
    made = draws_until(
        1e-6, SPACE, Uniform(), NEVER, NEVER, SPACE.draw(1, np.random.default_rng(0))[:0], 0,
         # type: ignore[arg-type]
        iter([False, True]).__next__,
    )  # fmt: skip
    assert not made.holds and made.statement.draws == 32_768
    assert "not yet below 1e-06" in str(made)
    assert str(made).endswith(f"the time was over, {draws_needed(1e-6):,} are needed")
    assert made.as_json()["out_of_time"] is True


def test_draws_that_the_time_leaves_out_are_said() -> None:
    none = SPACE.draw(1, np.random.default_rng(0))[:0]
    made = draws_until(
        1e-6, SPACE, Uniform(), NEVER, NEVER, none, 0, lambda: True  # type: ignore[arg-type]
    )  # fmt: skip
    assert str(made) == "the time was over before a draw was made for a bound of 1e-06"


def test_draws_are_counted_while_they_are_made() -> None:
    counted: list[int] = []
    none = SPACE.draw(1, np.random.default_rng(0))[:0]
    made = draws_until(
        1e-5, SPACE, Uniform(), NEVER, NEVER, none, 0,
        progress=counted.append  # type: ignore[arg-type]
    )  # fmt: skip
    assert sum(counted) == made.statement.draws == draws_needed(1e-5) and len(counted) > 1
    assert made.holds and not made.out_of_time
