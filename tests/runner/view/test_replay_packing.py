"""Numbers packed for pages come back, to half a step."""

from __future__ import annotations

import base64

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from runner.view.replay.player import pack, pack_lines


def unpack(text: str, step: float, order: int) -> list[float]:
    """What page/data.js does, in Python."""
    numbers, value, weight = [], 0, 1
    for byte in base64.b64decode(text):
        value, weight = value + (byte & 127) * weight, weight * 128
        if byte < 128:
            numbers.append(-(value + 1) // 2 if value % 2 else value // 2)
            value, weight = 0, 1
    for _ in range(order):
        numbers = np.cumsum(numbers).tolist()
    return [number * step for number in numbers]


@given(
    st.lists(st.floats(-1e6, 1e6), max_size=50),
    st.sampled_from([0.002, 0.01, 1.0]),
    st.integers(0, 2),
)
def test_numbers_come_back_to_half_a_step(values: list[float], step: float, order: int) -> None:
    back = unpack(pack(values, step, order), step, order)
    assert len(back) == len(values)
    assert np.allclose(back, values, rtol=0.0, atol=0.51 * step)


def test_what_changes_steadily_takes_a_byte_a_number() -> None:
    assert len(base64.b64decode(pack(np.arange(1000) * 0.9, 0.01, 2))) < 1010


def test_lines_are_told_apart_by_their_lengths() -> None:
    lines = [np.array([[0.0, 1.0], [2.0, 3.0]]), np.array([[5.0, 5.0], [6.0, 6.0], [7.0, 8.0]])]
    lengths, x, y = pack_lines(lines, 0.01)
    assert unpack(lengths, 1.0, 0) == [2, 3]
    assert np.allclose(unpack(x, 0.01, 1), [0, 2, 5, 6, 7])
    assert np.allclose(unpack(y, 0.01, 1), [1, 3, 5, 6, 8])
    assert pack_lines([], 0.01) == ["", "", ""]
