"""Batches: order, determinism over processes, defects, interruption and
resumption, names of result folders.
"""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from runner.batch.batch import run_batch
from runner.batch.jobs import Job, Outcome, jobs_of, names_of
from runner.batch.journal import finished
from runner.judging.measures import criticality
from runner.judging.result import RunResult
from runner.judging.settings import RunSettings
from runner.recording import Recording
from runner.view import rehearsal
from runner.view.rehearsal import rehearse_batch
from schemas.common.errors import UsageError
from schemas.common.policy import CommandPolicy, in_force
from tests.commands import Command
from tests.runner.files import SLOW_SYSTEM, distribution, place, scenario

QUICK = RunSettings(sut="none", world="kinematic")


def batch(paths: list[Path], options: RunSettings = QUICK, **settings: object) -> list[Outcome]:
    return list(run_batch(jobs_of(paths, {}, True), options, **settings))  # type: ignore[arg-type]


def names(outcomes: list[Outcome]) -> list[str]:
    return [outcome.job.name for outcome in outcomes]


@pytest.fixture
def variation(tmp_path: Path) -> Path:
    """Six runs of half a simulated second."""
    scenario(tmp_path, stop=0.5)
    return distribution(tmp_path, "variation", {"Gap": (20, 70, 10)})


# order and results --------------------------------------------------------------------------


def test_outcomes_come_in_the_order_of_files_and_parameter_sets(
    tmp_path: Path, variation: Path
) -> None:
    last = scenario(tmp_path, "last", stop=0.1)
    expected = [f"variation~{n:06d}" for n in range(6)] + ["last"]
    for processes in (1, 2):
        outcomes = batch([variation, last], processes=processes)
        assert names(outcomes) == expected
        assert [o.job.parameters.get("Gap") for o in outcomes] == [
            "20",
            "30",
            "40",
            "50",
            "60",
            "70",
            None,
        ]
        assert {o.state for o in outcomes} == {"passed"}


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.parent != folder and p.is_file()
    }


def test_results_are_the_same_bytes_in_one_process_in_two_and_again(
    tmp_path: Path, variation: Path
) -> None:
    options = RunSettings(world="kinematic", seed=3)
    for name, processes in (("serial", 1), ("parallel", 2), ("again", 1)):
        batch([variation], options, out=tmp_path / name, processes=processes)
    serial = files(tmp_path / "serial")
    assert sorted({Path(name).name for name in serial}) == [
        "criticality.parquet",
        "events.jsonl",
        "result.json",
        "trajectories.csv",
        "trajectories.parquet",
    ]
    assert len(serial) == 30
    journals = {(tmp_path / name / "runs.jsonl").read_bytes() for name in ("serial", "parallel")}
    assert len(journals) == 1
    assert files(tmp_path / "parallel") == serial
    assert files(tmp_path / "again") == serial


def test_an_error_does_not_end_the_batch(tmp_path: Path) -> None:
    good = scenario(tmp_path, "good", stop=0.1)
    broken = tmp_path / "broken.xosc"
    broken.write_text("<OpenSCENARIO>")
    outcomes = batch([tmp_path / "absent.xosc", broken, tmp_path, good])
    assert [(o.state, o.exit_code) for o in outcomes] == [("error", 3)] * 3 + [("passed", 0)]
    assert "absent.xosc" in outcomes[0].message
    assert "broken.xosc:1" in outcomes[1].message
    assert "folder" in outcomes[2].message


def test_a_defect_of_the_runner_is_an_internal_error_of_that_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("two\nlines")

    monkeypatch.setattr("runner.judging.execution.run", fail)
    (outcome,) = batch([scenario(tmp_path)])
    assert (outcome.exit_code, outcome.message) == (5, "internal error: RuntimeError: two lines")
    assert "Traceback" in outcome.trace


def test_a_catalogue_can_not_be_run(tmp_path: Path) -> None:
    path = tmp_path / "catalog.xosc"
    header = (
        '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="a" '
        'description="d"/>'
    )
    path.write_text(f'<OpenSCENARIO>{header}<Catalog name="c"/></OpenSCENARIO>')
    (outcome,) = batch([path])
    assert outcome.exit_code == 3
    assert "catalog" in outcome.message


def test_a_parameter_that_the_distribution_sets_can_not_be_given(
    tmp_path: Path, variation: Path
) -> None:
    (outcome,) = run_batch(jobs_of([variation], {"Gap": "7"}, True), QUICK)
    assert outcome.exit_code == 2
    assert "'Gap'" in outcome.message
    given = list(run_batch(jobs_of([variation], {"Ego_Speed": "7"}, True), QUICK))
    assert {o.job.parameters["Ego_Speed"] for o in given} == {"7"}


