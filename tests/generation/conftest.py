"""A search problem that answers at once."""

from __future__ import annotations

import numpy as np
import pytest

from generation.search.problem import Realism, Reward, SearchProblem
from generation.space.density.models.kernels import KDE
from tests.generation.kinematic import SPACE, Kinematic, driven


@pytest.fixture(scope="session")
def realism() -> Realism:
    """Realism of driven parameters."""
    return Realism.of(
        KDE(0.7).fit(driven(300)), KDE(0.7).fit(driven(300)).log_density(driven(300, seed=1))
    )


@pytest.fixture
def problem(realism: Realism) -> SearchProblem:
    """Cut-ins in front of an ego at 30 m/s, by kinematics alone."""
    return SearchProblem(SPACE, Kinematic(), Reward(realism), np.array(driven(300)))
