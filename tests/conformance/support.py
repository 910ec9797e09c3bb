"""Conformance scenarios: one file for each element of the standard, named after
it, in `scenarios/`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import runner

SCENARIOS = Path(__file__).parent / "scenarios"


def run(element: str, **options: Any) -> runner.RunResult:
    """Run the conformance scenario of an element, without a system under test,
    at 0.01 s unless told otherwise.
    """
    options = {"sut": None, "timestep": 0.01, "max_time": 60.0, **options}
    return runner.run(SCENARIOS / f"{element}.xosc", **options)


def changed(scenario: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    """A copy of a conformance scenario with texts replaced, in another folder."""
    text = scenario.read_text(encoding="utf-8").replace(
        "../roads", str(Path(__file__).parent / "roads")
    )
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "changed.xosc"
    path.write_text(text, encoding="utf-8")
    return path


def track(result: runner.RunResult, entity: str) -> dict[str, np.ndarray]:
    """Columns of one entity's trajectory."""
    table = result.trajectories
    mine = np.asarray(table["entity"].to_pylist()) == entity
    return {
        name: np.asarray(table[name].to_numpy(zero_copy_only=False))[mine]
        for name in table.column_names
        if name != "entity"
    }


def at(columns: dict[str, np.ndarray], time: float, name: str) -> float:
    """A numeric column of a track, interpolated at a time (s)."""
    return float(np.interp(time, columns["time"], columns[name].astype(float)))


def events(
    result: runner.RunResult, kind: str | None = None, subject: str | None = None
) -> list[Any]:
    """Log entries of a kind and subject (a name at the end of its path)."""
    return [
        e
        for e in result.events
        if (kind is None or e.kind == kind)
        and (subject is None or e.subject.split("::")[-1] == subject)
    ]
