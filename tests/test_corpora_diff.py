"""The comparison of two versions over foreign files: equal ones are silent, each
kind of change is named.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks.corpora_diff import Change, Played, Run, changes, scenarios
from tests.runner.files import scenario

ROOT = Path(__file__).parents[1]


def run(
    folder: Path,
    verdict: str = "passed",
    remarks: tuple[str, ...] = (),
    end: float = 0.2,
    x: float = 0.0,
) -> Run:
    """A run whose Ego drives 1 m a step from x (m) on."""
    folder.mkdir(parents=True)
    times = [0.0, 0.1, 0.2]
    columns: Mapping[str, list[object]] = {
        "time": [*times],
        "entity": ["Ego"] * 3,
        "x": [*(x + np.arange(3.0))],
        "y": [0.0] * 3,
        "z": [0.0] * 3,
    }
    pq.write_table(pa.table(dict(columns)), folder / "trajectories.parquet")
    return Run(folder, verdict, (), remarks, end)


def differences(old: Run, new: Run) -> list[tuple[str, str]]:
    found = changes("f", Played(0, "", {"{}": old}), Played(0, "", {"{}": new}), 0.001)
    return [(change.kind, change.text) for change in found]


def test_equal_runs_have_no_change(tmp_path: Path) -> None:
    assert differences(run(tmp_path / "a"), run(tmp_path / "b")) == []


def test_each_kind_of_change_is_named(tmp_path: Path) -> None:
    old = run(tmp_path / "a", remarks=("kept", "lost"))
    new = run(tmp_path / "b", "failed", ("kept", "found"), end=0.3, x=0.5)
    assert differences(old, new) == [
        ("verdict", "passed → failed:  → "),
        ("remark", "- lost"),
        ("remark", "+ found"),
        ("end", "0.20 s → 0.30 s"),
        ("place", "Ego: 0.500 m at 0.00 s"),
    ]


def test_exit_codes_and_errors_are_compared() -> None:
    old, new = Played(0, "", {}), Played(3, "a\nxosc-run: no such road", {})
    (change,) = changes("f", old, new, 0.001)
    assert change == Change("f", "", "exit", "0 → 3:  → xosc-run: no such road")
    (change,) = changes("f", new, Played(3, "xosc-run: no such file", {}), 0.001)
    assert change.text == "3: xosc-run: no such road → xosc-run: no such file"


def test_catalogues_and_copies_are_not_played(tmp_path: Path) -> None:
    first = scenario(tmp_path, "first")
    (tmp_path / "second.xosc").write_bytes(first.read_bytes())
    (tmp_path / "catalogue.xosc").write_text('<OpenSCENARIO><Catalog name="c"/></OpenSCENARIO>')
    (tmp_path / "torn.xosc").write_text("<OpenSCENARIO>")
    assert [path.name for path in scenarios([tmp_path])] == ["first.xosc", "torn.xosc"]


@pytest.mark.slow
def test_two_versions_play_a_folder(tmp_path: Path) -> None:
    """A version has no difference from itself."""
    scenario(tmp_path / "files", "plain", stop=10.0)
    call = [sys.executable, "-m", "benchmarks.corpora_diff", str(ROOT), str(ROOT)]
    answer = subprocess.run(
        [*call, str(tmp_path / "files"), "--json", str(tmp_path / "d.json")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert answer.returncode == 0, answer.stderr
    assert "1 files, 0 changed: 0 exit, 0 verdict, 0 remark, 0 place, 0 end" in answer.stdout
    assert '"verdict": "failed"' in (tmp_path / "d.json").read_text(encoding="utf-8")
