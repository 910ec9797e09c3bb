"""Results of a batch that somebody has edited, with all digests right: they do
not count as passed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.folder import digests
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from schemas.common.storage import Records, digest
from tests.commands import Command
from tests.runner.files import place, scenario

CRASH = {"init": place("Ego", 100, 20) + place("Lead", 110, 5), "stop": 2.0}
SAFE = {"init": place("Ego", 100, 20) + place("Lead", 200, 20), "stop": 2.0}
QUICK = ("--world", "kinematic", "--sut", "none")
KEY = "a key that nobody else knows"


class Forgery:
    """A batch of one run that fails, and one that passes, as an attacker edits it."""

    def __init__(self, folder: Path, command: Command) -> None:
        self.folder, self.out, self._command = folder, folder / "out", command
        scenario(folder, "crash", **CRASH)
        scenario(folder, "safe", **SAFE)
        assert self.run().code == 1

    def run(self, *options: object, paths: tuple[str, ...] = ("crash", "safe")) -> Any:
        files = [self.folder / f"{name}.xosc" for name in paths]
        return self._command("xosc-run", *files, *QUICK, "--out", self.out, *options)

    def resume(self, *options: object) -> Any:
        return self.run("--resume", *options)

    def edit(self, change: Callable[[dict[str, Any]], None], name: str = "crash") -> None:
        """Edit the entry of a run, with its digest."""
        journal = Records(self.out / "runs.jsonl")
        records = journal.read().records
        for record in records:
            if record["job"]["name"] == name:
                change(record)
                record["files"] = digests(self.out / name) if record["files"] else {}
        journal.path.unlink()
        journal.add(records)

    def edit_result(self, change: Callable[[dict[str, Any]], None]) -> None:
        path = self.out / "crash" / "result.json"
        values = json.loads(path.read_text())
        change(values)
        path.write_text(json.dumps(values))


@pytest.fixture
def forged(tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch) -> Forgery:
    monkeypatch.delenv("XOSC_SEAL_KEY", raising=False)
    return Forgery(tmp_path, command)


PASSED: dict[str, Any] = {"state": "passed", "exit_code": 0, "message": "", "impact": None}


def passed(entry: dict[str, Any]) -> None:
    entry.update(PASSED)


def passed_result(values: dict[str, Any]) -> None:
    values |= {"verdict": "passed", "reasons": [], "causes": []}


def truncate(out: Path) -> None:
    """Trajectories that end before the contact."""
    path = out / "crash" / "trajectories.parquet"
    table = pq.read_table(path)
    pq.write_table(table.filter(pa.compute.less(table["time"], 0.2)), path)


def entry_only(forged: Forgery) -> None:
    forged.edit(passed)


def entry_without_files(forged: Forgery) -> None:
    def change(entry: dict[str, Any]) -> None:
        passed(entry)
        entry["files"] = {}

    forged.edit(change)


def entry_and_result(forged: Forgery) -> None:
    forged.edit_result(passed_result)
    forged.edit(passed)


def entry_result_and_short_trajectories(forged: Forgery) -> None:
    forged.edit_result(passed_result)
    truncate(forged.out)
    forged.edit(passed)


def results_of_another_run(forged: Forgery) -> None:
    shutil.rmtree(forged.out / "crash")
    shutil.copytree(forged.out / "safe", forged.out / "crash")
    (safe,) = (
        record
        for record in Records(forged.out / "runs.jsonl").read().records
        if record["job"]["name"] == "safe"
    )
    kept = ("job", "inputs", "content")
    forged.edit(lambda entry: entry.update({k: v for k, v in safe.items() if k not in kept}))


def error_with_code_0(forged: Forgery) -> None:
    forged.edit(lambda entry: entry.update(state="error", exit_code=0, files={}))


def unknown_state(forged: Forgery) -> None:
    forged.edit(lambda entry: entry.update(state="loaded", exit_code=0))


def passed_with_code_0_and_reasons(forged: Forgery) -> None:
    forged.edit(lambda entry: entry.update(exit_code=0))


def inconclusive(forged: Forgery) -> None:
    forged.edit(lambda entry: entry.update(state="inconclusive", exit_code=6))


def no_ego(forged: Forgery) -> None:
    def change(values: dict[str, Any]) -> None:
        passed_result(values)
        values |= {"ego": None, "criticality": None}
        kept = [each for each in values["evidence"] if each["name"] != "ego_seconds"]
        values["evidence"] = kept

    def evidence() -> Any:
        return json.loads((forged.out / "crash" / "result.json").read_text())["evidence"]

    forged.edit_result(change)
    forged.edit(lambda entry: entry.update(PASSED, measures={}, evidence=evidence()))


ATTACKS = (
    entry_only,
    entry_without_files,
    entry_and_result,
    entry_result_and_short_trajectories,
    results_of_another_run,
    error_with_code_0,
    unknown_state,
    passed_with_code_0_and_reasons,
    inconclusive,
    no_ego,
)


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_a_forged_entry_is_run_anew(forged: Forgery, attack: Callable[[Forgery], None]) -> None:
    attack(forged)
    answer = forged.resume()
    assert answer.code == 1 and "1 failed, 1 passed" in answer.out
    assert "run anew" in answer.err and "Traceback" not in answer.err
    assert forged.resume().err == ""


SHAPES: dict[str, Any] = {
    "parameters": {"job": {"parameters": [1]}},
    "label": {"job": {"label": 3}},
    "seed": {"job": {"seed": "x"}},
    "source": {"job": {"source": None}},
    "files": {"files": [1]},
    "digests": {"files": {"result.json": None}},
    "measures": {"measures": {"min_ttc": "x"}},
    "extreme": {"measures": {"min_ttc": {"value": []}}},
    "evidence": {"evidence": [{"name": 1}]},
    "impact": {"impact": {"point": "xy"}},
    "criteria": {"criteria": "none"},
    "remarks": {"remarks": [None]},
    "end": {"end_time": "never"},
    "message": {"message": {}},
    "nothing": {"job": None},
    "more": {"color": "red"},
    "big": {"end_time": 1e308},
}


@pytest.mark.parametrize("shape", SHAPES)
def test_an_entry_of_another_shape_is_no_entry(
    forged: Forgery, shape: str, command: Command
) -> None:
    def change(entry: dict[str, Any]) -> None:
        for name, value in SHAPES[shape].items():
            if name == "job" and isinstance(value, dict):
                entry["job"] |= value
            else:
                entry[name] = value

    journal = Records(forged.out / "runs.jsonl")
    records = journal.read().records
    change(records[0])
    journal.path.unlink()
    journal.add(records)
    (forged.out / "runs.parquet").unlink()
    for name in ("xosc-replay",):
        answer = command(name, forged.out)
        assert "internal error" not in answer.err and "Traceback" not in answer.err
    answer = forged.resume()
    assert answer.code == 1 and "1 failed, 1 passed" in answer.out
    assert "internal error" not in answer.err


def test_an_entry_nested_too_deep_is_no_entry(forged: Forgery) -> None:
    content = b'{"job": ' + b"[" * 100_000 + b"]" * 100_000
    with (forged.out / "runs.jsonl").open("ab") as journal:
        journal.write(content + b', "digest": "%s"}\n' % digest(content).encode())
    answer = forged.resume()
    assert answer.code == 1 and "1 line damaged" in answer.err


def test_untrusted_believes_nothing_that_is_stored(forged: Forgery) -> None:
    answer = forged.resume("--untrusted")
    assert answer.code == 1
    assert answer.err == (
        "2 finished runs that --untrusted does not believe without XOSC_SEAL_KEY: run anew "
        "(crash, …)\n"
    )


def test_entries_count_by_the_seal_of_the_key(
    forged: Forgery, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_SEAL_KEY", KEY)
    unsealed = "2 finished runs without the seal of XOSC_SEAL_KEY: run anew (crash, …)\n"
    assert forged.resume().err == unsealed
    assert forged.resume().err == forged.resume("--untrusted").err == ""
    forged.edit(passed)
    assert forged.resume().err.startswith("1 finished run without the seal")
    monkeypatch.setenv("XOSC_SEAL_KEY", KEY + "!")
    assert forged.resume().err == unsealed
    monkeypatch.setenv("XOSC_SEAL_KEY", "short")
    answer = forged.resume()
    assert answer.code == 2 and "16 characters" in answer.err


def test_the_key_is_in_no_file(forged: Forgery, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XOSC_SEAL_KEY", KEY)
    forged.resume("--replay")
    found = [path for path in forged.out.rglob("*") if path.is_file()]
    assert found and not any(KEY.encode() in path.read_bytes() for path in found)


def test_sealed_results_are_those_that_were_sealed(
    forged: Forgery, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_SEAL_KEY", KEY)
    forged.resume()
    forged.edit_result(passed_result)
    answer = forged.resume()
    assert answer.code == 1 and "damaged or missing" in answer.err


def test_an_earlier_batch_hides_new_failures_only_with_the_seal(
    forged: Forgery, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    def against(*options: str) -> Any:
        limits = ("--against", forged.out, "--fail-if", "new-failure")
        return command("xosc-run", forged.folder / "crash.xosc", *QUICK, *limits, *options)

    assert against().code == 0
    answer = against("--untrusted")
    assert answer.code == 2 and "XOSC_SEAL_KEY" in answer.err
    monkeypatch.setenv("XOSC_SEAL_KEY", KEY)
    answer = against()
    assert answer.code == 1 and "1 new" in answer.out
    forged.resume()
    assert against().code == against("--untrusted").code == 0


@pytest.mark.parametrize("name", ["../victim", "/victim", "..", "."])
def test_a_table_of_runs_names_no_folder_outside(
    forged: Forgery, command: Command, name: str
) -> None:
    path = forged.out / "runs.parquet"
    table = pq.read_table(path)
    names = pa.array([name, "safe"])
    pq.write_table(table.set_column(table.column_names.index("name"), "name", names), path)
    before = tree(forged.folder)
    answer = command("xosc-replay", forged.out, "--against", forged.out)
    assert answer.code == 3 and "names no folder" in answer.err
    assert {path for path in tree(forged.folder) if "out" not in path.parts} <= before


def test_a_replay_of_a_batch_writes_through_no_link(forged: Forgery, command: Command) -> None:
    victim = forged.folder / "victim"
    (forged.out / "crash").rename(victim)
    (forged.out / "crash").symlink_to(victim)
    before = tree(victim)
    answer = command("xosc-replay", forged.out, "--against", forged.out)
    assert "symbolic link" in answer.err
    assert tree(victim) == before


def tree(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_results_that_are_whole_follow_from_themselves(tmp_path: Path) -> None:
    """Limits, criteria, seeds, several participants: nothing sound is run anew."""
    told: list[str] = []
    paths = [scenario(tmp_path, "crash", **CRASH), scenario(tmp_path, "safe", **SAFE)]
    limits = ("min_ttc<1", "rss", "end_time>1", "timeout")
    settings = RunSettings(sut="cas", world="kinematic", fail_if=limits, least=("ego_seconds=0.5",))
    for resume in (False, True):
        jobs = jobs_of(paths, {}, True, repeat=2)
        out = tmp_path / "out"
        states = [
            each.state
            for each in run_batch(jobs, settings, out=out, resume=resume, tell=told.append)
        ]
        assert len(states) == 4 and "error" not in states
    assert told == []


def test_a_key_that_is_too_short_is_refused_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_SEAL_KEY", "short")
    jobs = jobs_of([scenario(tmp_path, "safe", **SAFE)], {}, True)
    with pytest.raises(UsageError, match="16 characters"):
        list(run_batch(jobs, RunSettings(world="kinematic"), out=tmp_path / "out"))
