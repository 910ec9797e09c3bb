"""Runs in arrays are those of the interpreter: verdicts, ends, places and measures."""

import math
import re
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import runner
from benchmarks.arrays import compare, differences, drawn, played, scenario_of
from runner.batch import arrays
from runner.batch.arrays import NEAREST, Together, obstacle, structures
from runner.batch.batch import run_batch, runnable
from runner.batch.jobs import Outcome, jobs_of
from runner.batch.options import BatchOptions
from runner.batch.outputs.terminal import OutcomeTable
from runner.judging.settings import RunSettings
from tests.commands import Command
from tests.runner.files import place, scenario

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
CONFORMANCE = Path(__file__).parents[2] / "conformance" / "scenarios"
WEEK = int(datetime.now(UTC).strftime("%G%V"))
"""Seed of the sets that are drawn: others each week"""


def settings(sut: str = "none") -> RunSettings:
    return RunSettings(world="kinematic", sut=sut)


@pytest.mark.parametrize("sut", ["none", "cas"])
def test_cutting_in_is_played_as_by_the_interpreter(sut: str) -> None:
    runs, found, _ = compare(LIBRARY / "cut_in_highway.xosc", settings(sut), 6, 3)
    assert (runs, found) == (6, [])


def test_contacts_within_long_steps_are_those_of_the_interpreter() -> None:
    """At steps of 1 s vehicles pass through each other between the ends of two steps."""
    chosen = replace(settings(), timestep=1.0)
    sets = [
        {"Ego_Speed_mps": "42", "CutIn_Gap_m": gap, "CutIn_StartTime_s": "2"}
        for gap in ("20", "40", "60")
    ]
    path = LIBRARY / "cut_in_highway.xosc"
    found = played(path, sets, chosen)
    for index, parameters in enumerate(sets):
        single = runner.run(path, chosen, parameters=parameters)
        outcomes, row = found[index]
        times = [each.time for each in single.events if each.kind == "collision"]
        assert all(time % 1.0 for time in times)
        assert outcomes.outcome[row] == single.verdict.outcome
        assert outcomes.contact[row] == pytest.approx(min(times, default=math.inf))
    assert {outcomes.outcome[row] for outcomes, row in found.values()} == {"passed", "failed"}


def test_a_junction_is_crossed_as_by_the_interpreter() -> None:
    runs, found, _ = compare(LIBRARY / "turn_off_t_junction.xosc", settings(), 3, 3)
    assert (runs, found) == (3, [])


def test_an_ego_that_is_asked_for_too_much_is_inconclusive_in_arrays_too() -> None:
    """The scenario asks for more acceleration than the vehicle has: searches draw it by the dozen,
    and each such run took many times as long one by one."""
    path = LIBRARY / "lane_change_left_highway.xosc"
    sets = [
        {
            "Ego_StartSpeed_mps": "15.43",
            "Ego_EndSpeed_mps": speed,
            "Ego_StartTime_s": "2.152",
            "Ego_Duration_s": duration,
            "Ego_FinalSpeed_mps": final,
            "Ego_RestTime_s": "1.505",
            "Ego_Gap_m": "125.4",
            "Lead_Speed_mps": "22.84",
        }
        for speed, duration, final in (("28.66", "1.5", "40.66"), ("20.66", "6.635", "22.66"))
    ]
    found = played(path, sets, settings())
    singles = [runner.run(path, settings(), parameters=each) for each in sets]
    assert "its Performance allows" in singles[0].verdict.reasons[0]
    for number, single in enumerate(singles):
        outcomes, row = found[number]
        assert outcomes.outcome[row] == single.verdict.outcome
    assert [each.verdict.outcome for each in singles] == ["inconclusive", "passed"]


def _compared(folder: Path, sut: str, sets: int) -> tuple[int, int]:
    """Files that play in arrays and their compared runs, which have no differences."""
    different, compared, reached = {}, 0, 0
    for path in runnable([str(folder)]):
        scenario, first = scenario_of(path, 0, 0)
        if obstacle(scenario, settings(sut), first):
            continue
        runs, found, _ = compare(path, settings(sut), sets, WEEK)
        compared, reached = compared + runs, reached + 1
        if found:
            different[path.name] = found
    assert different == {}
    return reached, compared


