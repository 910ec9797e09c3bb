"""Recorded drivers, and where they act."""

from __future__ import annotations

import numpy as np
import pytest

from generation.space.logical.library import SCENARIOS
from studies.generation.adversary.actions import OWN, Actions
from studies.generation.adversary.course import Scene
from studies.generation.adversary.driving import Driving

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


@pytest.fixture(scope="session")
def actions() -> Actions:
    """A part of our own recordings'."""
    every = Actions.read(OWN)
    kept = every.episodes % 4 == 0
    return Actions(
        every.states[kept], every.actions[kept], every.recordings[kept], every.episodes[kept]
    )


@pytest.fixture(scope="session")
def driving(actions: Actions) -> Driving:
    """How they act."""
    return Driving(actions)


@pytest.fixture(scope="session")
def scene() -> Scene:
    """A cut-in from the left on a straight motorway."""
    return Scene.of(CUT_IN)


@pytest.fixture
def starts() -> np.ndarray:
    """Near ones and far ones, with an ego that is faster."""
    return np.array(
        [[18.0, 20.0, 26.0], [14.0, 22.0, 26.0], [30.0, 25.0, 25.0], [24.0, 18.0, 25.0]]
    )
