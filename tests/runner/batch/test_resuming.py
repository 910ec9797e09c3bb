"""What counts as finished where a batch is resumed: runs of which nothing has
changed, and whose results are whole.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from importlib import invalidate_caches
from pathlib import Path
from types import ModuleType

import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import Job, Outcome, jobs_of
from runner.batch.journal import Journal, finished
from runner.judging.result import RunResult
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from tests.commands import Command
from tests.runner.files import distribution, scenario

QUICK = RunSettings(sut="none", world="kinematic")
MINE = """
class Mine:
    def reset(self, ego, timestep, seed): pass
    def control(self, observation, dt):
        from runner.systems import Control
        return Control()  # {comment}
"""

CATALOGUE = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="tests" description="test"/>
<Catalog name="cars"/></OpenSCENARIO>"""


class Batch:
    """Three runs in a folder, and which of them are done when it is resumed."""

    def __init__(self, folder: Path) -> None:
        self.scenario = scenario(folder, stop=0.1)
        self.road = folder / "straight.xodr"
        self.variation = distribution(folder, "variation", {"Gap": (20, 40, 10)})
        self.out = folder / "out"

    def resume(self, settings: RunSettings = QUICK) -> tuple[list[int], list[str]]:
        """Numbers of the runs that are done, and what is told."""
        done: list[int] = []
        told: list[str] = []
        jobs = jobs_of([self.variation], {}, True)
        outcomes = list(
            run_batch(
                jobs, settings, out=self.out, resume=True, also=[note(done)], tell=told.append
            )
        )
        assert [outcome.state for outcome in outcomes] == ["passed"] * 3
        assert sorted(finished(self.out).outcomes) == [outcome.job.name for outcome in outcomes]
        return done, told


def note(done: list[int]) -> Callable[[RunResult], None]:
    return lambda result: done.append(int(result.name[-6:]))


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    made = Batch(tmp_path)
    assert made.resume() == ([0, 1, 2], [])
    assert made.resume() == ([], [])
    return made


@pytest.mark.parametrize("file", ["scenario", "road", "variation"])
def test_an_edited_file_is_run_anew(batch: Batch, file: str) -> None:
    path: Path = getattr(batch, file)
    path.write_text(f"{path.read_text()}<!-- edited -->")
    done, (line,) = batch.resume()
    assert done == [0, 1, 2]
    assert line == (
        "3 finished runs of files, a system or a toolchain that have changed: run anew "
        "(variation~000000, …)"
    )
    assert batch.resume() == ([], [])


def test_an_edited_system_under_test_is_run_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    module = tmp_path / "resumed_system.py"
    module.write_text(MINE.format(comment="first"))
    invalidate_caches()
    batch, settings = Batch(tmp_path), RunSettings(sut="resumed_system:Mine", world="kinematic")
    assert batch.resume(settings)[0] == [0, 1, 2]
    assert batch.resume(settings)[0] == []
    module.write_text(MINE.format(comment="second"))
    assert batch.resume(settings)[0] == [0, 1, 2]


@pytest.mark.parametrize("in_process", [False, True])
def test_an_edited_module_beside_the_system_is_run_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    helper = f"helper_of_resumed_{in_process}".lower()
    (tmp_path / "resumed_main.py").write_text(f"import {helper}\n{MINE.format(comment='')}")
    module = tmp_path / f"{helper}.py"
    module.write_text("GAIN = 1.0\n")
    invalidate_caches()
    name = f"{tmp_path / 'resumed_main.py'}:Mine"
    made_up = ModuleType("made_up")
    made_up.__file__ = "_made_up.py"  # as torch.classes has one
    monkeypatch.setitem(sys.modules, "made_up", made_up)
    settings = RunSettings(sut=name, world="kinematic", sut_in_process=in_process)
    batch = Batch(tmp_path)
    assert batch.resume(settings)[0] == [0, 1, 2]
    assert batch.resume(settings)[0] == []
    module.write_text("GAIN = 2.0\n")
    assert batch.resume(settings)[0] == [0, 1, 2]


@pytest.mark.parametrize("changed", ["road", "catalogue"])
def test_files_of_a_scenario_whose_own_road_is_missing_count(tmp_path: Path, changed: str) -> None:
    batch = Batch(tmp_path)
    road, catalogue = tmp_path / "given.xodr", tmp_path / "catalogues" / "cars.xosc"
    batch.road.rename(road)
    catalogue.parent.mkdir()
    catalogue.write_text(CATALOGUE)
    text = batch.scenario.read_text()
    locations = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="catalogues"/></VehicleCatalog></CatalogLocations>'
    )
    assert "<CatalogLocations/>" in text
    batch.scenario.write_text(text.replace("<CatalogLocations/>", locations))
    settings = RunSettings(sut="none", world="kinematic", road=str(road))
    assert batch.resume(settings)[0] == [0, 1, 2]
    assert batch.resume(settings)[0] == []
    path = {"road": road, "catalogue": catalogue}[changed]
    path.write_text(path.read_text() + "<!-- another -->")
    assert batch.resume(settings)[0] == [0, 1, 2]


