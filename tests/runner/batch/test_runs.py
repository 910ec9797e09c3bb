"""The table of a batch's runs: what is in it, who reads it, and that it does not
depend on how the runs were done.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import duckdb
import pyarrow.parquet as pq
import pytest

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.judging.measures.measure import measures
from runner.judging.settings import RunSettings
from tests.runner.files import distribution, scenario

FAST = RunSettings(sut="none", world="kinematic")


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Six runs, the slower lead is run into in the first of them; and a file that can't be read."""
    scenario(tmp_path, stop=1.5)
    broken = tmp_path / "broken.xosc"
    broken.write_text("<OpenSCENARIO>")
    return [
        distribution(tmp_path, "variation", {"Gap": (20, 120, 20), "Lead_Speed": (5, 5, 1)}),
        broken,
    ]


def run(files: list[Path], out: Path, processes: int = 1) -> Path:
    list(run_batch(jobs_of(files, {}, True), FAST, out=out, processes=processes))
    return out / "runs.parquet"


def test_a_row_says_what_ran_how_it_ended_and_how_critical_it_was(
    files: list[Path], tmp_path: Path
) -> None:
    rows = pq.read_table(run(files, tmp_path / "out")).to_pylist()
    assert [row["name"] for row in rows] == ["broken", *(f"variation~{n:06d}" for n in range(6))]
    broken, collided, *passed = rows
    assert (broken["state"], broken["verdict"], broken["exit_code"], broken["end_time"]) == (
        "error",
        None,
        3,
        None,
    )
    assert "broken.xosc" in broken["message"]
    assert (collided["state"], collided["verdict"], collided["status"]) == (
        "failed",
        "failed",
        "completed",
    )
    assert dict(collided["parameters"]) == {"Gap": "20", "Lead_Speed": "5"}
    assert {row["verdict"] for row in passed} == {"passed"}
    result = runner.run(
        tmp_path / "scenario.xosc",
        parameters=dict(passed[2]["parameters"]),
        sut="none",
        world="kinematic",
    )
    assert result.criticality is not None
    summary = result.criticality.summary
    assert summary.keys() == measures().keys()
    shares = [name for name, each in measures().items() if not each.is_extreme]
    assert {name: passed[2][name] for name in shares} == {name: summary[name] for name in shares}
    for name in measures().keys() - shares:
        found = {
            key: passed[2][f"{name}{end}"]
            for key, end in (("value", ""), ("time", "_time"), ("other", "_other"))
        }
        assert found == (summary[name] or dict.fromkeys(found))


def test_the_table_does_not_depend_on_the_number_of_processes(
    files: list[Path], tmp_path: Path
) -> None:
    assert (
        run(files, tmp_path / "one").read_bytes()
        == run(files, tmp_path / "two", processes=2).read_bytes()
    )


def test_the_table_is_written_with_few_runs_in_memory(
    files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runner.batch.outputs.tables._ROWS", 2)
    written = pq.ParquetFile(run(files, tmp_path / "out"))
    groups = [written.metadata.row_group(i).num_rows for i in range(written.num_row_groups)]
    assert groups[:-1] == [2] * (len(groups) - 1) and len(groups) > 1
    assert sum(groups) == written.metadata.num_rows


def test_an_interrupted_batch_has_the_table_of_what_is_done(
    files: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    running = run_batch(jobs_of(files, {}, True), FAST, out=out)
    list(islice(running, 2))
    running.close()
    assert pq.read_table(out / "runs.parquet").num_rows == 2
    list(run_batch(jobs_of(files, {}, True), FAST, out=out, resume=True))
    assert (out / "runs.parquet").read_bytes() == run(files, tmp_path / "whole").read_bytes()


def test_duckdb_reads_it(files: list[Path], tmp_path: Path) -> None:
    path = run(files, tmp_path / "out")
    found = duckdb.sql(
        "SELECT verdict, count(*), min(min_ttc), max(CAST(parameters['Gap'] AS DOUBLE)) "
        f"FROM '{path}' GROUP BY verdict ORDER BY verdict"
    ).fetchall()
    assert [row[:2] for row in found] == [("failed", 1), ("passed", 5), (None, 1)]
    assert found[0][2] == 0.0 < found[1][2]
    assert (found[0][3], found[1][3]) == (20.0, 120.0)
