"""Runs in arrays are those of the interpreter: verdicts, ends, places and measures."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

import runner
import xosc
from benchmarks.arrays import compare, drawn, played
from runner.batch.arrays import obstacle, structures
from runner.judging.settings import RunSettings
from schemas.expressions.columns import NotInArrays

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
WEEK = int(datetime.now(UTC).strftime("%G%V"))
"""Seed of the sets that are drawn: others each week"""


def settings(sut: str = "none") -> RunSettings:
    return RunSettings(world="kinematic", sut=sut)


@pytest.mark.parametrize("sut", ["none", "cas"])
def test_cutting_in_is_played_as_by_the_interpreter(sut: str) -> None:
    runs, found, _ = compare(LIBRARY / "cut_in_highway.xosc", settings(sut), 6, 3)
    assert (runs, found) == (6, [])


def test_a_junction_is_crossed_as_by_the_interpreter() -> None:
    runs, found, _ = compare(LIBRARY / "turn_off_t_junction.xosc", settings(), 3, 3)
    assert (runs, found) == (3, [])


@pytest.mark.slow
@pytest.mark.parametrize("sut", ["none", "cas", "adas", "r157-cc"])
def test_library_scenarios_are_played_as_by_the_interpreter(sut: str) -> None:
    print(f"seed {WEEK}")
    different, compared, reached = {}, 0, 0
    for path in sorted(LIBRARY.glob("*.xosc")):
        if xosc.load(path).kind != "scenario" or obstacle(path, settings(sut)):
            continue
        runs, found, _ = compare(path, settings(sut), 12, WEEK)
        compared, reached = compared + runs, reached + 1
        if found:
            different[path.name] = found
    assert different == {}
    assert reached >= 49 and compared >= 500


def test_an_element_that_plays_in_single_runs_only_is_named_with_its_line() -> None:
    reason = obstacle(LIBRARY / "r157_cut_in.xosc", settings())
    assert "FollowTrajectoryAction plays in single runs only" in reason
    assert "r157_cut_in.xosc:140" in reason


def test_limits_and_traffic_are_left_to_single_runs() -> None:
    path = LIBRARY / "cut_in_highway.xosc"
    limited = RunSettings(world="kinematic", sut="none", fail_if=("min_ttc<1",))
    assert "limits" in obstacle(path, limited)
    assert "sumo" in obstacle(path, RunSettings(sut="sumo"))


def test_sets_of_another_structure_are_compiled_apart() -> None:
    path = LIBRARY / "simple_cut_in.xosc"
    sets = drawn(path, 8, 0)
    sizes = [len(each.members) for each in structures(path, sets, settings())]
    assert sum(sizes) == 8


def test_a_run_that_the_arrays_can_not_place_is_left_to_the_interpreter() -> None:
    path = LIBRARY / "cut_in_highway.xosc"
    sets = [{"Ego_Speed_mps": "30", "CutIn_StartTime_s": each} for each in ("3", "40")]
    found = played(path, sets, settings("cas"))
    assert 0 in found and 1 not in found
    assert (
        runner.run(path, settings("cas"), parameters=sets[0]).verdict.outcome
        == (found[0][0].outcome[found[0][1]])
    )


def test_a_file_that_no_set_can_read_is_refused_as_one_by_one(tmp_path: Path) -> None:
    path = tmp_path / "scenario.xosc"
    text = (LIBRARY / "cut_in_highway.xosc").read_text("utf-8")
    path.write_text(text.replace("../../xodr/library", str(LIBRARY.parents[1] / "xodr/library"))
                    .replace("catalogs/", f"{LIBRARY}/catalogs/")
                    .replace('dLane="1"', 'dLane="${$Ego_Speed_mps / 30}"'), encoding="utf-8")  # fmt: skip
    sets = [{"Ego_Speed_mps": each} for each in ("30", "30.3")]
    try:
        found = played(path, sets, settings())
    except NotInArrays:
        return
    assert 1 not in found
