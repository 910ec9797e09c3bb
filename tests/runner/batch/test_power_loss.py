"""A batch whose machine, disk or process fails at any of its operations, and
what is left when it is resumed.

The operations of the operating system by which a batch writes are counted. Before each of them the
test takes pictures of what would be on the disk if the machine went down there: only what was
synced; names without contents that were not synced; and all that was written, as after a kill. In a
second test each operation fails with an error. Then the batch is resumed, and must leave the bytes
of one that was not disturbed.
"""

from __future__ import annotations

import os
from itertools import count
from pathlib import Path

import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.journal import finished
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from tests.disk import Disk, Failure, files, watched
from tests.runner.files import distribution, scenario

QUICK = RunSettings(sut="none", world="kinematic")


@pytest.fixture
def variation(tmp_path: Path) -> Path:
    scenario(tmp_path, stop=0.05)
    return distribution(tmp_path, "variation", {"Gap": (20, 30, 10)})


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """The simulated disk remembers what was synced: the real one is not needed."""
    monkeypatch.setattr(os, "fsync", lambda file: None)


def batch(variation: Path, out: Path) -> None:
    """Do the runs, each entered at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("runner.batch.journal._GROUP", 0.0)
        list(
            run_batch(
                jobs_of([variation], {}, True), QUICK, out=out, resume=True, tell=lambda line: None
            )
        )


@pytest.mark.slow
def test_a_power_cut_at_any_operation_loses_no_run_that_is_entered(
    tmp_path: Path, variation: Path
) -> None:
    batch(variation, tmp_path / "plain")
    expected = files(tmp_path / "plain")
    out = tmp_path / "out"
    out.mkdir()
    disk, pictures = Disk(out), []

    def before(name: str) -> None:
        pictures.append((name, disk.pictures(tmp_path / f"{len(pictures)}")))

    with watched(out, before, disk.after):
        batch(variation, out)
    assert files(out) == expected
    assert {name for name, _ in pictures} >= {
        "fsync",
        "write",
        "rename",
        "replace",
        "mkdir",
        "open",
        "table",
    }
    entered, seen = set(), []
    for name, kinds in pictures:
        for kind, left in kinds.items():
            if (left / "runs.jsonl").exists():
                entered.add((kind, len(finished(left).outcomes)))
            if (picture := files(left)) in seen:
                continue
            seen.append(picture)
            batch(variation, left)
            assert files(left) == expected, f"{kind} before {name}"
    assert len(seen) > 20
    assert {("synced", 0), ("synced", 1), ("synced", 2)} <= entered, (
        "entries survive as soon as they are synced"
    )


@pytest.mark.slow
def test_an_error_of_any_operation_is_one_line_and_loses_nothing(
    tmp_path: Path, variation: Path
) -> None:
    batch(variation, tmp_path / "plain")
    expected = files(tmp_path / "plain")
    failed: set[str] = set()
    for place in count():
        out, failure = tmp_path / f"out{place}", Failure(place)
        out.mkdir()
        with watched(out, failure):
            try:
                batch(variation, out)
            except UsageError as error:
                assert failure.error is not None and str(failure.error.strerror) in str(error), (
                    failure.name
                )
        if failure.error is None:
            break
        failed.add(failure.name)
        batch(variation, out)
        assert files(out) == expected, failure.name
    assert failed >= {"fsync", "write", "rename", "replace", "mkdir", "open", "table"}
