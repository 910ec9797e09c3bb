"""Conditional densities of pairs compared."""

from __future__ import annotations

import importlib.util
import re

import numpy as np
import pytest

from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation import conditional
from studies.generation.conditional import Closed, comparison


def rows_of(n: int) -> tuple[FloatArray, np.ndarray]:
    """Normal rows of five recordings, whose second column follows the first, and the recordings."""
    generator = np.random.default_rng(0)
    given = generator.standard_normal(n)
    rows = np.stack(
        [given, 2.0 * given + 0.1 * generator.standard_normal(n), generator.standard_normal(n)],
        axis=1,
    )
    return rows, np.array([f"r{number % 5}" for number in range(n)])


def test_the_mixture_is_that_of_the_rest_given_the_first_column() -> None:
    rows, recordings = rows_of(500)
    model = Closed()
    model.fit(rows, recordings)
    exact = -0.5 * (((rows[:, 1] - 2.0 * rows[:, 0]) / 0.1) ** 2 + rows[:, 2] ** 2) - np.log(
        2.0 * np.pi * 0.1
    )
    assert abs((model.log_density(rows) - exact).mean()) < 0.1
    assert (model.log_density(rows) < model.least(rows, 0)).mean() < 0.03


def test_rows_of_densities_are_compared_with_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wider(Closed):
        def log_density(self, rows: FloatArray) -> FloatArray:
            return super().log_density(rows) - 1.0

    monkeypatch.setattr(conditional, "MODELS", {"one": Closed, "other": Wider})
    monkeypatch.setattr(conditional, "_zuko", lambda: None)
    table = comparison(*rows_of(200))
    assert [row[0] for row in table.rows] == ["one", "other"]
    assert [row[2] for row in table.rows] == ["+0.000 ± 0.000", "-1.000 ± 0.000"]
    assert float(re.sub("%", "", table.rows[1][3])) > float(re.sub("%", "", table.rows[0][3]))


@pytest.mark.skipif(importlib.util.find_spec("zuko") is not None, reason="zuko is there")
def test_without_zuko_it_says_what_to_install() -> None:
    with pytest.raises(UsageError, match="pip install zuko"):
        comparison(*rows_of(50))
