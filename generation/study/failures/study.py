"""One search of a comparison, and the settings that were chosen on development seeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

from generation.search.method import DEFAULT, method
from generation.search.problem import Search
from generation.search.quality.search import QualitySettings
from generation.study.failures.counts import EXTRAS, Counts, counted, path_of, save
from generation.study.failures.problem import Counting, Posed
from generation.study.failures.screened import screened
from generation.study.methods import METHODS
from schemas.errors import UsageError
from schemas.storage import read_object

SLOW: Mapping[str, int] = {"ibo": 300}
"""Proposals at most of methods whose own cost grows faster than the number of proposals"""


@dataclass(frozen=True)
class Comparison:
    """What all searches of a comparison have in common.

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
        screening = self.extras is not None and name != DEFAULT
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
        """As many proposals for all methods, where they are screened, on a twin or by the prior alone."""
        settings = dict(self.tuned.get(name, {}))
        if self.extras is None:
            return with_settings(name, settings)
        if name == DEFAULT:
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
    """Settings by method, as `python -m generation.study tune` writes them.

    Raises:
        InvalidFile: it is something else.
    """
    return dict(read_object(path))
