"""Processes of a batch that ends early: jobs in work have a few seconds, and
nothing prints a traceback.
"""

from __future__ import annotations

import errno
import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from runner.batch.batch import lost
from runner.batch.jobs import Job, Outcome
from runner.batch.pool import Pool, dismiss, executor
from schemas.common.errors import describe
from schemas.common.policy import Ended, end_by, limited
from tests.commands import Command
from tests.runner.files import scenario


def sleep(job: Job) -> Outcome:
    time.sleep(float(job.parameters["seconds"]))
    return Outcome(job, "passed", 0)


def jobs(*seconds: float) -> Iterator[Job]:
    for number, each in enumerate(seconds):
        path = Path(f"{number}.xosc")
        yield Job(path.stem, path, path, {"seconds": str(each)})


def test_processes_that_an_interrupt_ends_leave_no_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    faults: list[object] = []
    monkeypatch.setattr(threading, "excepthook", faults.append)
    for _ in range(8):
        with Pool(2, sleep, lost) as pool:
            outcomes = pool.execute(jobs(0.0, *[0.05] * 30))
            next(outcomes)
            for process in (pool._pool._processes or {}).values():
                os.kill(process.pid or 0, signal.SIGINT)  # as a terminal does
            outcomes.close()  # type: ignore[attr-defined]
    assert faults == []


def test_jobs_in_work_have_a_short_time_and_those_that_end_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("runner.batch.pool._ENDING", 0.5)
    done: list[str] = []
    with Pool(2, sleep, lost, lambda outcome: done.append(outcome.job.name)) as pool:
        outcomes = pool.execute(jobs(0.0, 0.2, 60.0, 60.0, 60.0))
        next(outcomes)
        begin = time.monotonic()
        outcomes.close()  # type: ignore[attr-defined]
        assert time.monotonic() - begin < 10.0
        assert done == ["0", "1"]
        assert next(pool.execute(jobs(0.0))).state == "passed", "the pool goes on"


def test_an_error_that_a_library_makes_of_an_interrupt_is_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: Command
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        end_by(signal.SIGTERM)
        raise SystemError("returned a result with an exception set")

    monkeypatch.setattr("runner.judging.execution.run", interrupted)
    try:
        answer = command("xosc-run", scenario(tmp_path), "--out", tmp_path / "out")
    finally:
        end_by(0)
    assert answer.code == 143 and "interrupted" in answer.err
    assert "SystemError" not in answer.err + answer.out
    assert (tmp_path / "out" / "runs.jsonl").read_text() == ""


def test_a_shortage_of_memory_is_told_as_such() -> None:
    found = [
        ImportError("libssl.so.3: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        MemoryError(),
    ]
    assert {describe(error) for error in found} == {
        ("this takes more memory than there is, or than the process may have", 4)
    }


def test_a_shortage_of_memory_has_no_traceback(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, command: Command
) -> None:
    def short(*_: object, **__: object) -> None:
        raise ImportError("libssl.so.3: failed to map segment from shared object")

    monkeypatch.setattr("runner.batch.jobs.jobs_of", short)
    answer = command("xosc-run", scenario(tmp_path))
    assert (answer.code, len(answer.err.splitlines())) == (4, 1)


def test_a_signal_that_a_library_has_kept_ends_the_command_at_the_next_file() -> None:
    try:
        end_by(signal.SIGTERM)
        with pytest.raises(Ended) as ending, limited():
            pass
        assert ending.value.number == signal.SIGTERM
    finally:
        end_by(0)
    with limited():
        pass


def ignore_the_end(job: Job) -> Outcome:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    return sleep(job)


def test_a_process_that_ignores_its_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runner.batch.pool._ENDING", 0.3)
    with Pool(1, ignore_the_end, lost) as pool:
        outcomes = pool.execute(jobs(0.0, 60.0))
        next(outcomes)
        begin = time.monotonic()
        outcomes.close()  # type: ignore[attr-defined]
        assert time.monotonic() - begin < 10.0


def start_method() -> str:
    return multiprocessing.get_start_method()


def test_a_process_started_anew_starts_its_own_as_this_one_does() -> None:
    pool = executor(1, anew=True)  # by "spawn", which leaves semaphores where a process is killed
    assert pool.submit(start_method).result() == multiprocessing.get_start_method()
    dismiss(pool)


class Connection:
    """Something that a collector finds, and that says in which process it was ended."""

    def __init__(self, ends: Path) -> None:
        self.itself, self.ends = self, ends

    def __del__(self) -> None:
        (self.ends / str(os.getpid())).touch()


@pytest.mark.skipif(sys.platform != "linux", reason="processes are no forks")
def test_a_process_leaves_what_it_inherits_to_its_parents_collector(tmp_path: Path) -> None:
    # Collected in a fork, Ray's connection waits for ever for a thread that the fork has not.
    gc.disable()
    try:
        Connection(tmp_path)
        with executor(1) as pool:
            assert pool.submit(gc.collect).result() >= 0
            assert not [*tmp_path.iterdir()]
    finally:
        gc.enable()
    gc.collect()
    assert [ended.name for ended in tmp_path.iterdir()] == [str(os.getpid())]
