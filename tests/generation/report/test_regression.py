"""Failures of one version of a system replayed on another one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from generation.report.regression import Before, Fate, Shift, Tried, _regions, regression
from schemas.common.errors import UsageError
from tests.generation.report.searches import (
    CUT_IN,
    EASY,
    HARD,
    SPACE,
    WEAK,
    searched,
    settings,
    written,
)

OLD, NEW = "cas:brake=2", "cas:sensor_range=150"


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> Before:
    """A search against a system that brakes weakly: it fails in two of three."""
    found = searched(OLD, np.array([HARD, WEAK, EASY]))
    assert len(found.cases) == 2
    return Before.of(written(found, OLD, tmp_path_factory.mktemp("old")), CUT_IN)


def test_failures_are_fixed_or_still_there(before: Before) -> None:
    assert (before.sut, len(before.values)) == (OLD, 2)
    found = regression(before, CUT_IN, Tried.of(searched(NEW, np.array([HARD]))), settings(NEW))
    assert list(found.fates) == [Fate.STILL_THERE, Fate.FIXED]
    assert list(found.found) == [None], "the failure that was known is not new"
    assert found.counts.fails(Fate.STILL_THERE) and not found.counts.fails(Fate.NEW)
    assert ": 1 fixed, 1 still-there, 0 new; regions: " in str(found)


OTHER = [60.0, 12.0, 1.0, 12.0, 3.0, 12.0, 8.0, 38.0]
"""A failure of the weak system that is unlike the two that its search found"""


def test_a_failure_that_the_former_version_has_too_is_not_new(before: Before) -> None:
    found = regression(before, CUT_IN, Tried.of(searched(OLD, np.array([OTHER]))), settings(OLD))
    assert list(found.found) == [Fate.MISSED]
    assert not found.counts.fails(Fate.NEW)
    assert "0 new, 1 missed-before; regions: " in str(found)


def test_a_failure_that_the_former_version_survives_is_new(tmp_path: Path) -> None:
    strong = Before.of(written(searched(NEW, np.array([HARD, EASY])), NEW, tmp_path), CUT_IN)
    found = regression(strong, CUT_IN, Tried.of(searched(OLD, np.array([WEAK]))), settings(OLD))
    assert list(found.found) == [Fate.NEW]
    assert found.counts.fails(Fate.NEW)


def test_without_the_former_version_a_failure_is_unlike_and_no_alarm(before: Before) -> None:
    changed = Before(before.folder, before.sut, before.values, system="another code")
    found = regression(changed, CUT_IN, Tried.of(searched(OLD, np.array([OTHER]))), settings(NEW))
    assert list(found.found) == [Fate.UNLIKE]
    assert not found.counts.fails(Fate.NEW)


def test_a_failure_that_is_survived_is_not_fixed_where_its_neighbour_fails(before: Before) -> None:
    found = regression(
        before, CUT_IN, Tried.of(searched(OLD, np.array([WEAK]) + 0.01)), settings(NEW)
    )
    assert found.fates[1] is Fate.STILL_THERE


def test_regions_are_gone_new_moved_or_remain() -> None:
    """Two groups before: one is fixed, of the other one failures are left; a
    third one is found now.
    """
    middle = SPACE.unit((SPACE.low + SPACE.high)[None] / 2)[0]
    gone, left, new = (SPACE.scaled(middle * share) for share in (0.2, 1.0, 1.8))
    texts = [SPACE.values(row) for row in (gone, left, left + 0.01)]
    before, fates = Before(Path(), OLD, texts), [Fate.FIXED, Fate.STILL_THERE, Fate.FIXED]
    tried = Tried(SPACE, np.array([new, left + 0.02]), np.ones(2, bool))
    assert _regions(before, tried, fates) == {Shift.GONE: 1, Shift.NEW: 1, Shift.REMAINS: 1}
    aside = Tried(SPACE, np.array([SPACE.scaled(middle * 1.12)]), np.ones(1, bool))
    assert _regions(before, aside, [Fate.FIXED] * 3) == {Shift.GONE: 1, Shift.MOVED: 1}


def test_runs_that_fail_are_not_good_news(before: Before) -> None:
    broken = Before(before.folder, OLD, [{**before.values[0], "CutIn_Gap_m": "-1"}])
    found = regression(broken, CUT_IN, Tried.of(searched(NEW, np.array([EASY]))), settings(NEW))
    assert list(found.fates) == [Fate.UNKNOWN]
    assert found.counts.fails(Fate.STILL_THERE) and not found.counts.fails(Fate.NEW)


def test_a_folder_without_a_search_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no search of cut_in_highway"):
        Before.of(tmp_path, CUT_IN)


def test_a_parameter_that_is_gone_is_named(before: Before) -> None:
    gone = Before(before.folder, OLD, [{**before.values[0], "CutIn_Colour": "1"}])
    with pytest.raises(UsageError, match="no parameter CutIn_Colour any more"):
        regression(gone, CUT_IN, Tried.of(searched(NEW, np.array([EASY]))), settings(NEW))
    assert "CutIn_Gap_m" in SPACE.names