@pytest.mark.parametrize("harm", ["removed", "empty", "damaged", "folder"])
@pytest.mark.parametrize("file", ["result.json", "trajectories.parquet"])
def test_a_damaged_result_is_run_anew(batch: Batch, harm: str, file: str) -> None:
    folder = batch.out / "variation~000001"
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    if harm == "removed":
        (folder / file).unlink()
    elif harm == "folder":
        shutil.rmtree(folder)
    else:
        (folder / file).write_bytes(before[file][:-1] + b"?" if harm == "damaged" else b"")
    assert batch.resume() == (
        [1],
        ["1 finished run with results that are damaged or missing: run anew (variation~000001)"],
    )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "file"), [("--plot", "picture.png"), ("--replay", "replay.html")]
)
def test_what_finished_runs_lack_is_made(
    option: str, file: str, tmp_path: Path, command: Command
) -> None:
    path = scenario(tmp_path, stop=0.1)
    variation = distribution(tmp_path, "variation", {"Gap": (20, 30, 10)})
    out = tmp_path / "out"
    arguments = ("xosc-run", "--world", "kinematic", path, variation, "--out", out, "--resume")
    assert command(*arguments, "--sut", "none").code == 0
    again = command(*arguments, "--sut", "none", option)
    assert again.err == f"3 finished runs without {file}: run anew (scenario, …)\n"
    assert sorted(each.parent.name for each in out.glob(f"*/{file}")) == [
        "scenario",
        "variation~000000",
        "variation~000001",
    ]
    assert command(*arguments, "--sut", "none", option).err == ""


@pytest.mark.parametrize("options", [("--gui",), ("--osi", "trace.osi")])
def test_what_needs_the_run_itself_does_not_go_with_finished_ones(
    options: tuple[str, ...], tmp_path: Path, command: Command
) -> None:
    answer = command(
        "xosc-run", scenario(tmp_path), "--out", tmp_path / "out", "--resume", *options
    )
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert answer.err.startswith(
        f"xosc-run: {options[0]} is of runs that are played, and --resume leaves out finished ones"
    )


def test_a_damaged_line_of_the_journal_is_a_run_repeated(batch: Batch) -> None:
    journal = batch.out / "runs.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    lines[1] = lines[1].replace('"passed"', '"failed"')
    journal.write_text("".join(lines) + "nonsense\n[1]\n")
    assert batch.resume() == ([1], [f"{journal}:2: 3 lines damaged: the runs are run anew"])
    assert finished(batch.out).damaged == []


def test_a_batch_of_other_files_is_refused(batch: Batch) -> None:
    other = scenario(batch.scenario.parent, "other", stop=0.1)
    before = (batch.out / "runs.jsonl").read_bytes()
    with pytest.raises(
        UsageError, match=r"a batch with runs of .*variation\.xosc, which is not among the files"
    ):
        list(run_batch(jobs_of([other], {}, True), QUICK, out=batch.out, resume=True))
    assert (batch.out / "runs.jsonl").read_bytes() == before


@pytest.mark.parametrize("status", ["memory", "died"])
def test_a_run_that_lacked_memory_is_run_anew(tmp_path: Path, status: str) -> None:
    path, out = scenario(tmp_path, stop=0.1), tmp_path / "out"
    (first,) = run_batch(jobs_of([path], {}, True), QUICK, out=out)
    (out / "runs.jsonl").unlink()
    ended = Outcome(
        first.job, "error", 4, "this takes more memory than there is", status, inputs=first.inputs
    )
    Journal(out, {}).enter(ended)
    (again,) = run_batch(jobs_of([path], {}, True), QUICK, out=out, resume=True)
    assert again.state == "passed"


def test_runs_are_entered_together_when_they_come_fast(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[list[Path]] = []
    monkeypatch.setattr("runner.batch.journal.sync", lambda paths: synced.append(list(paths)))
    journal = Journal(tmp_path, {})
    for name in "abcd":
        journal.enter(Outcome(Job(name, Path(name), Path(name)), "passed", 0))
    assert finished(tmp_path).outcomes.keys() == {"a"}
    journal.flush()
    assert finished(tmp_path).outcomes.keys() == set("abcd")
    assert len(synced) == 4, "files and folders, twice"


def test_a_run_is_entered_once_though_an_interrupt_brings_it_twice(tmp_path: Path) -> None:
    journal = Journal(tmp_path, {})
    for _ in range(2):
        journal.enter(Outcome(Job("a", Path("a"), Path("a")), "passed", 0))
    journal.flush()
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == 1


def test_overwriting_replaces_the_batch_and_leaves_other_files(
    tmp_path: Path, command: Command
) -> None:
    scenario(tmp_path, "first")
    scenario(tmp_path, "second")
    out = tmp_path / "out"
    call = ("xosc-run", "--world", "kinematic", "--sut", "none", "--out", out)
    command(*call, tmp_path / "first.xosc", "--replay")
    (out / "notes.txt").write_text("mine")
    (out / "mine").mkdir()
    refused = command(*call, tmp_path / "second.xosc")
    assert refused.code == 2 and "--overwrite to replace it" in refused.err
    other = command(*call, tmp_path / "second.xosc", "--resume")
    assert other.code == 2 and "which is not among the files" in other.err, (
        "a batch of other scenarios is not gone on with"
    )
    command(*call, tmp_path / "second.xosc", "--overwrite")
    names = {path.name for path in out.iterdir() if not path.name.startswith(".")}
    assert names == {
        "second",
        "runs.jsonl",
        "batch.json",
        "runs.parquet",
        "work.json",
        "notes.txt",
        "mine",
    }
    assert command(*call, tmp_path / "first.xosc", "--overwrite", "--against", out).code == 2
    assert (out / "second" / "result.json").is_file(), "what is compared with is not removed"
