"""What limits of the foreseeable let pass."""

from __future__ import annotations

import numpy as np

from generation.search.outcomes import Outcomes
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import kind_of, of_recordings, of_samples
from generation.space.space import Space
from schemas.common.array_types import FloatArray
from studies.generation.foreseen import limits


def test_both_limits_let_no_more_pass_than_either() -> None:
    path = SCENARIOS / "squeezed_highway.xosc"
    space = Space.of(path)
    gaps = [space.names.index(f"{name}_Gap_m") for name in ("Left", "Right")]

    def near(theta: FloatArray) -> Outcomes:
        return Outcomes.of(len(theta), collision=theta[:, gaps].min(axis=1) < 15.0)

    def nearer(theta: FloatArray) -> Outcomes:
        return Outcomes.of(len(theta), collision=theta[:, gaps].max(axis=1) < 15.0)

    table = limits(space, of_samples(of_recordings(None, kind_of(path)), space), near, nearer, 300)
    shares = np.array(
        [[float(cell.split()[0].rstrip("%")) for cell in row[1:]] for row in table.rows]
    )
    assert [row[0] for row in table.rows] == ["of the pair", "of each alone", "both"]
    assert (shares[2] <= shares[:2].min(axis=0)).all()
    assert shares[2, 0] > 90.0
    assert 0 < shares[2, 3] < shares[2, 2]
    assert shares[2, 4] < shares[0, 4] < 5.0
