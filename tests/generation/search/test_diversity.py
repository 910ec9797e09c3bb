"""Which points are apart, and which of many are kept."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from generation.space.space import apart, diverse


@settings(max_examples=50)
@given(
    n=st.integers(0, 60),
    sides=st.integers(1, 8),
    steps=st.integers(1, 40),
    least=st.floats(0.0, 0.5),
    most=st.none() | st.integers(0, 10),
    seed=st.integers(0, 1000),
)
def test_each_is_the_first_no_nearer_than_that_to_those_before(
    n: int, sides: int, steps: int, least: float, most: int | None, seed: int
) -> None:
    unit = (
        np.random.default_rng(seed).integers(0, steps, (n, sides)) / steps
    )  # on a grid: many are the same, or just as far
    kept: list[int] = []
    for index in range(n):
        if (
            len(kept) != most
            and (np.sqrt(np.square(unit[kept] - unit[index]).mean(axis=1)) >= least).all()
        ):
            kept.append(index)
    assert diverse(unit, least, most).tolist() == kept


def test_points_that_are_kept_are_apart() -> None:
    unit = np.random.default_rng(0).random((300, 3))
    kept = unit[diverse(unit, 0.1)]
    assert 20 < len(kept) < 300
    assert not apart(unit, kept, 0.1).any()
    for index in range(len(kept)):
        assert apart(kept[index : index + 1], np.delete(kept, index, axis=0), 0.1).all()


def test_points_are_apart_from_others_of_many_blocks() -> None:
    generator = np.random.default_rng(3)
    unit, others = generator.random((50, 2)), 0.5 * generator.random((10_000, 2))
    nearest = np.sqrt(np.square(unit[:, None] - others[None]).sum(axis=2).min(axis=1))
    np.testing.assert_array_equal(apart(unit, others, 0.1), nearest >= 0.1 * np.sqrt(2.0))
    assert apart(unit, others[:0], 0.1).all()