def test_rehearsing_compiles_and_does_not_run(tmp_path: Path) -> None:
    unsupported = scenario(tmp_path, "unsupported", init='<Private entityRef="Nobody"/>')
    variation = distribution(tmp_path, "sets", {"Gap": (10, 30, 1)})
    files = [scenario(tmp_path), unsupported, variation]
    outcomes = list(rehearse_batch(jobs_of(files, {}, True), QUICK))
    assert [(o.state, o.status, o.exit_code) for o in outcomes] == [
        ("loaded", "compiled", 0),
        ("error", "", 3),
        ("loaded", "compiled", 0),
    ]
    assert outcomes[-1].message == "21 parameter sets"
    in_two = list(rehearse_batch(jobs_of(files, {}, True), QUICK, processes=2))
    assert [replace(outcome, trace="") for outcome in in_two] == [
        replace(outcome, trace="") for outcome in outcomes
    ]


@given(st.lists(st.tuples(*[st.sampled_from("abcd")] * 3)), st.integers(0, 5))
def test_of_many_sets_those_are_rehearsed_in_which_values_meet_first(
    values: list[tuple[str, ...]], all_of: int
) -> None:
    file = Path("file.xosc")
    jobs = [
        Job(str(k), file, file, dict(zip(("A", "B", "C"), each, strict=True)))
        for k, each in enumerate(values)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rehearsal, "ALL", all_of)
        pairwise = rehearsal.Pairwise(jobs)
        kept = [job for job in pairwise if isinstance(job, Job)]
    assert kept[:all_of] == jobs[:all_of]
    assert kept == [job for job in jobs if job in kept]
    assert pairwise.sets == Counter({file: len(jobs)} if jobs else {})
    there, met = (
        {pair for job in some for pair in combinations(job.parameters.items(), 2)}
        for some in (jobs, kept)
    )
    assert met == there
    for number, job in enumerate(kept[all_of:], all_of):
        before = {
            pair for other in kept[:number] for pair in combinations(other.parameters.items(), 2)
        }
        assert not before.issuperset(combinations(job.parameters.items(), 2))


def test_a_fault_of_one_value_among_many_sets_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rehearsal, "ALL", 5)
    scenario(tmp_path, "scenario", init=place("Ego", 100, 10) + place("Lead", "${1/(20-$Gap)}", 10))
    (fine,) = rehearse_batch(
        jobs_of([distribution(tmp_path, "fine", {"Gap": (21, 40, 1)})], {}, True), QUICK
    )
    assert (fine.state, fine.message) == ("loaded", "20 parameter sets")
    (short,) = rehearse_batch(
        jobs_of([distribution(tmp_path, "short", {"Gap": (10, 20, 1)})], {}, True), QUICK
    )
    assert (short.state, short.exit_code) == ("error", 3)
    assert short.message.startswith("1 of 11 parameter sets: ")
    two = distribution(tmp_path, "two", {"Gap": (10, 13, 1), "Ego_Speed": (1, 4, 1)})
    (both,) = rehearse_batch(jobs_of([two], {}, True), QUICK)
    assert both.message == "16 parameter sets"


# laziness -----------------------------------------------------------------------------------


def test_a_large_space_is_not_enumerated(tmp_path: Path) -> None:
    scenario(tmp_path, stop=0.05)
    path = distribution(
        tmp_path, "large", {"Gap": (10, 120, 1), "Ego_Speed": (10, 43, 1), "Lead_Speed": (1, 33, 1)}
    )
    for processes in (1, 2):
        taken = 0

        def counted() -> Iterator[Job | Outcome]:
            nonlocal taken
            for job in jobs_of([path], {}, True):
                taken += 1
                yield job

        outcomes = run_batch(counted(), QUICK, processes=processes)
        assert names(list(islice(outcomes, 2))) == ["large~000000", "large~000001"]
        outcomes.close()
        assert taken < 30


