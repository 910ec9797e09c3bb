"""`python -m studies.generation`: one command with a subcommand for each experiment."""

from __future__ import annotations

import csv
import io
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import studies.generation.__main__ as study
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings
from recognition.labels.maneuvers.units import Samples
from schemas.common.errors import UsageError
from studies.generation.tables import Printed
from studies.publication.results import read_journal, read_table
from tests.recognition.motorway import write_motorway

CUT_IN = SCENARIOS / "cut_in_highway.xosc"


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """The exit code of the command."""
    monkeypatch.setattr("sys.argv", ["study", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        study.main()
    return int(ended.value.code or 0)


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of few recorded cut-ins."""
    own = of_recordings(None, "cut_in")
    chosen = np.unique(own.recordings, return_index=True)[1]
    path = tmp_path_factory.mktemp("units") / "units.parquet"
    own.where(np.concatenate([chosen, chosen + 1])).write(path)
    return path


def test_help_lists_every_experiment(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "--help") == 0
    text = capsys.readouterr().out
    assert all(
        name in text
        for name in (
            "methods",
            "planted",
            "coverage",
            "plays",
            "systems",
            "densities",
            "reconstruction",
            "rounds",
        )
    )


def test_methods_are_compared_and_their_cases_run_with_other_systems(
    tmp_path: Path, units: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    quick = (
        "--seeds",
        1,
        "--budget",
        12,
        "--recorded",
        units,
        "--timestep",
        0.1,
        "--jobs",
        1,
        "-q",
    )
    pinned = ("--pin", "Ego_Speed_mps=38")
    out = tmp_path / "results"
    assert (
        call(
            monkeypatch,
            "methods",
            CUT_IN,
            "--out",
            out,
            "--methods",
            "kde",
            "--no-figures",
            *quick,
            *pinned,
        )
        == 0
    )
    assert "| KDE sampling † |" in (out / "report.md").read_text()
    same = (
        "--recorded",
        units,
        "--scenarios",
        SCENARIOS,
        "--method",
        "kde",
        "--most",
        2,
        "--timestep",
        0.1,
        "--jobs",
        1,
    )
    assert (
        call(monkeypatch, "systems", out, *same, "--systems", "none", "--out", tmp_path / "systems")
        == 0
    )
    said = capsys.readouterr().out
    assert "| `none` | 2 |" in said
    assert (tmp_path / "systems" / "systems.md").read_text() in said
    assert set(pq.read_table(tmp_path / "systems" / "cases.parquet")["system"].to_pylist()) == {
        "none",
        "r157-cc",
    }


def test_densities_are_compared_on_recorded_parameters(
    units: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert (
        call(
            monkeypatch,
            "--results",
            tmp_path / "kept",
            "densities",
            CUT_IN,
            "--recorded",
            units,
            "--density",
            "gaussian",
            "--density",
            "kde",
            "--out",
            tmp_path / "densities",
        )
        == 0
    )
    rows = [
        line.split(" | ")[0]
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("| ") and "±" in line
    ]
    assert sorted(rows) == ["| KDE, full covariance", "| one Gaussian"]
    with (tmp_path / "densities" / "tables" / "density.csv").open(newline="") as file:
        assert sorted(row[0] for row in csv.reader(file)) == [
            "KDE, full covariance",
            "density",
            "one Gaussian",
        ]
    # The printed table and its command are kept.
    kept = tmp_path / "kept"
    assert (kept / "density.csv").read_bytes() == (
        tmp_path / "densities" / "tables" / "density.csv"
    ).read_bytes()
    (made,) = read_journal(kept).values()
    assert made.command.startswith(f"studies.generation densities {CUT_IN} --recorded {units}")
    assert float(made.processor) > 0.0 and len(made.commit) >= 8


def test_an_experiment_that_prints_no_table_keeps_nothing(tmp_path: Path) -> None:
    with redirect_stdout(printed := Printed(sys.stdout)):
        print("seed 0: |x| < 1")
    with pytest.raises(UsageError, match="prints no table"):
        printed.keep(tmp_path / "kept", ("plays",))
    assert not (tmp_path / "kept").exists()


def test_tables_with_the_same_first_heading_get_numbers(tmp_path: Path) -> None:
    printed = Printed(io.StringIO())
    printed.write("# x\n\n| a b | c |\n|---|---|\n| -1 | 2 |\n\n| a b |\n| --- |\n| 3 |\n")
    printed.keep(tmp_path, ("plays",))
    assert read_table(tmp_path / "a-b.csv") == [["a b", "c"], ["-1", "2"]]
    assert read_table(tmp_path / "a-b-2.csv") == [["a b"], ["3"]]


def test_units_of_recordings_are_reconstructed_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_motorway(tmp_path / "recordings")
    assert (
        call(
            monkeypatch,
            "reconstruction",
            tmp_path / "recordings",
            "--out",
            tmp_path / "units.parquet",
        )
        == 0
    )
    assert "| cut_in | 2 |" in capsys.readouterr().out
    assert np.isfinite(Samples.read(tmp_path / "units.parquet").theta).all()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ("methods", CUT_IN, "--out", "{out}", "--methods", "magic"),
            "methods: cover, draws, mcsg, mcsg-published",
        ),
        (("systems", "{out}"), "neither a comparison of methods nor edge cases"),
        (("densities", CUT_IN, "--density", "spline"), "densities: kde"),
        (("densities", "nothing.xosc"), "no such file"),
        (("rounds", "nothing.xosc"), "no such file"),
    ],
)
def test_wrong_use_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[object, ...],
    reason: str,
) -> None:
    assert call(monkeypatch, *(str(each).format(out=tmp_path) for each in arguments)) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert "Traceback" not in said


def test_plays_are_measured_against_sumo(
    units: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        call(
            monkeypatch,
            "plays",
            CUT_IN,
            "--draws",
            8,
            "--finds",
            0,
            "--recorded",
            units,
            "--jobs",
            1,
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "| draws of the prior, system under test | 8 of 8 |" in said
    assert "episodes a second" in said
