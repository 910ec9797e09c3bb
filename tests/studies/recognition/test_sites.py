"""Rows beside a model on sites not seen: what each looks at, and what it learns from."""

from __future__ import annotations

import numpy as np

from recognition.tokens import FEATURES, MOTION, TRAFFIC, Tokens
from recognition.training.card import SiteWindows
from recognition.training.windows import Windows
from recognition.trfe.samples import BACKGROUND
from studies.recognition.plain import kinematic, static
from studies.recognition.sites import joined

TOKENS = Tokens(others=2)


def inputs(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, *TOKENS.shape)).astype(np.float16)


def windows(labels: list[int], name: str) -> Windows:
    names = np.full(len(labels), name)
    return Windows(inputs(len(labels)), np.array(labels, np.int64), names, names, np.arange(len(labels), dtype=float))


def test_the_map_alone_is_blind_to_motion_and_to_others() -> None:
    before = inputs(5)
    after = before.copy()
    after[:, 1:] = np.nan
    for name in (*MOTION, *TRAFFIC, "along", "aside"):
        after[..., FEATURES.index(name)] += 1.0
    assert np.array_equal(static(before), static(after))
    assert not np.array_equal(kinematic(before), kinematic(after))


def test_plain_numbers_of_motion_are_blind_to_the_map() -> None:
    before = inputs(5)
    after = before.copy()
    for name in FEATURES:
        if name.startswith("role_") or name in ("limit", "lanes_to_left", "lane_ahead"):
            after[..., FEATURES.index(name)] += 1.0
    assert kinematic(before).shape == (5, 13)
    assert np.array_equal(kinematic(before), kinematic(after))


def test_other_recordings_join_training_with_events_and_quiet_windows() -> None:
    there = SiteWindows("there", windows([3, 4], "there"), windows([BACKGROUND] * 3, "there"))
    found = joined(windows([3, 3], "families"), [there])
    assert found.labels.tolist() == [3, 3, 3, 4, BACKGROUND, BACKGROUND, BACKGROUND]
    assert found.recordings.tolist() == ["families"] * 2 + ["there"] * 5
    assert found.inputs.shape == (7, *TOKENS.shape)
