"""Distinct failures by method and budget: the study, its ablations, and the trials that chose settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple

from generation.search.emitters import EMITTERS
from generation.search.methods import method
from generation.search.methods.quality import QualitySettings, quality
from generation.search.problem import BATCH, Counting, Search
from schemas.common.errors import UsageError
from schemas.common.storage import read_object
from studies.generation.failures.counts import EXTRAS, REFERENCE, Counts, counted, path_of, save
from studies.generation.failures.problem import Posed, screened
from studies.generation.methods import METHODS
from studies.recognition.report.tables import Table, spread

SLOW: Mapping[str, int] = {"ibo": 300}
"""Proposals at most of methods whose own cost grows faster than the number of proposals"""


@dataclass(frozen=True)
class Comparison:
    """Common parts of all searches of a comparison.

    Attributes:
        out: folder of its counts. budget: runs of each search.
        extras: proposals of each search that are screened before they are run; None for methods as they are.
        tuned: settings by method; the others have their defaults.
    """

    out: Path
    budget: int
    extras: int | None = None
    tuned: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def search(self, posed: Posed, scenario: Path, system: str, name: str, seed: int) -> Counts | None:
        """Search and judge; None where that was done before."""
        screening = self.extras is not None and name != REFERENCE
        path = path_of(self.out, scenario, system, name + EXTRAS if screening else name, seed)
        if path.exists():
            return None
        counting = None if posed.problem.twin is None else Counting(posed.problem.twin)
        problem = replace(posed.problem, twin=counting)
        history = self._method(name)(problem, self.budget, seed)
        played = counting.played if counting is not None else 0
        counts = counted(history, posed, played)
        save(counts, path, self.budget)
        return counts

    def _method(self, name: str) -> Search:
        """Return a method with the same number of proposals as all others, screened on a twin or by the prior alone."""
        settings = dict(self.tuned.get(name, {}))
        if self.extras is None:
            return with_settings(name, settings)
        if name == REFERENCE:
            own = {"generations": QualitySettings().generations_of(self.extras), "pace": self.extras / self.budget}
            return with_settings(name, settings | own)
        return screened(with_settings(name, settings), min(self.extras, SLOW.get(name, self.extras)))


def with_settings(name: str, settings: Mapping[str, Any]) -> Search:
    """A method with some of its settings changed.

    Raises:
        UsageError: it has no such settings.
    """
    search = method(name, METHODS)
    taken = signature(search).parameters
    changed = {"settings": _changed(taken["settings"].default, settings)} if settings and "settings" in taken else dict(settings)
    if unknown := [each for each in changed if each not in taken]:
        raise UsageError(f"the method {name} has no setting {unknown[0]}")
    return partial(search, **changed)


def _changed(default: Any, settings: Mapping[str, Any]) -> Any:
    try:
        return replace(default, **settings)
    except TypeError as error:
        raise UsageError(f"{type(default).__name__}: {error}") from None


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Settings by method, as `python -m studies.generation tune` writes them.

    Raises:
        InvalidFile: it is something else.
    """
    return dict(read_object(path))


BOUNDS: Mapping[str, Mapping[str, Any]] = {
    "90 % span, 5 then 10 bins (as published)": {},
    "80 % span": {"span": 0.8},
    "whole span of the best tenth": {"span": 1.0},
    "bins as in the first stage": {"bins": (5, 5)},
    "20 bins in the second stage": {"bins": (5, 20)},
    "first edits up to 1.5 standard deviations": {"reach": 1.5},
}
"""Settings of MCSG by what they change: what the second stage keeps of the first one's ranges, its bins, the first ranges."""
_BATCH, _PLENTY = 500, 10_000


def sets() -> list[tuple[str, ...]]:
    """Each emitter alone, all but one, all, and those that are used."""
    alone = [(name,) for name in EMITTERS]
    but_one = [tuple(each for each in EMITTERS if each != name) for name in EMITTERS]
    every = [*alone, *but_one, tuple(EMITTERS), tuple(QualitySettings().emitters)]
    return list({frozenset(each): each for each in every}.values())


