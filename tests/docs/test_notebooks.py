"""The notebooks run from top to bottom, are small, and hold no outputs."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

import runner

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))


def cells(path: Path) -> list[dict[str, Any]]:
    return [
        cell
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code"
    ]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    program = tmp_path / "program.py"
    program.write_text("\n".join("".join(cell["source"]) for cell in cells(path)), encoding="utf-8")
    assert "pandas" not in program.read_text(encoding="utf-8"), "no extra brings it"
    found = runpy.run_path(str(program))
    results = [value for value in found.values() if isinstance(value, runner.RunResult)]
    assert results and all(len(result.recording.tracks) == 2 for result in results)


def test_there_are_two_small_ones_without_outputs() -> None:
    assert len(NOTEBOOKS) == 2
    assert all(path.stat().st_size < 10_000 for path in NOTEBOOKS)
    assert all(
        cell["outputs"] == [] and cell["execution_count"] is None
        for path in NOTEBOOKS
        for cell in cells(path)
    )
