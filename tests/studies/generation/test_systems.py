"""The comparison of systems under test: who collides in which case, and whether
the careful driver does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
from generation.search.outcomes import Outcomes
from runner.batch.jobs import Job, Outcome, jobs_of
from schemas.common.errors import UsageError
from studies.generation.systems import Comparison, compare

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
CUT_IN = LIBRARY / "r157_cut_in.xosc"
CASES = {
    # ego and cut-in speed (km/h), gap (m), lateral speed (m/s)
    "mild": (50, 40, 30, 1.0),
    "avoidable": (50, 30, 20, 0.9),
    "unavoidable": (130, 40, 45, 1.5),
}
NAMES = ("Ego_Speed_kmh", "CutIn_Speed_kmh", "CutIn_Gap_m", "CutIn_LateralSpeed_mps")


def job(name: str) -> Job:
    return Job(name, CUT_IN, CUT_IN, dict(zip(NAMES, map(str, CASES[name]), strict=True)))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    broken = tmp_path_factory.mktemp("files") / "broken.xosc"
    broken.write_text("<OpenSCENARIO>")
    return compare([*map(job, CASES), *jobs_of([broken], {}, True)], ("none", "cas", "rss"))


def test_every_case_is_run_with_every_system_and_the_careful_driver(found: Comparison) -> None:
    assert list(found.outcomes) == ["none", "cas", "rss", "r157-cc"]
    for system, outcomes in found.outcomes.items():
        for name, collided in zip(CASES, outcomes.collision, strict=False):
            result = runner.run(CUT_IN, parameters=job(name).parameters, sut=system)
            assert collided == (not result.verdict.passed), (system, name)
        assert outcomes.executed.tolist() == [True, True, True, False]


def test_a_collision_is_avoidable_where_the_careful_driver_has_none(found: Comparison) -> None:
    assert found.outcomes["none"].collision.tolist() == [True, True, True, False]
    assert found.outcomes["r157-cc"].collision.tolist() == [False, False, True, False]
    assert found.avoidable("none").tolist() == [True, True, False, False]
    assert not found.avoidable("r157-cc").any()
    rows = {row.system: row for row in found.rows()}
    assert rows["none"][1:5] == (3, 3, 2, 1)
    assert rows["r157-cc"][1:5] == (3, 1, 0, 1)


def test_nothing_is_said_of_collisions_where_the_careful_drivers_run_failed(
    found: Comparison,
) -> None:
    careful = found.outcomes["r157-cc"]
    failed = Outcomes(
        **{**vars(careful), "status": np.array(["error", "completed", "completed", "error"])}
    )
    changed = Comparison(found.cases, {**found.outcomes, "r157-cc": failed})
    assert next(row for row in changed.rows() if row.system == "none")[1:5] == (3, 3, 1, 1)
    assert [row["avoidable"] for row in changed.table().to_pylist()[:4]] == [
        None,
        True,
        False,
        None,
    ]


def test_what_can_not_be_read_is_no_avoided_collision(found: Comparison) -> None:
    assert isinstance(found.cases[3], Outcome)
    assert "broken.xosc" in found.outcomes["cas"].error[3]


def test_the_table_has_a_row_for_each_case_and_system(found: Comparison) -> None:
    rows = found.table().to_pylist()
    assert len(rows) == 4 * 4
    assert [row["case"] for row in rows[:4]] == [*CASES, "broken"]
    assert dict(rows[0]["parameters"])["CutIn_Gap_m"] == "30"
    assert [row["collision"] for row in rows[:4]] == [True, True, True, None]
    assert [row["avoidable"] for row in rows[:4]] == [True, True, False, None]
    lines = found.markdown().splitlines()
    assert lines[2].startswith("| `none` | 3 | 3 | 2 | 1 |")
    assert len(lines) == 6


def test_an_unknown_system_is_refused() -> None:
    with pytest.raises(UsageError, match="absent"):
        compare([job("mild")], ("absent",))
