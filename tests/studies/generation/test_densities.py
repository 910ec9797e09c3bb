"""The comparison of densities."""

from __future__ import annotations

from generation.space.density.models import models
from studies.generation.densities import comparison
from tests.generation.space.density.test_models import normal, recordings


def test_the_comparison_puts_the_truth_before_what_ignores_correlation() -> None:
    table = comparison(normal(200), recordings(200), [name for name in models() if name != "flow"])
    assert table.rows[0][0].startswith(
        ("one Gaussian", "Gaussian mixture", "mixture of Student's t")
    )  # which can be Gaussian
    assert table.rows[-1][0] == "independent 1-D KDEs"
    assert "8 recordings" in table.note
