"""Searching one class or scenario in one round, and what is kept of it for later rounds and the page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import xosc
from generation.loop.settings import LoopSettings
from generation.loop.stages.findings import CarefulDriver, CaseVerdict, EdgeCase, Range, Searched
from generation.loop.tasks.failures import failures
from generation.loop.tasks.targets import Target
from generation.pipeline import Generated, SearchSettings, generate
from schemas.errors import ToolchainError
from xodr.array_types import FloatArray

_DIGITS = 6
"""Decimal places that say anything"""
_SHOWN = 300
"""Points of each kind in a plot, at most"""


def search(
    target: Target, number: int, out: Path, settings: LoopSettings, known: FloatArray | None, progress: Callable[[int], None]
) -> Searched:
    """Search for edge cases and write them into a folder of the output folder.

    Args:
        target: what to search.
        number: of the round, from 1.
        out: output folder of the loop.
        settings: of the loop.
        known: failures (m, d) of earlier rounds, which this one starts from; None for none.
        progress: called with the number of runs that are done.

    Returns:
        What was found, files relative to `out`; with `error` where nothing was searched.
    """
    folder = out / f"round_{number}" / target.name
    of = Searched(round=number, target=target.name, title=target.title, scenario=target.scenario.stem, prior=target.prior)
    try:
        made = generate(target.scenario, target.recorded, folder, settings_of(target, settings.search(number)), progress, known)
    except ToolchainError as error:
        return replace(of, error=str(error), failures={of.title: f"not searched: {error}"})
    found = failures(made.space, made.history, known)
    real = target.recorded(made.space).within(made.space).theta
    outcomes = made.history.outcomes
    errors = Counter(outcomes.error[~outcomes.executed].tolist())
    mostly = max(sorted(errors), key=errors.__getitem__, default="")
    return replace(
        of,
        failures={} if outcomes.executed.any() else {of.title: f"no run succeeded, mostly: {mostly}"},
        parameters=[Range(each.name, each.low, each.high) for each in made.space.parameters],
        pinned=dict(made.space.pinned),
        calls=len(outcomes),
        failed_runs=int((~outcomes.executed).sum()),
        run_error=mostly,
        collisions=int(outcomes.collision.sum()),
        distinct=found.collisions,
        new=found.new,
        cases=list(_cases(made, out)),
        failed=failures(made.space, made.episodes, known).theta.tolist(),  # cases may be draws of the density as well
        real=_thinned(real).tolist(),
        tried=_thinned(made.history.theta).tolist(),
    )


def settings_of(target: Target, settings: SearchSettings) -> SearchSettings:
    """Settings of a search, with what was asked for of a target."""
    asked = target.asked
    if asked is None:
        return settings
    return replace(settings, pinned=asked.pinned, free=asked.free, marginals=asked.marginals, default=asked.default)


def found_by(rounds: Iterable[Searched]) -> FloatArray | None:
    """The failures of earlier rounds of one target, one a row; None where there are none."""
    rows = [row for each in rounds for row in each.failed]
    return np.array(rows) if rows else None


def _cases(made: Generated, out: Path) -> Iterator[EdgeCase]:
    """The edge cases: parameters, evidence, files."""
    cases = made.cases
    scenarios = made.files[2:]  # after the variation file and that of the density
    for row, (file, theta) in enumerate(zip(scenarios, cases.theta.tolist(), strict=True)):
        careful = CarefulDriver.COLLIDES if cases.careful.collision[row] else CarefulDriver.UNKNOWN
        yield EdgeCase(
            file=file.relative_to(out).as_posix(),
            road=road_of(file, out),
            theta=dict(zip(made.space.names, theta, strict=True)),
            verdict=CaseVerdict.COLLISION if cases.outcomes.collision[row] else CaseVerdict.VIOLATION,
            careful=CarefulDriver.AVOIDS if cases.careful.survived[row] else careful,
            likelihood=round(float(cases.log_likelihood[row]), _DIGITS),
            risk=round(float(cases.outcomes.r_risk[row]), _DIGITS),
        )


def road_of(scenario: Path, out: Path) -> str | None:
    """The road file of a scenario, relative to the output folder; None where it has none there."""
    logic = xosc.load(scenario).node.need("RoadNetwork").find("LogicFile")
    if logic is None:
        return None
    path = (scenario.parent / logic.get("filepath")).resolve()
    return path.relative_to(out.resolve()).as_posix() if path.is_relative_to(out.resolve()) else None


def _thinned(theta: FloatArray) -> FloatArray:
    """Evenly chosen rows, no more than can be seen, rounded to what can be seen."""
    rows = np.linspace(0, len(theta) - 1, min(len(theta), _SHOWN)).astype(int)
    return theta[rows].round(4)
