"""AcmeComfortTest: a limit of a run."""

import numpy as np
import pytest

import xosc_toolchain as xt


@pytest.mark.parametrize(("limit", "passed"), [(0.5, False), (12.0, True)])
def test_it_is_judged_in_a_run(limit: float, passed: bool) -> None:
    asked = f"AcmeComfortTest={limit:g}"
    result = xt.run("highway_lead_brake", sut="adas", world="kinematic", fail_if=(asked,))
    (found,) = [each for each in result.verdict.criteria if each.name == asked]
    table = result.trajectories.to_pandas()
    hardest = -np.min(table[table["entity"] == "Ego"]["acceleration"])
    assert found.passed is passed
    assert found.value == pytest.approx(hardest)
