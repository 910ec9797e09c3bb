"""What became of the failures of another version of the system: replayed on this one, fixed or still there; and what is new."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from generation.outcomes.cases import COLLISION
from generation.outcomes.evaluator import Episode, Simulator
from generation.outcomes.outcomes import Outcomes
from generation.pipeline import Generated, SearchSettings, estimate_file
from generation.search.diversity import apart, distinctive
from generation.search.space import Space
from schemas.errors import UsageError
from schemas.storage import read_object
from xodr.array_types import BoolArray, FloatArray
from xosc.distributions import ParameterSpace
from xosc.tags import tags_of


class Fate(StrEnum):
    """What became of a failure; a run that failed says nothing of it."""

    FIXED = "fixed"
    STILL_THERE = "still-there"
    UNKNOWN = "unknown"
    NEW = "new"


@dataclass(frozen=True, eq=False)
class Before:
    """What a search of another version of the system left in its folder.

    Attributes:
        folder: of the search. sut: its system under test.
        values: of all parameters of each failure that it found, by name.
        estimate: how often the system failed, as `generation.estimation.estimate.Estimate.as_json` has it; None where nothing is
            known.
    """

    folder: Path
    sut: str
    values: Sequence[Mapping[str, str]]
    estimate: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, folder: Path, scenario: Path) -> Before:
        """Read the folder.

        Raises:
            UsageError: no search of the scenario is in it.
            InvalidFile: a file is malformed.
        """
        path, estimated = folder / f"{scenario.stem}_edge_cases.xosc", folder / estimate_file(scenario)
        if not (path.is_file() or any(folder.glob(f"{scenario.stem}_runs_*.jsonl"))):
            raise UsageError(f"--against: no search of {scenario.name} is in this folder", path=folder)
        estimate = read_object(estimated) if estimated.is_file() else None
        if not path.is_file():
            return cls(folder, str(estimate["sut"]) if estimate else "", (), estimate)
        tags = {tag.type: tag.value for tag in tags_of(path)}
        verdicts, space = tags.get("Verdict"), ParameterSpace(path)
        if not isinstance(verdicts, Sequence) or isinstance(verdicts, str) or len(verdicts) != space.size:
            raise UsageError("--against: the tags of these edge cases do not say which are failures", path=path)
        values = [space.variation(number)[1] for number, verdict in enumerate(verdicts) if verdict == COLLISION]
        return cls(folder, str(tags.get("SystemUnderTest", "")), values, estimate)


class Tried(NamedTuple):
    """Points (n, d) of a space that this version was run at, and which of them are failures (n,)."""

    space: Space
    theta: FloatArray
    failing: BoolArray

    @classmethod
    def of(cls, generated: Generated) -> Tried:
        """The edge cases of a search."""
        return cls(generated.space, generated.cases.theta, generated.cases.outcomes.collision)


class Fates(Counter[Fate]):
    """How many failures have each fate."""

    def fails(self, *by: Fate) -> bool:
        """Whether there are failures of any of these fates; of those whose runs failed, nothing good is assumed."""
        wanted = {*by, Fate.UNKNOWN} if Fate.STILL_THERE in by else set(by)
        return any(self[fate] for fate in wanted)

    def __str__(self) -> str:
        return ", ".join(f"{self[fate]} {fate}" for fate in Fate if fate is not Fate.UNKNOWN or self[fate])


@dataclass(frozen=True, eq=False)
class Regression:
    """The comparison.

    Attributes:
        before: the other version.
        replayed: what came of its failures with this one (n,). fates: what became of them (n,).
        new: rows of the points (m,) that are failures unlike all of before.
    """

    before: Before
    replayed: Outcomes
    fates: Sequence[Fate]
    new: BoolArray

    @property
    def counts(self) -> Fates:
        """How many failures have each fate."""
        return Fates({**Counter(self.fates), Fate.NEW: int(self.new.sum())})

    def __str__(self) -> str:
        return f"against {self.before.sut or 'the system'} in {self.before.folder}: {self.counts}"


def regression(before: Before, scenario: Path, tried: Tried, settings: SearchSettings) -> Regression:
    """Replay the failures of another version, and compare what was found.

    A failure is fixed where the system survives it, and nothing that was found now is like it.

    Args:
        tried: edge cases of this version.

    Raises:
        UsageError: a parameter of before is not declared any more.
    """
    space = tried.space
    declared = {*space.names, *space.pinned}
    unknown = sorted({name for values in before.values for name in values} - declared)
    if unknown:
        raise UsageError(f"--against: the scenario has no parameter {unknown[0]} any more", path=before.folder)
    with Simulator(run=settings.run, rss=settings.rss, processes=settings.processes, ray=settings.ray) as simulator:
        jobs = (Episode(str(number), scenario, scenario, dict(each)) for number, each in enumerate(before.values))
        replayed = simulator.of(jobs)
    far = _far(tried, before, settings.choice.apart)
    alike = np.array([not row.all() for row in far[:, tried.failing]], bool)
    fates = [
        Fate.UNKNOWN if not executed else Fate.STILL_THERE if collided or near else Fate.FIXED
        for executed, collided, near in zip(replayed.executed, replayed.collision, alike, strict=True)
    ]
    return Regression(before, replayed, fates, tried.failing & far.all(axis=0))


def _far(tried: Tried, before: Before, least: float) -> BoolArray:
    """Whether failures of before (n,) are unlike points (m,), by all that tells cases apart: (n, m)."""
    space, columns = tried.space, distinctive(tried.space)
    found = np.ones((len(before.values), len(tried.theta)), bool)
    for row, values in enumerate(before.values):
        if all(values.get(name, value) == value for name, value in space.pinned.items()):
            point: FloatArray = np.array([[float(values[name]) for name in space.names]])
            found[row] = apart(space.unit(tried.theta)[:, columns], space.unit(point)[:, columns], least)
    return found


def fates(texts: Sequence[str] | None, against: Path | None) -> tuple[Fate, ...]:
    """What `--fail-if` names; both where it names nothing.

    Raises:
        UsageError: it names something else, or there is no `--against`.
    """
    if texts and against is None:
        raise UsageError("--fail-if is about failures of another version: --against says where these are")
    offered = {str(fate): fate for fate in (Fate.NEW, Fate.STILL_THERE)}
    for text in texts or ():
        if text not in offered:
            raise UsageError(f"--fail-if {text!r}: one of {', '.join(offered)} is expected")
    return tuple(offered[text] for text in texts or offered)
