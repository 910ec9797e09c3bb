"""The table of failures by method."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.common.errors import UsageError
from studies.generation.failures.counts import Counts, path_of, save, table

SCENARIO = Path("cut_in_highway.xosc")


def counts(essential: int, confirmed: int = 40) -> Counts:
    return Counts(50, 900, 45, 44, 42, confirmed, essential - 1, essential)


def test_figures_are_per_1000_runs_of_the_budget_and_methods_are_compared_by_seeds(tmp_path: Path) -> None:
    for method, found in {"quality": (30, 34), "kde+": (10, 11), "random+": (2, 1)}.items():
        for seed, essential in enumerate(found):
            save(counts(essential), path_of(tmp_path, SCENARIO, "cas", method, seed), 100)
    made = table(tmp_path, 100)
    assert [row[2] for row in made.rows] == ["quality", "kde+", "random+"]
    assert made.rows[0] == (
        "cut_in_highway", "cas", "quality", "2", "50", "900", "450.0 ± 0.0", "440.0 ± 0.0", "420.0 ± 0.0", "95.2%",
        "310.0 ± 28.3", "320.0 ± 28.3",
    )  # fmt: skip
    assert "quality finds 3.0 times as many as kde+ (paired t test, 2 seeds" in made.note


def test_results_of_another_budget_are_refused(tmp_path: Path) -> None:
    save(counts(3), path_of(tmp_path, SCENARIO, "cas", "quality", 0), 100)
    with pytest.raises(UsageError, match="another budget"):
        table(tmp_path, 200)