# names --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stem", "expected"),
    [
        ("plain", "plain"),
        ("with space & more", "with_space___more"),
        ("..", "__"),
        (".hidden", "_hidden"),
        ("runs.jsonl", "runs_jsonl"),
        ("batch.json", "batch_json"),
        ("größe", "größe"),
        ("new\nline", "new_line"),
        ("tilde~000001", "tilde_000001"),
        ("x" * 240, "x" * 100),
    ],
)
def test_names_are_safe_as_folder_names(tmp_path: Path, stem: str, expected: str) -> None:
    path = scenario(tmp_path, stop=0.2).rename(tmp_path / f"{stem}.xosc")
    out = tmp_path / "out"
    (outcome,) = batch([path], out=out)
    assert outcome.state == "passed", outcome.message
    assert [p.name for p in out.iterdir() if p.is_dir()] == [outcome.job.name]
    assert outcome.job.name.startswith(expected)
    assert {p.name for p in tmp_path.iterdir()} == {path.name, "straight.xodr", "out"}


def test_names_are_unique(tmp_path: Path) -> None:
    paths = [
        tmp_path / name for name in ("a/x.xosc", "b/x.xosc", "c/X.xosc", "d/x~2.xosc", "a/x.xosc")
    ]
    for path in paths:
        scenario(path.parent, path.stem, stop=0.05)
    paths.append(distribution(tmp_path / "a", "x_", {"Gap": (10, 20, 10)}, of="x"))
    found = names(batch(paths))
    assert len({name.casefold() for name in found}) == len(found) == 7
    assert found[:5] == ["a-x", "b-x", "c-X", "x_2", "a-x~2"]


def test_names_that_collide_have_as_many_folders_as_tell_them_apart() -> None:
    paths = [
        Path(name) for name in ("/one/a/x.xosc", "/two/a/x.xosc", "/two/b/x.xosc", "/two/y.xosc")
    ]
    assert names_of(paths) == ["one-a-x", "two-a-x", "b-x", "y"]


# the output folder --------------------------------------------------------------------------


def test_an_earlier_batch_is_not_overwritten(tmp_path: Path, variation: Path) -> None:
    out = tmp_path / "out"
    batch([variation], out=out)
    with pytest.raises(UsageError, match="--resume"):
        batch([variation], out=out)


def test_a_folder_that_holds_something_else_is_not_removed(tmp_path: Path) -> None:
    path = scenario(tmp_path, stop=0.05)
    mine = tmp_path / "out" / "scenario" / "notes.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("keep")
    (outcome,) = batch([path], out=tmp_path / "out")
    assert outcome.exit_code == 2
    assert mine.read_text() == "keep"


def test_resuming_runs_nothing_twice(
    tmp_path: Path, variation: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    list(islice(run_batch(jobs_of([variation], {}, True), QUICK, out=out), 3))
    before = {p: p.stat().st_mtime_ns for p in out.rglob("trajectories.parquet")}
    assert len(before) == 3
    outcomes = batch([variation], out=out, resume=True)
    assert names(outcomes) == [f"variation~{n:06d}" for n in range(6)]
    assert all(path.stat().st_mtime_ns == when for path, when in before.items())
    monkeypatch.setattr("runner.judging.execution.run", None)
    assert batch([variation], out=out, resume=True) == outcomes


def test_a_line_cut_short_is_one_run_repeated(tmp_path: Path, variation: Path) -> None:
    out = tmp_path / "out"
    batch([variation], out=out)
    journal = out / "runs.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:3]) + lines[3][:40])
    (out / ".draft-left").mkdir()
    assert {o.state for o in batch([variation], out=out, resume=True)} == {"passed"}
    entries = [json.loads(line)["job"]["name"] for line in journal.read_text().splitlines()]
    assert sorted(entries) == [f"variation~{n:06d}" for n in range(6)]
    assert not list(out.glob(".draft*"))


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("batch.json", "{", "settings"),
        ("batch.json", "[]", "settings"),
    ],
)
def test_a_folder_that_is_no_batch_can_not_be_resumed(
    tmp_path: Path, name: str, content: str, complaint: str
) -> None:
    path, out = scenario(tmp_path, stop=0.05), tmp_path / "out"
    batch([path], out=out)
    (out / name).write_text(content)
    with pytest.raises(UsageError, match=complaint):
        batch([path], out=out, resume=True)


def test_resuming_with_other_settings_or_parameters_is_refused(
    tmp_path: Path, variation: Path
) -> None:
    out = tmp_path / "out"
    batch([variation], out=out)
    with pytest.raises(UsageError, match=r"other settings \(timestep, seed\)"):
        batch(
            [variation], RunSettings(0.1, "none", seed=1, world="kinematic"), out=out, resume=True
        )
    with pytest.raises(UsageError, match="other parameters"):
        list(run_batch(jobs_of([variation], {"Ego_Speed": "9"}, True), QUICK, out=out, resume=True))


# interruption -------------------------------------------------------------------------------


