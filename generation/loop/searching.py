"""Searching one class or scenario in one round, and what is kept of it for later rounds and the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import xosc
from generation.loop.failures import failures
from generation.loop.settings import Settings
from generation.loop.stages import Found
from generation.loop.targets import Target
from generation.pipeline import Generated, generate
from recognition.trfe.samples import Floats
from schemas.errors import ToolchainError

_SHOWN = 300
"""Points of each kind in a plot, at most"""


def search(
    target: Target, number: int, out: Path, settings: Settings, known: Floats | None, progress: Callable[[int], None]
) -> Found:
    """Search for edge cases and write them into a folder of the output folder.

    Args:
        target: what to search.
        number: of the round, from 1.
        out: output folder of the loop.
        settings: of the loop.
        known: failures (m, d) of earlier rounds, which this one starts from; None for none.
        progress: told the runs that are done.

    Returns:
        Numbers, cases with their files (relative to `out`), failures and points to plot; or `error`, why nothing was searched.
    """
    folder = out / f"round_{number}" / target.name
    told: Found = {"target": target.name, "title": target.title, "prior": target.prior, "scenario": target.scenario.stem}
    try:
        made = generate(target.scenario, target.recorded, folder, settings.search(number), progress, known)
    except ToolchainError as error:
        return told | {"error": str(error)}
    found = failures(made.space, made.history, known)
    real = target.recorded(made.space).within(made.space).theta
    outcomes = made.history.outcomes
    return told | {
        "parameters": [{"name": each.name, "low": each.low, "high": each.high} for each in made.space.parameters],
        "pinned": dict(made.space.pinned),
        "calls": len(outcomes),
        "failed_runs": int((~outcomes.executed).sum()),
        "collisions": int(outcomes.collision.sum()),
        "distinct": found.collisions,
        "new": found.new,
        "cases": _cases(made, out),
        "failed": found.theta.tolist(),
        "real": _thinned(real).tolist(),
        "tried": _thinned(made.history.theta).tolist(),
    }


def found_by(rounds: list[Found]) -> Floats | None:
    """The failures of earlier rounds of one target, one a row; None where there are none."""
    rows = [row for each in rounds for row in each.get("failed", [])]
    return np.array(rows) if rows else None


def _cases(made: Generated, out: Path) -> list[dict[str, Any]]:
    """The edge cases: parameters, evidence, files."""
    cases, told = made.cases, made.cases.tags()
    scenarios = made.files[2:]  # after the variation file and that of the density
    return [
        {
            "file": file.relative_to(out).as_posix(),
            "road": road_of(file, out),
            "theta": dict(zip(made.space.names, theta, strict=True)),
            **{name: values[number] for name, values in told.items()},
        }
        for number, (file, theta) in enumerate(zip(scenarios, cases.theta.tolist(), strict=True))
    ]


def road_of(scenario: Path, out: Path) -> str | None:
    """The road file of a scenario, relative to the output folder; None where it has none there."""
    logic = xosc.load(scenario).node.need("RoadNetwork").find("LogicFile")
    if logic is None:
        return None
    path = (scenario.parent / logic.get("filepath")).resolve()
    return path.relative_to(out.resolve()).as_posix() if path.is_relative_to(out.resolve()) else None


def _thinned(theta: Floats) -> Floats:
    """Evenly chosen rows, no more than can be seen, rounded to what can be seen."""
    rows = np.linspace(0, len(theta) - 1, min(len(theta), _SHOWN)).astype(int)
    return theta[rows].round(4)
