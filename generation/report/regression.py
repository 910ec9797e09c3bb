"""Fates of the failures of another version of the system, replayed on this one: fixed, remaining,
new."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from generation.pipeline import Generated, estimate_file, evaluator_of, summary_file, system_digest
from generation.report.counterexamples import LINKED
from generation.search.gate import NEAR
from generation.search.outcomes import COLLISION, Outcomes, SimulationJob, Simulator
from generation.search.settings import SearchSettings
from generation.space.space import Space, apart, distinctive, grouped
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError
from schemas.common.storage import read_object
from xosc.distributions import ParameterSpace
from xosc.writing.tags import tags_of


class Fate(StrEnum):
    """Fate of a failure; a run with an error decides nothing.

    A failure found now that is unlike all of before is played with the former version: it is new
    where that one survives, missed where that one fails too, and unlike where that one can't be
    played.
    """

    FIXED = "fixed"
    STILL_THERE = "still-there"
    UNKNOWN = "unknown"
    NEW = "new"
    MISSED = "missed-before"
    UNLIKE = "unlike"


class Shift(StrEnum):
    """Change of a region of failures between two versions."""

    GONE = "gone"
    NEW = "new"
    MOVED = "moved"
    REMAINS = "remain"


_ALWAYS = (Fate.FIXED, Fate.STILL_THERE, Fate.NEW)
"""Fates that are reported even with no failure"""


@dataclass(frozen=True, eq=False)
class Before:
    """Results of another version's search in its folder.

    Attributes:
        folder: of the search. sut: its system under test.
        values: of all parameters of each failure that it found, by name.
        estimate: how often the system failed, as `generation.estimation.estimate.Estimate.as_json`
            has it; None where nothing is known.
        system: digest of the system, as `generation.pipeline.system_digest` has it; empty where it
            is not known.
    """

    folder: Path
    sut: str
    values: Sequence[Mapping[str, str]]
    estimate: Mapping[str, Any] | None = None
    system: str = ""

    @classmethod
    def of(cls, folder: Path, scenario: Path) -> Before:
        """Read the folder.

        Raises:
            UsageError: no search of the scenario is in it.
            InvalidFile: a file is malformed.
        """
        path, estimated = (
            folder / f"{scenario.stem}_edge_cases.xosc",
            folder / estimate_file(scenario),
        )
        # A search without a failure writes no edge cases, but its journal: it has nothing to
        # replay, and all failures of now may be new.
        if not (path.is_file() or any(folder.glob(f"{scenario.stem}_runs_*.jsonl"))):
            raise UsageError(
                f"--against: no search of {scenario.name} is in this folder", path=folder
            )
        estimate = read_object(estimated) if estimated.is_file() else None
        summarised = folder / summary_file(scenario)
        summary = read_object(summarised) if summarised.is_file() else {}
        system = str(summary.get("system", ""))
        # Who drove is in the tags of the edge cases; without these, the summary says it.
        if not path.is_file():
            return cls(
                folder, str((summary or estimate or {}).get("sut", "")), (), estimate, system
            )
        tags = {tag.type: tag.value for tag in tags_of(path)}
        verdicts, space = tags.get("Verdict"), ParameterSpace(path)
        if (
            # One verdict a set: tags of a file that was cut or merged by hand would name the wrong
            # sets.
            not isinstance(verdicts, Sequence)
            or isinstance(verdicts, str)
            or len(verdicts) != space.size
        ):
            raise UsageError(
                "--against: the tags of these edge cases do not say which are failures", path=path
            )
        values = [
            space.variation(number)[1]
            for number, verdict in enumerate(verdicts)
            if verdict == COLLISION
        ]
        return cls(folder, str(tags.get("SystemUnderTest", "")), values, estimate, system)


class Tried(NamedTuple):
    """Points (n, d) of a space that this version was run at, and which of them
    are failures (n,).
    """

    space: Space
    theta: FloatArray
    failing: BoolArray

    @classmethod
    def of(cls, generated: Generated) -> Tried:
        """The edge cases of a search."""
        return cls(generated.space, generated.cases.theta, generated.cases.outcomes.collision)


class Fates(Counter[Fate]):
    """Number of failures of each fate."""

    def fails(self, *by: Fate) -> bool:
        """Whether there are failures of any of these fates; of those whose runs failed, nothing
        good is assumed."""
        # A former failure that could not be replayed may be there still.
        wanted = {*by, Fate.UNKNOWN} if Fate.STILL_THERE in by else set(by)
        return any(self[fate] for fate in wanted)

    def __str__(self) -> str:
        return ", ".join(f"{self[fate]} {fate}" for fate in Fate if fate in _ALWAYS or self[fate])


@dataclass(frozen=True, eq=False)
class Regression:
    """The comparison.

    Attributes:
        before: the other version.
        replayed: outcomes of its failures with this one (n,). fates: what became of them (n,).
        found: fates of the points (m,) of this version: `NEW`, `MISSED` or `UNLIKE` for failures
            unlike all of before, else None.
        regions: number of regions of failures by what became of them.
    """

    before: Before
    replayed: Outcomes
    fates: Sequence[Fate]
    found: Sequence[Fate | None]
    regions: Counter[Shift]

    @property
    def counts(self) -> Fates:
        """Number of failures of each fate."""
        return Fates([*self.fates, *(fate for fate in self.found if fate is not None)])

    def __str__(self) -> str:
        regions = ", ".join(f"{self.regions[shift]} {shift}" for shift in Shift)
        return (
            f"against {self.before.sut or 'the system'} in {self.before.folder}: {self.counts}; "
            f"regions: {regions}"
        )


def regression(
    before: Before, scenario: Path, tried: Tried, settings: SearchSettings
) -> Regression:
    """Replay the failures of another version, and compare what was found.

    A failure is fixed where the system survives it, and nothing that was found now is like it.
    Failures found now that are unlike all of before are played with the former version, where its
    name, parameters and code are those of then.

    Args:
        tried: edge cases of this version.

    Raises:
        UsageError: a parameter of before is not declared any more.
    """
    space = tried.space
    # Codes of a search stand for several parameters at once, which the file has one by one.
    following = {name for texts in space.follows.values() for row in texts.values() for name in row}
    declared = {*space.names, *space.pinned, *following}
    unknown = sorted({name for values in before.values for name in values} - declared)
    if unknown:
        raise UsageError(
            f"--against: the scenario has no parameter {unknown[0]} any more", path=before.folder
        )
    with Simulator(
        run=settings.run, rss=settings.rss, processes=settings.processes, ray=settings.ray
    ) as simulator:
        # As it stands in the file, not as a point: former values may be outside the limits of now.
        jobs = (
            SimulationJob(str(number), scenario, scenario, dict(assignment))
            for number, assignment in enumerate(before.values)
        )
        replayed = simulator.of(jobs)
    # Nearness beside the replay: a failure that moved a little is not fixed, though its old place
    # is safe now.
    far = _far(tried, before, settings.choice.apart)
    # Without failures now, `all` of nothing is true: no failure of before is alike one.
    alike = np.array([not row.all() for row in far[:, tried.failing]], bool)
    fates = [
        Fate.UNKNOWN if not executed else Fate.STILL_THERE if collided or near else Fate.FIXED
        for executed, collided, near in zip(
            replayed.executed, replayed.collision, alike, strict=True
        )
    ]
    # Without former failures `all` of nothing is true: every failure of now is unlike them.
    found = _found(before, scenario, tried, tried.failing & far.all(axis=0), settings)
    return Regression(before, replayed, fates, found, _regions(before, tried, fates))


def _regions(before: Before, tried: Tried, fates: Sequence[Fate]) -> Counter[Shift]:
    """Regions of the failures of both versions together: groups by distance, as
    `generation.report.counterexamples` has them.

    A region is gone where all its failures of before are fixed and none is found now. It has moved
    where none of them is left as it was, or where the middle of what fails now is `NEAR` or more
    from the middle of what failed before.
    """
    space, columns = tried.space, distinctive(tried.space)
    points = {row: space.point(values) for row, values in enumerate(before.values)}
    # Failures at other pinned values are no points of this space.
    rows = [row for row, values in enumerate(before.values) if _alike(space, values)]
    rows = [row for row in rows if points[row] is not None]
    then = np.array([points[row] for row in rows]).reshape(-1, len(space.names))
    remains = np.array([fates[row] is not Fate.FIXED for row in rows], bool)
    unit = space.unit(np.concatenate([then, tried.theta[tried.failing]]))[:, columns]
    labels, regions = grouped(unit, LINKED), Counter[Shift]()
    for label in np.unique(labels):
        of = labels == label
        old, new = of[: len(then)], of[len(then) :]
        # What is fixed is where failures were, no longer where they are.
        left = unit[: len(then)][old & remains]
        now = np.concatenate([left, unit[len(then) :][new]])
        if not old.any():
            regions[Shift.NEW] += 1
        elif not len(now):
            regions[Shift.GONE] += 1
        else:
            way = now.mean(axis=0) - unit[: len(then)][old].mean(axis=0)
            # Root mean square over parameters, as `NEAR` is.
            moved = not len(left) or float(np.sqrt(np.square(way).mean())) >= NEAR
            regions[Shift.MOVED if moved else Shift.REMAINS] += 1
    return regions


def _alike(space: Space, values: Mapping[str, str]) -> bool:
    """Whether values of before have what is pinned now."""
    return all(values.get(name, value) == value for name, value in space.pinned.items())


def _found(
    before: Before, scenario: Path, tried: Tried, unlike: BoolArray, settings: SearchSettings
) -> list[Fate | None]:
    """Fates of points (m,): of those that are unlike all failures of before."""
    fates: list[Fate | None] = [Fate.UNLIKE if far else None for far in unlike]
    rows, run = np.flatnonzero(unlike), replace(settings.run, sut=before.sut)
    # A system that has changed under its name would be played as if it were the former one.
    if not rows.size or not before.sut or not _same(before, scenario, run):
        return fates
    # All at once: a process that loads the former system is the dear part.
    with evaluator_of(scenario, tried.space, replace(settings, run=run)) as former:
        then = former(tried.theta[rows])
    for row, executed, collided in zip(rows.tolist(), then.executed, then.collision, strict=True):
        fates[row] = Fate.UNLIKE if not executed else Fate.MISSED if collided else Fate.NEW
    return fates


def _same(before: Before, scenario: Path, run: RunSettings) -> bool:
    """Whether the former system is still there as it was."""
    try:
        return bool(before.system) and system_digest(scenario, run) == before.system
    # The former system is not installed here: its failures are unlike, and not called new.
    except UsageError:
        return False


def _far(tried: Tried, before: Before, least: float) -> BoolArray:
    """Whether failures of before (n,) are unlike points (m,), by all that distinguishes cases: (n,
    m)."""
    space, columns = tried.space, distinctive(tried.space)
    unlike = np.ones((len(before.values), len(tried.theta)), bool)
    for row, values in enumerate(before.values):
        point = space.point(values)
        # At another pinned value nothing is like it: the row stays all true.
        if point is not None and _alike(space, values):
            unlike[row] = apart(
                space.unit(tried.theta)[:, columns], space.unit(point[None])[:, columns], least
            )
    return unlike