def _hear() -> None:
    """Whoever runs the tests may ignore signals, as nohup does."""
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_DFL)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "processes"),
    [
        (signal.SIGINT, 1),
        (signal.SIGINT, 2),
        (signal.SIGTERM, 1),
        (signal.SIGHUP, 2),
        (signal.SIGKILL, 1),
        (signal.SIGKILL, 2),
    ],
)
def test_an_interrupted_batch_goes_on_where_it_was(
    tmp_path: Path,
    processes: int,
    how: signal.Signals,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenario(tmp_path, stop=0.5)
    variation = distribution(tmp_path, "variation", {"Gap": (20, 310, 10)})
    (tmp_path / "slow.py").write_text(
        SLOW_SYSTEM.replace("0.02", "float(os.environ.get('SLOWNESS', '0'))")
    )
    out, journal = tmp_path / "out", tmp_path / "out" / "runs.jsonl"
    arguments = [str(variation), "--world", "kinematic", "--sut", "slow:Slow", "--out", str(out)]
    begun = [sys.executable, "-m", "runner.xosc_run", *arguments, "--jobs", str(processes)]
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    slow = os.environ | {"SLOWNESS": "0.02"}  # until it is interrupted
    first = subprocess.Popen(
        begun, cwd=tmp_path, env=slow, stdout=nothing, stderr=pipe, text=True, preexec_fn=_hear
    )
    deadline = time.monotonic() + 60
    while not (journal.exists() and journal.read_bytes().count(b"\n") >= 2):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    first.send_signal(how)
    _, errors = first.communicate(timeout=60)
    assert "Traceback" not in errors
    if how is not signal.SIGKILL:
        assert first.returncode == 128 + how
        assert (out / "runs.parquet").exists()
        assert not list(out.glob(".draft*"))
    wait_until_nobody_writes(journal)
    finished = journal.read_bytes().count(b"\n")
    assert finished < 30
    done = {
        p: p.stat().st_mtime_ns for p in out.glob("variation~*/trajectories.parquet")
    }  # of a killed process drafts may be left
    monkeypatch.chdir(tmp_path)
    assert "30 runs: 30 passed" in command("xosc-run", *arguments, "--resume").out
    entries = [json.loads(line)["job"]["name"] for line in journal.read_text().splitlines()]
    assert sorted(entries) == [f"variation~{n:06d}" for n in range(30)]
    kept = [path for path, when in done.items() if path.stat().st_mtime_ns == when]
    assert len(kept) >= finished
    assert not list(out.glob(".draft*"))


def wait_until_nobody_writes(journal: Path) -> None:
    """Workers of a killed batch notice it and end."""
    size = -1
    while size != journal.stat().st_size:
        size = journal.stat().st_size
        time.sleep(0.3)


def test_a_line_that_a_full_disk_cut_in_the_midst_is_runs_repeated(
    tmp_path: Path, variation: Path
) -> None:
    out = tmp_path / "out"
    batch([variation], out=out)
    journal = out / "runs.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(lines[0] + lines[1][:40] + b"".join(lines[2:]))
    assert {o.state for o in batch([variation], out=out, resume=True)} == {"passed"}
    names = [o.job.name for o in finished(out).outcomes.values()]
    assert sorted(names) == [f"variation~{n:06d}" for n in range(6)]


@pytest.mark.slow
def test_two_batches_do_not_write_into_one_folder(tmp_path: Path, variation: Path) -> None:
    first = run_batch(jobs_of([variation], {}, True), QUICK, out=tmp_path / "out")
    next(first)
    with pytest.raises(
        UsageError, match=r"out: a batch of another process writes into this folder"
    ):
        batch([variation], out=tmp_path / "out", resume=True)
    assert len(list(first)) == 5
    assert len(batch([variation], out=tmp_path / "out", resume=True)) == 6


@pytest.mark.parametrize("processes", [1, 2])
def test_a_full_disk_ends_the_batch_and_loses_nothing(
    tmp_path: Path, variation: Path, processes: int
) -> None:
    out, plain = tmp_path / "out", tmp_path / "plain"
    with pytest.raises(UsageError, match="out: results can't be written: No space left on device"):
        batch([variation], out=out, also=[no_space], processes=processes)
    assert (
        {"variation~000000", "variation~000001"}
        <= finished(out).outcomes.keys()
        <= {f"variation~{n:06d}" for n in (0, 1, 3, 4, 5)}
    )
    assert not list(out.glob(".draft*"))
    batch([variation], out=out, resume=True)
    batch([variation], out=plain)
    for path in plain.glob("*/*"):
        assert (out / path.relative_to(plain)).read_bytes() == path.read_bytes()


def no_space(result: RunResult) -> None:
    if result.name == "variation~000002":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_that_takes_no_files_is_one_line(tmp_path: Path, variation: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "runner.xosc_run",
        str(variation),
        "--world",
        "kinematic",
        "--sut",
        "none",
        "--out",
        "out",
    ]

    def no_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    full = subprocess.run(command, preexec_fn=no_room, capture_output=True, text=True, cwd=tmp_path)
    assert full.returncode == 2
    assert full.stderr.count("\n") == 1
    assert "xosc-run: out: results can't be written: File too large" in full.stderr


def test_a_folder_that_is_removed_meanwhile_ends_the_batch_with_one_line(
    tmp_path: Path, variation: Path
) -> None:
    out = tmp_path / "out"
    going = run_batch(jobs_of([variation], {}, True), QUICK, out=out)
    next(going)
    shutil.rmtree(out)
    with pytest.raises(UsageError, match="out: results can't be written: "):
        list(going)


def test_a_run_that_takes_too_much_memory_is_an_error_of_that_run(
    tmp_path: Path, variation: Path
) -> None:
    with in_force(CommandPolicy(max_memory=10.0)):
        outcomes = list(run_batch(jobs_of([variation], {}, True), QUICK, also=[greedy]))
    assert [(o.state, o.exit_code) for o in outcomes] == [
        ("passed", 0),
        ("error", 4),
        *[("passed", 0)] * 4,
    ]
    assert "memory" in outcomes[1].message


def greedy(result: RunResult) -> None:
    if result.name == "variation~000001":
        np.zeros(12 * 2**30, dtype=np.uint8)


@pytest.mark.slow
def test_no_worker_outlives_a_killed_batch(tmp_path: Path, variation: Path) -> None:
    (tmp_path / "slow.py").write_text(
        SLOW_SYSTEM.replace("time.sleep", "open(f'alive-{os.getpid()}', 'w'); time.sleep")
    )
    command = [
        sys.executable,
        "-m",
        "runner.xosc_run",
        str(variation),
        "--world",
        "kinematic",
        "--sut",
        "slow:Slow",
        "-j",
        "2",
    ]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 60
    while len(workers := [int(p.name.partition("-")[2]) for p in tmp_path.glob("alive-*")]) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    process.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in workers if Path(f"/proc/{pid}").exists()] or not os.path.isdir(
        "/proc"
    )


