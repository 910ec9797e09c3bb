"""What became of the failures that an earlier loop found in another version of the system under test."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from generation.loop.settings import LoopSettings
from generation.loop.stages.findings import Against, CaseVerdict, Compared, EdgeCase, KnownFailure, Searched
from generation.loop.stages.finished import searches
from generation.loop.tasks.searching import settings_of
from generation.loop.tasks.targets import Target
from generation.report.regression import Before, Fate, Tried, regression
from schemas.errors import UsageError

_NOTHING_BEFORE = "no run of the earlier loop succeeded: what is new here may be older"


class Earlier(NamedTuple):
    """A loop that is compared with.

    Attributes:
        folder: its output folder.
        sut: its system under test.
        searches: by target, round after round, without those that could not be done.
    """

    folder: Path
    sut: str
    searches: Mapping[str, Sequence[Searched]]

    @classmethod
    def of(cls, folder: Path) -> Earlier:
        """Read an output folder.

        Raises:
            UsageError: no loop is there. InvalidFile: what it has left is not readable.
        """
        sut, found = searches(folder)
        return cls(folder, sut, _by_target(found))

    def before(self, target: str) -> Before:
        """The failures of a target in all rounds.

        Raises:
            UsageError, InvalidFile: its edge cases are gone, or were changed.
        """
        values = [
            each
            for search in self.searches.get(target, ())
            for each in Before.of(self.folder / f"round_{search.round}" / target, Path(f"{search.scenario}.xosc")).values
        ]
        return Before(self.folder, self.sut, values)


def compare(
    earlier: Earlier,
    targets: Sequence[Target],
    found: Iterable[Searched],
    settings: LoopSettings,
    progress: Callable[[int], None],
) -> Against:
    """Replay the failures of an earlier loop, and say which failures are new.

    Targets of which only one of the loops has a search are compared too: those failures are new, or nothing is known of them.

    Args:
        targets: of this loop. found: their searches.
        progress: called with 1 after each target.
    """
    done = _by_target(found)

    def along() -> Iterator[Compared]:
        for target in targets:
            if target.name in done or target.name in earlier.searches:
                yield _compared(earlier, target, done.get(target.name, ()), settings)
            progress(1)
        for name in sorted(earlier.searches.keys() - {target.name for target in targets}):
            title = earlier.searches[name][0].title
            yield _unknown(earlier, name, title, "this loop does not search it")

    return Against(earlier.folder.resolve().name, earlier.sut, list(along()))


def _compared(earlier: Earlier, target: Target, now: Sequence[Searched], settings: LoopSettings) -> Compared:
    then = earlier.searches.get(target.name, ())
    if not now:
        return _unknown(earlier, target.name, target.title, "this loop could not search it", blind=True)
    if all(search.in_vain for search in now):
        return _unknown(earlier, target.name, target.title, f"no run succeeded: {now[0].run_error}", blind=True)
    if then and then[0].scenario != now[0].scenario:
        return _unknown(earlier, target.name, target.title, f"it was {then[0].scenario} that was searched")
    failures = [case for search in now for case in search.cases if case.verdict is CaseVerdict.COLLISION]
    search = settings_of(target, settings.search(now[0].round))
    try:
        space, before = search.space(target.scenario), earlier.before(target.name)
        theta = np.array([[case.theta[name] for name in space.names] for case in failures]).reshape(-1, len(space.names))
        tried = Tried(space, theta, np.ones(len(theta), bool))
        made = regression(before, target.scenario, tried, search)
    except UsageError as error:
        return _unknown(earlier, target.name, target.title, error.message)
    known = [KnownFailure(dict(values), fate) for values, fate in zip(before.values, made.fates, strict=True)]
    new = [case.file for case, unlike in zip(failures, made.new, strict=True) if unlike]
    reason = _NOTHING_BEFORE if then and all(search.in_vain for search in then) else ""
    return Compared(target=target.name, title=target.title, reason=reason, before=known, new=new)


def _unknown(earlier: Earlier, target: str, title: str, reason: str, blind: bool = False) -> Compared:
    """A target whose failures of before nothing is known of."""
    found = [case for search in earlier.searches.get(target, ()) for case in search.cases]
    failures = [KnownFailure(_texts(each), Fate.UNKNOWN) for each in found if each.verdict is CaseVerdict.COLLISION]
    return Compared(target=target, title=title, reason=reason, before=failures, blind=blind)


def _texts(case: EdgeCase) -> dict[str, str]:
    return {name: f"{value:g}" for name, value in case.theta.items()}


def _by_target(found: Iterable[Searched]) -> dict[str, list[Searched]]:
    listed: dict[str, list[Searched]] = {}
    for each in found:
        if not each.error:
            listed.setdefault(each.target, []).append(each)
    return listed
