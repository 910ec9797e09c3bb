"""The failures to look at first: the one that traffic does likeliest, and the one that is nearest to what was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from generation.outcomes.cases import Cases
from generation.outcomes.references import JUDGES, Drivers, matrix
from generation.pipeline import Generated, SearchSettings, evidence
from generation.search.diversity import distinctive
from generation.search.space import Space
from generation.variations import Writer
from xodr.array_types import BoolArray, FloatArray

LIKELIEST, NEAREST = "likeliest_failure", "nearest_failure"
"""What their files are called, after the scenario's name"""


@dataclass(frozen=True)
class Unit:
    """A recorded unit: its recording, values of what is searched, distance from a point as a share of the ranges (root mean
    square over all that tells cases apart)."""

    recording: str
    values: Mapping[str, float]
    distance: float


@dataclass(frozen=True)
class Counterexample:
    """A failure with its files.

    Attributes:
        names: which one it is, of `LIKELIEST` and `NEAREST`; both where they are the same.
        row: of `Counterexamples.cases`.
        scenario: its file, all values worked out. replay: the page that plays it.
        reproduced: whether the run of that file ends in a collision.
        recorded: the recorded unit that is most like it; None without recordings.
    """

    names: Sequence[str]
    row: int
    scenario: Path
    replay: Path
    reproduced: bool
    recorded: Unit | None


@dataclass(frozen=True, eq=False)
class Counterexamples:
    """Those that there are.

    Attributes:
        cases: the failures that they are of, one a row. foreseeable, preventable: which of them (n,) are.
    """

    cases: Cases
    foreseeable: BoolArray
    preventable: BoolArray
    found: Sequence[Counterexample]


def counterexamples(
    scenario: Path, generated: Generated, settings: SearchSettings, drivers: Drivers, out: Path
) -> Counterexamples:
    """Choose, write and play them: of the edge cases, or where none is a failure, of all failures.

    Args:
        drivers: runs points with other systems under test, where failures are no edge cases.
        out: folder for the files.
    """
    names, cases = _chosen(generated, drivers)
    if not names:
        return Counterexamples(cases, np.zeros(0, bool), np.zeros(0, bool), ())
    foreseeable = generated.prior.foreseeable(cases.theta)
    preventable = np.any([cases.drivers[name].survived for name in JUDGES], axis=0)
    files = Writer(scenario, generated.space, out, settings.run).concrete(cases, evidence(settings), [each[0] for each in names])
    found = []
    for row, (file, each) in enumerate(zip(files, names, strict=True)):
        replay, reproduced = _played(file, settings)
        found.append(Counterexample(each, row, file, replay, reproduced, nearest(generated, cases.theta[row])))
    return Counterexamples(cases, foreseeable, preventable, found)


def _chosen(generated: Generated, drivers: Drivers) -> tuple[list[list[str]], Cases]:
    """One or two failures with their names; none without failures."""
    cases = generated.cases.take(generated.cases.outcomes.collision)
    if not len(cases):
        cases = _others(generated)
    if not len(cases):
        return [], cases
    rows = {LIKELIEST: int(cases.log_likelihood.argmax())}
    distances = [each.distance for row in cases.theta if (each := nearest(generated, row)) is not None]
    if distances:
        rows[NEAREST] = int(np.argmin(distances))
    names = [[name for name, row in rows.items() if row == each] for each in dict.fromkeys(rows.values())]
    chosen = cases.take(np.array(list(dict.fromkeys(rows.values()))))
    return names, chosen if chosen.drivers else replace(chosen, drivers=matrix(chosen.theta, drivers).drivers)


def _others(generated: Generated) -> Cases:
    """All runs that failed, whether foreseeable and preventable or not; no other system has driven them yet."""
    theta, outcomes, rewards = generated.episodes
    rows = np.flatnonzero(outcomes.executed & outcomes.collision)
    points = theta[rows]
    likelihood = generated.prior.log_density(points) if len(rows) else np.empty(0)
    return Cases(points, outcomes.take(rows), rewards[rows], likelihood, {})


def nearest(generated: Generated, point: FloatArray) -> Unit | None:
    """The recorded unit that is most like a point (d,)."""
    if generated.gate.replayed is None:
        return None
    space, real = generated.space, generated.recorded
    distances = _distances(space, point, real.theta)
    row = int(distances.argmin())
    values = dict(zip(space.names, real.theta[row].tolist(), strict=True))
    return Unit(str(real.recordings[row]), values, float(distances[row]))


def _distances(space: Space, point: FloatArray, others: FloatArray) -> FloatArray:
    columns = distinctive(space)
    apart = (space.unit(others) - space.unit(point))[:, columns]
    found: FloatArray = np.sqrt(np.square(apart).mean(axis=1))
    return found


def _played(file: Path, settings: SearchSettings) -> tuple[Path, bool]:
    """The page that plays a scenario, and whether its run ends in a collision."""
    from runner.interpreter.execution import run
    from runner.replay.player import write_replay

    result = run(file, settings.run)
    result.name = file.stem
    page = file.with_suffix(".html")
    write_replay([result], page)
    return page, not result.verdict.passed
