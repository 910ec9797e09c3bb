"""What changes in windows of tokens: by hand, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from recognition.trfe.inputs.tokens import CHANGES, FEATURES, Tokens, changes

WINDOW = Tokens()


def windows(count: int = 1) -> NDArray[np.float16]:
    """Windows in which nothing changes and nobody is near."""
    inputs = np.full((count, *WINDOW.shape), np.nan, np.float16)
    inputs[:, 0] = 0.5
    return inputs


def test_where_nothing_changes_only_roles_are_left() -> None:
    found = changes(windows(2))
    roles = sum(name.startswith("role_") for name in FEATURES)
    assert found.shape == (2, CHANGES) and found.dtype == np.float32
    assert not found[:, :-roles].any() and (found[:, -roles:] == 0.5).all()


def test_a_change_is_from_the_first_third_to_the_last() -> None:
    inputs = windows()
    inputs[0, 0, :, FEATURES.index("speed")] = np.arange(16) / 16
    found = changes(inputs)[0]
    assert found[0] == pytest.approx((13 - 2) / 16, abs=1e-3)
    deviation = found[
        16
    ]  # the first after the changes of sixteen features of motion, gap and borders
    assert deviation == pytest.approx(np.std(np.arange(16) / 16), abs=1e-3)
    assert np.count_nonzero(found[:32]) == 2


@pytest.mark.parametrize("name", ["speed", "gap", "offset"])
def test_levels_do_not_matter(name: str) -> None:
    inputs, raised = windows(), windows()
    inputs[0, 0, :, FEATURES.index(name)] = np.arange(16) / 16
    raised[0, 0, :, FEATURES.index(name)] = 1.0 + np.arange(16) / 16
    assert changes(raised) == pytest.approx(changes(inputs), abs=1e-3)


def test_others_and_frames_without_the_ego_do_not_matter() -> None:
    inputs = windows()
    inputs[0, 0, :, FEATURES.index("speed")] = np.r_[np.zeros(8), np.ones(8)]
    beside = inputs.copy()
    beside[0, 1:] = 3.0
    assert np.array_equal(changes(beside), changes(inputs))
    late = inputs.copy()
    late[0, 0, :5] = np.nan
    found = changes(late)[0]
    assert found[0] == 0.0 and found[16] > 0.0 and np.isfinite(found).all()
