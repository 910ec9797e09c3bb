"""Judges judged: replays of recorded units are counted by system and site."""

from __future__ import annotations

import numpy as np

from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from studies.generation.judges import Replays

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


def test_a_slower_reaction_collides_more_often_in_replays() -> None:
    space = Space.of(CUT_IN)
    recorded = of_samples(of_recordings(None, "cut_in"), space)
    rows = np.arange(0, len(recorded.theta), 9)
    assert recorded.errors is not None
    values = {name: each[rows] for name, each in recorded.values.items()}
    some = recorded._replace(
        theta=recorded.theta[rows],
        recordings=recorded.recordings[rows],
        errors=recorded.errors[rows],
        values=values,
    )
    found = Replays.of(CUT_IN, space, some, ["r157-cc", "r157-cc:reaction=2"])
    assert found is not None
    quick, slow = (found.collides[name].sum() for name in ("r157-cc", "r157-cc:reaction=2"))
    assert 0 < quick < slow
    text = found.markdown("cut_in_highway")
    assert f"| r157-cc | {quick} of {len(found.sites)} |" in text and "arterial" in text