@pytest.mark.parametrize("culprit", [0, 1, 2, 5])
def test_a_run_that_kills_its_process_is_named_and_the_others_complete(
    tmp_path: Path, culprit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deadly.py").write_text(SLOW_SYSTEM)
    monkeypatch.syspath_prepend(str(tmp_path))
    behind = place("Ego", 100, 20) + place("Lead", "${70 + $Gap}", 20)
    scenario(tmp_path, stop=0.1, init=behind)
    first = 60 - 20 * culprit  # so that the lead is 30 m ahead in the culprit's place
    path = distribution(tmp_path, "variation", {"Gap": (first, first + 100, 20)})
    out = tmp_path / "out"
    settings = RunSettings(sut="deadly:Deadly", sut_in_process=True, world="kinematic")
    outcomes = batch([path], settings, processes=2, out=out)
    assert [o.state for o in outcomes] == ["error" if n == culprit else "passed" for n in range(6)]
    assert outcomes[culprit].exit_code == 5
    assert "died" in outcomes[culprit].message
    assert {json.loads(line)["job"]["name"] for line in (out / "runs.jsonl").open()} == {
        o.job.name for o in outcomes
    }


def test_contacts_are_measured_for_those_who_read_them_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    measured: list[str] = []
    of_recording = criticality.of_recording

    def counted(recording: Recording, ego: str | None) -> criticality.Criticality | None:
        measured.append(str(ego))
        return of_recording(recording, ego)

    monkeypatch.setattr(criticality, "of_recording", counted)
    path = Path("xosc/library/highway_lead_brake.xosc").absolute()
    (quiet,) = run_batch(jobs_of([path], {}, True), QUICK, contacts=False)
    assert (quiet.state, quiet.impact, measured) == ("failed", None, [])
    (told,) = run_batch(jobs_of([path], {}, True), QUICK)
    assert told.impact is not None and measured == ["Ego"]
    (kept,) = run_batch(jobs_of([path], {}, True), QUICK, contacts=False, out=tmp_path / "out")
    assert kept.impact == told.impact