@pytest.mark.slow
@pytest.mark.parametrize("sut", ["none", "cas", "adas", "r157-cc"])
def test_library_files_are_played_as_by_the_interpreter(sut: str) -> None:
    print(f"seed {WEEK}")
    reached, compared = _compared(LIBRARY, sut, 4)
    assert reached >= 104 and compared >= 1.5 * reached  # what arrays leave varies with the draw


@pytest.mark.slow
@pytest.mark.parametrize("sut", ["none", "cas"])
@pytest.mark.parametrize(("folder", "files"), [("alks", 30), ("ncap_2023", 60)])
def test_public_files_are_played_as_by_the_interpreter(
    sut: str, folder: str, files: int, corpora: Path
) -> None:
    print(f"seed {WEEK}")
    reached, compared = _compared(corpora / folder, sut, 2)
    assert reached >= files and compared >= files


@pytest.mark.slow
@pytest.mark.parametrize("sut", ["none", "cas"])
def test_each_element_is_played_as_by_the_interpreter(sut: str, tmp_path: Path) -> None:
    """Scenarios of elements, with their first entity as the ego."""
    shutil.copytree(CONFORMANCE.parent, tmp_path, dirs_exist_ok=True)
    for path in (tmp_path / "scenarios").glob("*.xosc"):
        text = path.read_text("utf-8")
        if first := re.search('<ScenarioObject name="([^"]+)"', text):
            path.write_text(re.sub(f'"[$]?{first[1]}"', '"Ego"', text), encoding="utf-8")
    reached, _ = _compared(tmp_path / "scenarios", sut, 2)
    assert reached >= 50


def test_an_element_that_plays_in_single_runs_only_is_named_with_its_line() -> None:
    path = CONFORMANCE / "LightStateAction.xosc"
    reason = obstacle(path, settings())
    assert "LightStateAction plays in single runs only" in reason
    assert "LightStateAction.xosc:" in reason


def test_evidence_and_traffic_are_left_to_single_runs() -> None:
    path = LIBRARY / "cut_in_highway.xosc"
    limited = RunSettings(world="kinematic", sut="none", least=("ego_seconds=2",))
    assert "least values" in obstacle(path, limited)
    assert "sumo" in obstacle(path, RunSettings(sut="sumo"))


def test_sets_of_another_structure_are_compiled_apart() -> None:
    path = LIBRARY / "simple_cut_in.xosc"
    sets = drawn(path, 8, 0)
    sizes = [len(each.members) for each in structures(path, sets, settings())]
    assert sum(sizes) == 8


def test_sets_among_those_of_other_structures_keep_their_own_numbers() -> None:
    path = LIBRARY / "braking_leader_highway.xosc"
    sets = drawn(path, 8, 5)
    assert len(list(structures(path, sets, settings()))) > 1
    found = played(path, sets, settings())
    assert len(found) == 8
    for number, (outcomes, row) in found.items():
        single = runner.run(path, settings(), parameters=sets[number])
        assert list(differences(outcomes, row, single)) == []


def test_a_run_that_the_arrays_can_not_place_is_left_to_the_interpreter() -> None:
    path = LIBRARY / "cut_in_highway.xosc"
    sets = [{"Ego_Speed_mps": "30", "CutIn_StartTime_s": each} for each in ("3", "40")]
    found = played(path, sets, settings("cas"))
    assert 0 in found and 1 not in found
    assert (
        runner.run(path, settings("cas"), parameters=sets[0]).verdict.outcome
        == (found[0][0].outcome[found[0][1]])
    )


