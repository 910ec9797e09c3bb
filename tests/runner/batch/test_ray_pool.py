"""Batches on a Ray cluster: the same results as in processes of one's own, also
when workers are killed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from runner.batch.batch import run_batch
from runner.batch.jobs import Outcome, jobs_of
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from tests.runner.files import SLOW_SYSTEM, distribution, scenario

ray = pytest.importorskip("ray", reason="Ray is not installed (extra: ray)")

pytestmark = pytest.mark.slow  # a cluster of its own

SYSTEMS = SLOW_SYSTEM.replace("pass", "open('attempts.txt', 'a').write(f'{os.getpid()}\\n')")


@pytest.fixture(scope="module", autouse=True)
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A small cluster on this machine that all tests of this file share."""
    folder = tmp_path_factory.mktemp("systems")
    (folder / "ray_systems.py").write_text(SYSTEMS)
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    path = os.pathsep.join([str(folder), str(Path(__file__).parents[3])])
    ray.init(
        num_cpus=2,
        object_store_memory=80_000_000,
        include_dashboard=False,
        log_to_driver=False,
        runtime_env={"env_vars": {"PYTHONPATH": path}},
    )
    sys.path.append(str(folder))
    yield
    sys.path.remove(str(folder))
    ray.shutdown()


@pytest.fixture
def variation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six runs of half a simulated second; the working directory is theirs."""
    scenario(tmp_path, stop=0.5)
    monkeypatch.chdir(tmp_path)
    return distribution(tmp_path, "variation", {"Gap": (20, 70, 10)})


def batch(path: Path, sut: str = "none", **settings: object) -> list[Outcome]:
    options = RunSettings(sut=sut, sut_in_process=True, world="kinematic")
    return list(run_batch(jobs_of([path], {}, True), options, **settings))  # type: ignore[arg-type]


def test_results_are_those_of_local_processes(variation: Path) -> None:
    relative = Path(variation.name)
    on_ray, local = (
        batch(relative, "cas", out=Path(name), **how)
        for name, how in (("r", {"ray": "auto"}), ("l", {"processes": 2}))
    )
    assert on_ray == local
    for name in ("trajectories.parquet", "events.jsonl", "result.json"):
        for outcome in local:
            assert (
                Path("r", outcome.job.name, name).read_bytes()
                == Path("l", outcome.job.name, name).read_bytes()
            )
    assert pq.read_table("r/runs.parquet").equals(pq.read_table("l/runs.parquet"))
    assert pq.read_table("r/runs.parquet").num_rows == 6


def test_a_killed_worker_is_replaced_and_its_run_repeated(variation: Path) -> None:
    outcomes: list[Outcome] = []
    running = run_batch(
        jobs_of([variation], {}, True),
        RunSettings(sut="ray_systems:Slow", sut_in_process=True, world="kinematic"),
        out=Path("out"),
        ray="auto",
    )
    outcomes.append(next(running))
    attempts = Path("attempts.txt")
    while len(begun := attempts.read_text().split()) < 3:
        time.sleep(0.01)
    os.kill(int(begun[-1]), signal.SIGKILL)
    outcomes.extend(running)
    assert [o.state for o in outcomes] == ["passed"] * 6
    assert len(attempts.read_text().split()) >= 7
    assert len(Path("out/runs.jsonl").read_text().splitlines()) == 6
    assert not list(Path("out").glob(".draft*"))
    assert batch(variation, "ray_systems:Slow", out=Path("again"), processes=2) == outcomes


def test_a_run_that_kills_every_worker_is_named_and_the_others_complete(variation: Path) -> None:
    outcomes = batch(variation, "ray_systems:Deadly", out=Path("out"), ray="auto")
    assert [o.state for o in outcomes] == ["passed", "error", *["passed"] * 4]
    assert "died" in outcomes[1].message
    assert len(Path("out/runs.jsonl").read_text().splitlines()) == 6


def test_an_interrupted_batch_goes_on_where_it_was(variation: Path) -> None:
    options = RunSettings(sut="ray_systems:Slow", sut_in_process=True, world="kinematic")
    running = run_batch(jobs_of([variation], {}, True), options, out=Path("out"), ray="auto")
    first = list(islice(running, 2))
    running.close()
    assert not list(Path("out").glob(".draft*"))
    finished = len(Path("out/runs.jsonl").read_text().splitlines())
    assert 2 <= finished < 6
    assert pq.read_table("out/runs.parquet").num_rows == finished
    resumed = batch(variation, "ray_systems:Slow", out=Path("out"), ray="auto", resume=True)
    assert resumed[:2] == first
    assert [o.state for o in resumed] == ["passed"] * 6
    assert pq.read_table("out/runs.parquet").num_rows == 6


def test_what_can_not_be_written_is_said_and_not_entered(variation: Path) -> None:
    out = Path("out")
    list(
        islice(
            run_batch(
                jobs_of([variation], {}, True),
                RunSettings(sut="none", sut_in_process=True, world="kinematic"),
                out=out,
            ),
            1,
        )
    )
    (out / "variation~000002").write_text("in the way")
    outcomes = batch(variation, out=out, ray="auto", resume=True)
    assert [o.state for o in outcomes] == [
        "passed",
        "passed",
        "error",
        "passed",
        "passed",
        "passed",
    ]
    assert pq.read_table("out/runs.parquet")["state"].to_pylist().count("error") == 1


COMMAND = [sys.executable, "-m", "runner.xosc_run", "--world", "kinematic", "--sut", "none"]


def test_the_command_starts_a_cluster_of_its_own(variation: Path) -> None:
    done = subprocess.run(
        [*COMMAND, str(variation), "--ray", "local", "--jobs", "2"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "6 runs: 6 passed" in done.stdout


def test_an_address_without_a_cluster_is_named(variation: Path) -> None:
    done = subprocess.run(
        [*COMMAND, str(variation), "--ray", "127.0.0.1:1"],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 2
    assert "there is no Ray cluster at '127.0.0.1:1'" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_ray_there_is_a_clear_message(
    variation: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r'pip install "xosc-toolchain\[ray\]"'):
        batch(variation, ray="local")
