"""Points of a scenario played at once in arrays: `generation.search.outcomes.Evaluator` without a
simulator."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from generation.search.outcomes import NOTHING, RISK_WINDOW, Outcomes, episode, joined
from generation.space.space import Space
from runner.batch.arrays import (
    BLOCK,
    RUN_BY_RUN_BLOCK,
    decides_together,
    obstacle,
    play,
    structures,
)
from runner.batch.jobs import Job
from runner.batch.pool import Workers, results
from runner.engine.motion.rss import parameter_set
from runner.judging.evidence.array_judge import OPEN, ArrayOutcomes
from runner.judging.measures.runs import Measuring
from runner.judging.result import FAILED, INCONCLUSIVE
from runner.judging.settings import RunSettings
from runner.systems import is_foreign, system_name
from runner.systems.base import SystemUnderTestError
from schemas.common.array_types import FloatArray
from schemas.common.errors import Unsupported

_TRIED = 16
"""Points that are played to see whether a scenario plays in arrays"""
_APART = 0.05
"""Least distances that are this far apart are of two ways to drive, m: rounding makes far less"""
FEW = 8
"""Points that the interpreter plays in less time than arrays, which take nearly
as long for one as for hundreds
"""
_UNTESTED = "it did not test what the file describes"


class ArrayPlays:
    """Plays a scenario at points of its parameter space in arrays, kinematically, with any system
    that they can ask.

    Points that arrays leave open are played by the interpreter, one by one.

    Args:
        scenario: the file.
        space: the parameters that are searched, and the values of the others.
        run: settings of the runs.
        rss: the RSS parameter set of risk.
        few: points up to which a call is played by the interpreter; numbers are the
            same up to rounding.
        fast: whether a scenario of which much is done run by run is refused: it is no faster.
        processes: how many play at a time; the outcomes are the same for any number.

    Attributes:
        together: whether its system decides in all runs by one call; otherwise a play takes as much
            of it as a run.

    Raises:
        Unsupported: the scenario, its system under test or a setting plays in single runs only, or
            much of it is done run by run, and `fast` is asked for.
        ToolchainError: the system fails, or decides otherwise in arrays than one by one; or the
            scenario can't be compiled.
    """

    def __init__(
        self,
        scenario: Path,
        space: Space,
        run: RunSettings | None = None,
        rss: str = "ad-rss",
        fast: bool = True,
        processes: int = 1,
        few: int = FEW,
    ) -> None:
        run = run or RunSettings()
        self._scenario, self._space, self._rss = scenario, space, rss
        self._processes, self._few = processes, few
        # Measures are those of the whole encounter, as in `outcomes._episode`.
        whole = False if run.end_after_collision is None else run.end_after_collision
        self._run = replace(run, world="kinematic", end_after_collision=whole)
        # Uniform, not of the density: whether arrays suffice has to hold in the whole box.
        drawn = space.draw(_TRIED, np.random.default_rng(0))
        reason = obstacle(scenario, self._run, self._sets(drawn), fast=fast)
        if reason:
            raise Unsupported(reason, path=scenario)
        self.together = decides_together(self._run)
        sut = self._run.sut
        # Tests compare shipped systems; nothing else compares a user's own.
        if self.together and (not isinstance(sut, str) or is_foreign(sut)):
            self._refuse_otherwise(drawn)

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d), in their order.

        Args:
            sut: name of the system under test, where another one than that of the settings is to
                drive.

        Raises:
            Unsupported: it can't be asked for many points at once.
        """
        settings = self._run if sut is None else replace(self._run, sut=sut)
        sets = self._sets(theta)
        if len(sets) <= self._few:
            if sut is not None:
                decides_together(settings)  # refuses what many points would
            return _singly(self._scenario, settings, self._rss, sets)
        # Parts are the same for any number of processes: a part has its own structures.
        size = BLOCK if sut is not None or self.together else RUN_BY_RUN_BLOCK
        parts = [sets[first : first + size] for first in range(0, len(sets), size)]
        work = partial(_played, self._scenario, settings, self._rss)
        alone = len(parts) < 2 or not isinstance(settings.sut, str | None)
        with results(work, parts, Workers(1 if alone else self._processes)) as found:
            return joined([Outcomes.of(0), *found])

    def _refuse_otherwise(self, theta: FloatArray) -> None:
        """Refuse a system whose `control_batch` decides otherwise than its `control`: the search
        would look where a system fails that drives in no run."""
        settings, sets = self._run, self._sets(theta)
        played = _played(self._scenario, settings, self._rss, sets)
        single = _singly(self._scenario, settings, self._rss, sets)
        # Least distances, too: a system may fail in none of so few sets.
        apart = (played.collision != single.collision) | ~np.isclose(
            played.clearance, single.clearance, rtol=0.0, atol=_APART
        )
        # An error says nothing of the system; a play without a verdict beside a run with one does.
        tested = played.executed & single.executed
        told = (played.status != "error") & (single.status != "error")
        lost = told & (played.executed != single.executed)
        wrong = np.flatnonzero(np.where(tested, apart, lost))
        if wrong.size:
            first = wrong[0]
            values = ", ".join(f"{name}={value}" for name, value in sets[first].items())
            raise SystemUnderTestError(
                f"the system under test {system_name(settings.sut)} decides otherwise in "
                f"control_batch than in control: {wrong.size} of {len(theta)} parameter sets go "
                f"otherwise in arrays than one by one ({_course(played, first)}, not "
                f"{_course(single, first)}, with {values}); --plays 0 asks control alone",
                path=self._scenario,
            )

    def _sets(self, theta: FloatArray) -> list[dict[str, str]]:
        pinned = {name: str(value) for name, value in self._space.pinned.items()}
        return [{**pinned, **values} for values in self._space.sets(theta)]