def by_emitters(posed: Posed, proposals: int, seeds: Sequence[int], tried: Sequence[Sequence[str]]) -> Table:
    """Failures on the twin that archives with each of these sets of emitters find with as many proposals."""
    rows: list[tuple[str, ...]] = []
    for chosen in tried:
        batch = QualitySettings.batch * len(QualitySettings().emitters) // len(chosen)
        settings = QualitySettings(chosen, batch=batch)
        settings = replace(settings, generations=settings.generations_of(proposals))
        found = [len(quality(posed.problem, _PLENTY, seed, settings).theta) for seed in seeds]
        rows.append((", ".join(chosen), str(len(seeds)), spread(found, 1)))
        print(" | ".join(rows[-1]), flush=True)
    note = f"Distinct preventable failures on the twin within {proposals} proposals, mean ± standard deviation over seeds."
    return Table("emitters", "What each emitter is worth", note, ("emitters", "seeds", "distinct failures"), rows)


def bounds(posed: Posed, proposals: int, seeds: Sequence[int]) -> Table:
    """Failures on the twin that MCSG finds with other bounds of its stages."""
    rows: list[tuple[str, ...]] = []
    for title, settings in BOUNDS.items():
        method = screened(with_settings("mcsg", {"batch": _BATCH, **settings}), proposals)
        found = [len(method(posed.problem, _PLENTY, seed).theta) for seed in seeds]
        rows.append((title, str(len(seeds)), spread(found, 1)))
        print(" | ".join(rows[-1]), flush=True)
    note = f"MCSG with the extras of quality-diversity search; failures as above, {proposals} proposals in batches of {_BATCH}."
    return Table("bounds", "Bounds of the coarse-to-fine stages", note, ("stages", "seeds", "distinct failures"), rows)


TRIALS: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "mcsg": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "elite": 0.01, "reach": 1.0, "spread": 0.3},
    ),
    "mcsg-published": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "reach": 1.0, "spread": 0.3},
    ),
    "ccsf": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "reach": 1.0, "spread": 0.3},
    ),
    "cma-es": (
        {"population": 250, "sigma": 0.2},
        {"population": 250, "sigma": 0.05},
        {"population": 100, "sigma": 0.1},
        {"population": 500, "sigma": 0.1},
    ),
    "gacs": (
        {"population": 250, "distance": 20.0},
        {"population": 500, "distance": 20.0},
        {"population": 500, "distance": 5.0},
        {"population": 250, "distance": 5.0},
    ),
    "rlbe": (
        {"batch": 250, "spread": 0.15},
        {"batch": 500, "spread": 0.05},
        {"batch": 500, "rate": 1e-2},
        {"batch": 500, "entropy": 1e-2},
    ),
    "rltester": (
        {"walkers": 250, "step": 0.1},
        {"walkers": 250, "step": 0.03},
        {"walkers": 500, "step": 0.05, "length": 20},
        {"walkers": 500, "step": 0.1, "length": 5},
    ),
    "ibo": (
        {"starts": 20, "batch": 10},
        {"starts": 100, "batch": 10},
        {"starts": 100, "batch": 25},
        {"starts": 20, "batch": 25},
    ),
}
"""Settings to try, by method; what has none is not here. Large batches, as the twin plays them nearly as fast as small ones."""


class Trial(NamedTuple):
    """Settings of a method, and the distinct failures that it found with each seed."""

    settings: Mapping[str, Any]
    found: tuple[int, ...]


def trials(posed: Posed, name: str, proposals: int, seeds: Sequence[int]) -> list[Trial]:
    """All trials of a method, with the extras of `screened`; in the order of `TRIALS`.

    Args:
        posed: the problem, on the twin.
        proposals: of each trial and seed.
    """
    budget, most = max(proposals, BATCH), min(proposals, SLOW.get(name, proposals))
    return [
        Trial(
            settings,
            tuple(len(screened(with_settings(name, settings), most)(posed.problem, budget, seed).theta) for seed in seeds),
        )
        for settings in TRIALS[name]
    ]
