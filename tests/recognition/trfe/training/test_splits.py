"""Splits by recording and by vehicle, and the rounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recognition.trfe.training.windows import SHARES, Split, Unit, Windows, split
from schemas.common.errors import UsageError
from studies.recognition.protocol.rounds import rounds


def windows(labels: list[int], recordings: list[str], egos: list[str]) -> Windows:
    grids = np.zeros((len(labels), 1, 1, 1, 1), dtype=np.uint8)
    return Windows(
        grids,
        np.array(labels, np.int64),
        np.array(recordings),
        np.array(egos),
        np.arange(len(labels), dtype=float),
    )


def made(recordings: int, each: int, seed: int = 0) -> Windows:
    """Recordings of two sites, with the classes 1, 2 and 3, 4, and windows without a class."""
    generator = np.random.default_rng(seed)
    rows = [
        (
            int(generator.choice([0, 1, 2] if number % 2 else [0, 3, 4])),
            f"recording {number}",
            f"{generator.integers(9)}",
        )
        for number in range(recordings)
        for _ in range(each)
    ]
    return windows(*map(list, zip(*rows, strict=True)))


def parts(found: Split) -> list[np.ndarray]:
    return [found.labelled, found.stream, found.validation, found.test]


@pytest.mark.slow
@given(st.integers(8, 30), st.integers(0, 5), st.sampled_from(["recording", "vehicle"]))
def test_no_unit_is_in_two_parts(recordings: int, seed: int, unit: Unit) -> None:
    data = made(recordings, 30, seed)
    names = (
        data.recordings
        if unit == "recording"
        else np.char.add(np.char.add(data.recordings, "/"), data.egos)
    )
    found = parts(split(data, seed, unit))
    of_part = [set(names[rows].tolist()) for rows in found]
    assert sum(map(len, of_part)) == len(set.union(*of_part))


def test_windows_without_a_class_are_in_no_part_and_all_others_in_one() -> None:
    data = made(40, 30)
    together = np.concatenate(parts(split(data, 0)))
    assert sorted(together.tolist()) == np.flatnonzero(data.labels > 0).tolist()


def test_every_class_has_about_its_share_in_every_part() -> None:
    data = made(60, 40)
    for rows, share in zip(parts(split(data, 1)), SHARES.values(), strict=True):
        for label in range(1, 5):
            held = np.count_nonzero(data.labels[rows] == label) / np.count_nonzero(
                data.labels == label
            )
            assert held == pytest.approx(share, abs=0.07)


def test_seeds_differ_and_repeat() -> None:
    data = made(40, 30)
    assert np.array_equal(split(data, 3).test, split(data, 3).test)
    assert not np.array_equal(split(data, 3).test, split(data, 4).test)


def test_class_of_too_few_recordings_is_left_out_and_told() -> None:
    data = windows(
        [1] * 40 + [2] * 3, [f"{k % 8}" for k in range(40)] + ["a", "b", "c"], ["1"] * 43
    )
    found = split(data, 0)
    assert found.left_out == {2: 3}
    assert all(set(data.labels[rows].tolist()) == {1} for rows in parts(found))


def test_classes_are_thinned_to_the_wanted_number() -> None:
    found = split(made(60, 200), 0, events_per_class=100)
    assert [len(rows) / 4 for rows in parts(found)] == [56, 14, 15, 15]


def test_two_classes_then_three_in_each_round() -> None:
    found = rounds(range(1, 18))
    assert [one.new for one in found] == [
        (3, 4, 5),
        (6, 7, 8),
        (9, 10, 11),
        (12, 13, 14),
        (15, 16, 17),
    ]
    assert found[0].known == (1, 2)
    assert found[4].known == tuple(range(1, 15))


def test_last_round_takes_what_is_left() -> None:
    assert [one.new for one in rounds([17, 2, 1, 5, 6, 9])] == [(5, 6, 9), (17,)]


def test_two_classes_are_too_few() -> None:
    with pytest.raises(UsageError, match="a new one"):
        rounds([1, 2])
