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
        own = self.extras is None or name == DEFAULT
        path = path_of(self.out, scenario, system, name if own else name + EXTRAS, seed)
        if path.exists():
            return None
        counting = None if posed.problem.twin is None else Counting(posed.problem.twin)
        problem = replace(posed.problem, twin=counting)
        found = with_settings(name, self.tuned.get(name, {}))
        found = found if own else screened(found, min(self.extras or 0, SLOW.get(name, self.extras or 0)))
        history = found(problem, self.budget, seed)
        played = counting.played if counting is not None else 0
        counts = counted(history, posed, played)
        save(counts, path, self.budget)
        return counts


def with_settings(name: str, settings: Mapping[str, Any]) -> Search:
    """A method with some of its settings changed.

    Raises:
        UsageError: it has no such settings.
    """
    search = method(name, METHODS)
    if not settings:
        return search
    own = signature(search).parameters.get("settings")
    try:
        return partial(search, settings=replace(own.default if own is not None else None, **settings))
    except TypeError:
        raise UsageError(f"the method {name} has no settings {', '.join(settings)}") from None


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Settings by method, as `python -m generation.study tune` writes them.

    Raises:
        InvalidFile: it is something else.
    """
    return dict(read_object(path))