def _played(
    scenario: Path, settings: RunSettings, rss: str, sets: list[dict[str, str]]
) -> Outcomes:
    """Outcomes of parameter sets of a scenario, in their order."""
    # An end shortly before a contact counts as an episode: its measures say how near it came.
    asked = replace(settings, least=("reserve=0", *settings.least))
    columns = {name: np.array([value] * len(sets)) for name, value in NOTHING.items()}
    columns |= {name: columns[name].astype(object) for name in ("status", "error", "side")}
    known = np.zeros(len(sets), bool)
    measuring = Measuring(parameter_set(rss), RISK_WINDOW)
    # Sets that differ in more than numbers are compiled apart.
    for structure in structures(scenario, sets, asked):
        for block in play(structure, asked, measuring):
            done = block.outcomes.outcome != OPEN
            rows = block.members[done]
            known[rows] = True
            for name, values in _columns(block.outcomes).items():
                columns[name][rows] = values[done]
    # Left open by the arrays: a remark that makes a run inconclusive, or an error, which the
    # interpreter tells with file and line.
    open_ = np.flatnonzero(~known)
    single = _singly(scenario, settings, rss, [sets[row] for row in open_])
    for name, column in columns.items():
        column[open_] = getattr(single, name)
    return Outcomes.of(len(sets), **{name: column.tolist() for name, column in columns.items()})


def _course(outcomes: Outcomes, row: int) -> str:
    if not outcomes.executed[row]:
        return "without a verdict"
    how = "failed" if outcomes.collision[row] else "passed"
    return f"{how} at a least distance of {outcomes.clearance[row]:.2f} m"


def _singly(
    scenario: Path, settings: RunSettings, rss: str, sets: list[dict[str, str]]
) -> Outcomes:
    """Outcomes of parameter sets by the interpreter, in their order."""
    rows = [
        episode(Job(str(number), scenario, scenario, values), settings, rss)
        for number, values in enumerate(sets)
    ]
    return Outcomes.of(len(rows), **{name: [row[name] for row in rows] for name in NOTHING})


def _columns(outcomes: ArrayOutcomes) -> dict[str, Any]:
    """Columns of `Outcomes` of runs in arrays (n,)."""
    measured = outcomes.measures
    assert measured is not None
    failed, touched = outcomes.outcome == FAILED, np.isfinite(outcomes.contact)
    untested = outcomes.outcome == INCONCLUSIVE
    columns: dict[str, Any] = {
        "collision": failed,
        "r_risk": measured.risk,
        "min_ttc": np.where(touched, 0.0, measured.min_ttc),
        "risk": measured.risk_before,
        "max_drac": measured.max_drac,
        "clearance": measured.min_distance,
        "conflict": measured.nearest,
        "impact_speed": np.where(touched, measured.impact_speed, 0.0),
        "side": np.where(touched, measured.side, "").astype(object),
        "striking": touched & measured.striking,
        "margin": outcomes.margin,
        "end_time": outcomes.end_time,
        "status": np.where(untested, INCONCLUSIVE, outcomes.status),
        "error": np.where(untested, _UNTESTED, "").astype(object),
    }
    for name in ("r_risk", "min_ttc", "risk", "max_drac", "clearance", "conflict", "margin"):
        columns[name] = np.where(untested, NOTHING[name], columns[name])
    return columns