VARIATION = """<?xml version='1.0' encoding='UTF-8'?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" description="gaps" author="a" date="2026-11-28T00:00:00"/>
  <ParameterValueDistribution>
    <ScenarioFile filepath="{scenario}"/>
    <Deterministic>
      <DeterministicSingleParameterDistribution parameterName="CutIn_Gap_m">
        <DistributionRange stepWidth="1"><Range lowerLimit="5" upperLimit="24"/></DistributionRange>
      </DeterministicSingleParameterDistribution>
      <DeterministicSingleParameterDistribution parameterName="Ego_Speed_mps">
        <DistributionSet><Element value="34.5"/></DistributionSet>
      </DeterministicSingleParameterDistribution>
    </Deterministic>
  </ParameterValueDistribution>
</OpenSCENARIO>
"""


@pytest.mark.parametrize("limits", [(), ("min_ttc<0.5", "pet<0.01")])
def test_a_batch_in_arrays_has_the_verdicts_of_one_by_one_and_records_few(
    limits: tuple[str, ...], tmp_path: Path
) -> None:
    variation, out = tmp_path / "gaps.xosc", tmp_path / "out"
    variation.write_text(VARIATION.format(scenario=LIBRARY / "cut_in_highway.xosc"), "utf-8")
    told: list[str] = []
    chosen = replace(settings("cas"), fail_if=limits)
    source = jobs_of([variation], {}, True)
    together = Together(source, chosen, out, told.append)
    outcomes = list(together.checked(run_batch(iter(together), chosen, out=out)))
    singly = {each.job.name: each for each in run_batch(jobs_of([variation], {}, True), chosen)}
    assert {each.job.name: each.state for each in outcomes} == {
        name: each.state for name, each in singly.items()
    }
    failed = {each.job.name for each in outcomes if each.state == "failed"}
    recorded = {folder.name for folder in out.iterdir() if folder.is_dir()}
    assert failed and failed <= recorded and len(recorded) == min(len(failed) + NEAREST, 20)
    rows = pq.read_table(out / "sets.parquet").to_pylist()
    assert {row["run"]: row["outcome"] for row in rows} == {
        name: each.state for name, each in singly.items()
    }
    assert told == [
        f"{20 - len(failed)} sets passed in arrays, kinematically, {len(failed)} failed there, "
        "of which 0 did not fail one by one"
    ]


def test_sets_in_several_processes_have_the_outcomes_of_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrays, "BLOCK", 7)
    variation = tmp_path / "gaps.xosc"
    variation.write_text(VARIATION.format(scenario=LIBRARY / "cut_in_highway.xosc"), "utf-8")
    found = []
    for processes in (1, 2):
        out = tmp_path / str(processes)
        source = jobs_of([variation], {}, True)
        together = Together(source, settings("cas"), out, lambda line: None, processes)
        found.append((list(together), pq.read_table(out / "sets.parquet").to_pylist()))
    assert found[0] == found[1] and len(found[0][1]) == 20


