"""Tables of how far parameters lead from recordings."""

from __future__ import annotations

import numpy as np

from generation.space.recorded import of_recordings
from studies.generation.reconstruction import by_kind, overall


def test_the_report_has_means_and_95_percent_of_both_errors() -> None:
    errors = np.column_stack([np.full(200, 0.2), np.arange(200) / 199.0])
    assert overall(errors).rows == [("200", "0.200", "0.200", "0.500", "0.950")]
    assert overall(None).rows == []


def test_every_kind_of_our_own_units_has_a_row_and_all_are_their_sum() -> None:
    kinds = ("cut_in", "braking")
    samples = of_recordings(None, "cut_in")
    rows = {row[0]: row[1:] for row in by_kind(samples, "own").rows}
    assert set(rows) & set(kinds) == {"cut_in"}
    assert rows["cut_in"] == rows["all sideways"] == rows["all"]
    units, inside, across, *_ = rows["all"]
    assert int(units) == len(samples.theta) >= int(inside) > 0
    assert float(across) == round(float(samples.errors[:, 0].mean()), 3)
