"""Rows beside a model on sites not seen: what each looks at, and what it learns from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.inputs.tokens import FEATURES, MOTION, TRAFFIC, Tokens
from recognition.trfe.training.card import SiteWindows
from recognition.trfe.training.windows import Windows
from recognition.trfe.trfe import TRFE
from schemas.common.errors import UsageError
from studies.recognition.plain import kinematic, static
from studies.recognition.sites import ROWS, beside, recogniser, sites

TOKENS = Tokens(others=2)


def inputs(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, *TOKENS.shape)).astype(np.float16)


def windows(labels: list[int], name: str) -> Windows:
    names = np.full(len(labels), name)
    return Windows(
        inputs(len(labels)),
        np.array(labels, np.int64),
        names,
        names,
        np.arange(len(labels), dtype=float),
    )


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
    found = beside(windows([3, 3, 4, BACKGROUND], "families"), [there])
    assert found.labels.tolist() == [3, 3, 4, BACKGROUND, 3, 4, BACKGROUND, BACKGROUND, BACKGROUND]
    assert found.recordings.tolist() == ["families"] * 4 + ["there"] * 5
    assert found.inputs.shape == (9, *TOKENS.shape)


def drifting(labels: list[int], name: str, seed: int, by: float = 1.0) -> Windows:
    """Windows in which the ego of class 5 drifts to its left, that of class 6 to its right."""
    made = replace(windows(labels, name), inputs=0.1 * inputs(len(labels), seed))
    way = {5: 1.0, 6: -1.0, BACKGROUND: 0.0}
    for window, label in zip(made.inputs, labels, strict=True):
        window[0, :, FEATURES.index("aside")] += (
            by * way[label] * np.linspace(-1.0, 1.0, TOKENS.frames)
        )
    return made


@pytest.mark.parametrize("name", ["changes", "changes-forest"])
def test_a_row_is_fitted_and_takes_its_least_shares_from_recordings_to_develop_on(
    name: str,
) -> None:
    labels = [5, 6, BACKGROUND] * 20
    fitted, held, events = (drifting(labels, "families", seed) for seed in range(3))
    quiet = drifting([5] * 90, "there", 4, by=0.6)
    quiet = replace(
        quiet, labels=np.full(90, BACKGROUND)
    )  # as if what looks a little like class 5 were nothing here
    model = TRFE()
    plain, developed = (
        recogniser(ROWS[name], model, fitted, held, develop)
        for develop in ([], [SiteWindows("there", events, quiet)])
    )
    assert np.mean(plain(events) == events.labels) > 0.8 and (plain(quiet) == 5).any()
    assert np.mean(developed(quiet) == BACKGROUND) > np.mean(plain(quiet) == BACKGROUND)
    assert len(plain(events.select(slice(0)))) == 0


def test_an_unknown_row_is_named_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no row 'magic'; rows: map-only, .*, others"):
        sites(tmp_path, [tmp_path], tmp_path / "out", row=["magic"])