@pytest.mark.parametrize("world", ["sumo", "kinematic"])
def test_verdicts_of_arrays_say_kinematically_where_the_world_is_another_one(
    world: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    variation = tmp_path / "gaps.xosc"
    variation.write_text(VARIATION.format(scenario=LIBRARY / "cut_in_highway.xosc"), "utf-8")
    chosen = RunSettings(world=world, sut="cas")
    together = Together(jobs_of([variation], {}, True), chosen, None, lambda line: None)
    table = OutcomeTable(verbose=False, quiet=False)
    passed = [each for each in together if isinstance(each, Outcome)]
    for outcome in passed:
        table.show(outcome)
    table.close()
    *lines, total = capsys.readouterr().out.splitlines()
    said = [line for line in lines if "in arrays, kinematically" in line]
    count = len(passed)
    assert len(said) == (count if world == "sumo" else 0) and count > 1
    note = f" ({count} in arrays, kinematically)" if world == "sumo" else ""
    assert total == f"{count} runs: {count} passed{note}"


SLOWER = """\
from runner.systems import Control
from runner.systems.arrays import BatchControl

class Alike:
    share = 0.9
    def reset(self, ego, timestep, seed):
        pass
    def control(self, observation, dt):
        return Control((0.9 * observation.target_speed - observation.ego.speed) / dt)
    def control_batch(self, observations, dt):
        return BatchControl((self.share * observations.target_speed - observations.ego.speed) / dt)

class Other(Alike):
    share = 0.8

class Late(Alike):
    def control(self, observation, dt):
        return Control((observation.target_speed - observation.ego.speed) / dt)
    def control_batch(self, observations, dt):
        return BatchControl(-6.0 + 0.0 * observations.ego.speed)
"""


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_pass_in_arrays_alone_is_told_as_a_contradiction(
    world: str, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scenario(tmp_path, init=place("Ego", 10, 20) + place("Lead", 60, 0), stop=8.0)
    (tmp_path / "slower.py").write_text(SLOWER, "utf-8")
    monkeypatch.chdir(tmp_path)
    call = ("xosc-run", path, "--batch", "--sut", "slower.py:Late", "--world", world)
    quiet = command(*call, "-q")  # without a folder, too
    assert quiet.code == 5 and "whose passes count for nothing" in quiet.err
    answer = command(*call, "--out", tmp_path / "out")
    assert answer.code == 5
    assert "passed in arrays, failed one by one" in answer.out
    assert "1 set ended otherwise in arrays than one by one" in answer.out


def test_a_failure_in_arrays_alone_is_told_as_a_disagreement(tmp_path: Path) -> None:
    variation = tmp_path / "gaps.xosc"
    variation.write_text(VARIATION.format(scenario=LIBRARY / "cut_in_highway.xosc"), "utf-8")
    told: list[str] = []
    together = Together(jobs_of([variation], {}, True), settings("cas"), None, told.append)
    failed = [each for each in together if not isinstance(each, Outcome)]
    passed = Outcome(failed[0], "passed", 0)
    assert list(together.checked([passed])) == [passed]
    assert "failed in arrays, passed one by one" in told[0]
    assert "otherwise" in together.fault


def test_a_system_that_decides_otherwise_in_arrays_is_told(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slower.py").write_text(SLOWER, "utf-8")
    monkeypatch.chdir(tmp_path)
    call = ("xosc-run", "simple_cut_in_variation", "--only", "2,3", "--batch", "--world")
    answers = {
        name: command(*call, "kinematic", "--sut", f"slower.py:{name}", "--out", tmp_path / name)
        for name in ("Alike", "Other")
    }
    assert answers["Alike"].code == 0 and "otherwise" not in answers["Alike"].out
    assert answers["Other"].code == 5
    assert "2 sets ended otherwise in arrays than one by one" in answers["Other"].out
    assert re.search(
        r"~000002: timeout at \S+ s in arrays, completed at \S+ s one by one",
        answers["Other"].out,
    )


@pytest.mark.parametrize("quiet", [(), ("-q",)])
def test_a_system_that_fails_in_arrays_is_told(
    quiet: tuple[str, ...], command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = SLOWER.replace(
        "return BatchControl((self.share", "raise KeyError('oops' or (self.share"
    )
    (tmp_path / "slower.py").write_text(broken, "utf-8")
    monkeypatch.chdir(tmp_path)
    call = ("xosc-run", "simple_cut_in_variation", "--only", "2", "--batch", "--sut")
    answer = command(*call, "slower.py:Alike", "--world", "kinematic", *quiet)
    assert answer.code == 5
    assert "fails in arrays" in answer.err if quiet else "KeyError: 'oops'" in answer.out


def test_a_batch_of_what_does_not_play_in_arrays_goes_one_by_one(tmp_path: Path) -> None:
    told: list[str] = []
    source = jobs_of([LIBRARY / "lane_closure_highway_variation.xosc"], {}, True)
    together = Together(source, settings(), tmp_path, told.append)
    assert not any(isinstance(each, Outcome) for each in together)
    assert "PreferredLaneLayerAction" in told[0]
    assert list(together.checked([])) == []
    assert told[1:] == ["no set was played to a verdict in arrays"]


def test_an_entity_moves_once_in_the_step_that_ends_its_path_on_a_lane(tmp_path: Path) -> None:
    source = CONFORMANCE / "FollowTrajectoryAction.xosc"
    text = source.read_text("utf-8").replace('"../roads', f'"{source.parents[1]}/roads')
    text = text.replace('"Car"', '"Ego"')
    path = tmp_path / "scenario.xosc"
    path.write_text(
        text.replace('x="140" y="8.25"', 'x="140" y="-1.75"').replace(
            'x="100" y="8.25"', 'x="160" y="-1.75"'
        ),
        encoding="utf-8",
    )
    compared, found, _ = compare(path, replace(settings(), max_time=15.0), 1, 0)
    assert (compared, found) == (1, [])


def test_a_set_that_is_no_valid_file_is_left_to_the_interpreter(tmp_path: Path) -> None:
    path = tmp_path / "scenario.xosc"
    text = (LIBRARY / "cut_in_highway.xosc").read_text("utf-8")
    path.write_text(
        text.replace("../../xodr/library", str(LIBRARY.parents[1] / "xodr/library"))
        .replace("catalogs/", f"{LIBRARY}/catalogs/")
        .replace('dLane="1"', 'dLane="${$Ego_Speed_mps / 30}"'),
        encoding="utf-8",
    )
    sets = [{"Ego_Speed_mps": each} for each in ("30", "30.3")]
    assert set(played(path, sets, settings())) == {0}


PLUGIN = """
from pathlib import Path
from typing import Any
from runner.systems import Control
class Noted:
    def reset(self, ego, timestep, seed):
        pass
    def control(self, observation, dt):
        return Control()
    def close(self):
        with Path("closed.txt").open("a") as file:
            file.write("x")
"""


def test_systems_are_closed_after_their_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "noted.py").write_text(PLUGIN)
    sets = [{"CutIn_Gap_m": each} for each in ("40", "41", "42")]
    chosen = replace(settings("noted.py:Noted"), sut_in_process=True, max_time=0.5)
    assert set(played(LIBRARY / "cut_in_highway.xosc", sets, chosen)) == {0, 1, 2}
    assert (tmp_path / "closed.txt").read_text() == "xxx"


def test_sets_of_scenarios_with_other_parameters_are_in_one_table(tmp_path: Path) -> None:
    alone, variation = tmp_path / "alone.xosc", tmp_path / "gaps.xosc"
    text = (LIBRARY / "cut_in_highway.xosc").read_text("utf-8")
    variation.write_text(VARIATION.format(scenario=LIBRARY / "cut_in_highway.xosc"), "utf-8")
    alone.write_text(
        text.replace("../../xodr/library", str(LIBRARY.parents[1] / "xodr/library"))
        .replace("catalogs/", f"{LIBRARY}/catalogs/")
        .replace(
            'name="CutIn_Gap_m" parameterType="double" value="20.0"',
            'name="CutIn_Gap_m" parameterType="double" value="60.0"',
        ),
        encoding="utf-8",
    )
    out = tmp_path / "out"
    source = jobs_of([alone, variation], {}, True)
    played_jobs = list(Together(source, settings(), out, lambda line: None))
    rows = pq.read_table(out / "sets.parquet").to_pylist()
    assert len(rows) == 21 <= len(played_jobs)
    assert [len(row["parameters"]) for row in rows] == [0, *[2] * 20]


@pytest.mark.parametrize(
    ("asked", "world", "sets", "chosen"),
    [
        ({}, "kinematic", 200, True),
        ({}, "kinematic", 199, False),
        ({}, "sumo", 1000, False),  # arrays are kinematic, and the world is not changed in silence
        ({"in_arrays": True}, "sumo", 2, True),
        ({"in_arrays": False}, "kinematic", 1000, False),
        ({"ray": "local"}, "kinematic", 1000, False),
    ],
)
def test_many_sets_are_played_in_arrays_where_nothing_needs_each_run(
    asked: dict[str, Any], world: str, sets: int, chosen: bool
) -> None:
    assert BatchOptions(**asked).plays_in_arrays(world, lambda: sets) == chosen
