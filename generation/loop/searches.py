"""Searches of a loop, and the fate of the failures that an earlier loop found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

import xosc
from generation.loop.findings import (
    Against,
    CarefulDriver,
    CaseVerdict,
    Compared,
    EdgeCase,
    KnownFailure,
    Searched,
    SearchedRegion,
    SearchRange,
)
from generation.loop.inputs import SearchTarget
from generation.loop.runs import searches
from generation.pipeline import Generated, generate, space_of
from generation.report.counterexamples import regions, varying
from generation.report.regression import Before, Fate, Tried, regression
from generation.search.gate import Share
from generation.search.outcomes import Episodes
from generation.search.settings import Choice, LoopSettings, SearchSettings
from generation.space.space import Space, apart, diverse
from runner.batch.pool import dismiss, executor
from schemas.common.array_types import FloatArray
from schemas.common.errors import ToolchainError, UsageError

_ALIKE = Choice().apart
"""Failures that are nearer to each other than this are one; as for edge cases"""


class Failures(NamedTuple):
    """Failures of the system under test, one a row, no two alike, those with the greatest rewards
    first.

    Attributes:
        theta: parameters (n, d).
        collisions: how many of all are collisions; the others are violations of RSS distances.
        new: how many collisions are unlike all failures that were known before.
    """

    theta: FloatArray
    collisions: int
    new: int


def failures(space: Space, episodes: Episodes, before: FloatArray | None = None) -> Failures:
    """The failures among episodes.

    Args:
        before: failures (m, d) that were known already.
    """
    # `diverse` keeps the first of those that are alike: the one with the greatest reward.
    order = np.argsort(-episodes.rewards, kind="stable")
    # Counted by themselves: of a collision and a near miss that are alike, one hides the other.
    collided = order[episodes.outcomes.collision[order]]
    distinct = collided[diverse(space.unit(episodes.theta[collided]), _ALIKE)]
    unit = space.unit(episodes.theta[distinct])
    # New by the measure of `diverse`, or a failure could be new and a copy of an old one at once.
    new = len(distinct) if before is None else int(apart(unit, space.unit(before), _ALIKE).sum())
    order = order[episodes.outcomes.critical[order]]
    chosen = order[diverse(space.unit(episodes.theta[order]), _ALIKE)]
    return Failures(episodes.theta[chosen], len(distinct), new)


_DIGITS = 6
"""Decimal places that say anything"""
_SHOWN = 300
"""Points of each kind in a plot, at most"""


def search(
    target: SearchTarget,
    number: int,
    out: Path,
    settings: LoopSettings,
    known: FloatArray | None,
    progress: Callable[[int], None],
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
    of = Searched(
        round=number,
        target=target.name,
        title=target.title,
        scenario=target.scenario.stem,
        prior=target.prior,
    )
    try:
        made = generate(
            target.scenario,
            target.recorded,
            folder,
            settings_of(target, settings.search(number)),
            progress,
            known,
        )
    except ToolchainError as error:
        return replace(of, error=str(error), failures={of.title: f"not searched: {error}"})
    sought, cases = failures(made.space, made.history, known), list(_cases(made, out))
    drawn = made.statement
    # Those beyond the limits would stretch the plot over a range that is never searched.
    real = target.recorded(made.space).within(made.space).theta
    # Where all draws end with errors nothing is sought: these say why.
    outcomes = (made.episodes if made.lost else made.history).outcomes
    errors = Counter(outcomes.error[~outcomes.executed].tolist())
    mostly = max(sorted(errors), key=errors.__getitem__, default="")
    return replace(
        of,
        failures={}
        if outcomes.executed.any()
        else {of.title: f"no run succeeded, mostly: {mostly}"},
        parameters=[
            SearchRange(parameter.name, parameter.low, parameter.high)
            for parameter in made.space.parameters
        ],
        pinned=dict(made.space.pinned),
        # Sought runs alone: the unguided draws are told with the bound that they give.
        calls=len(outcomes),
        failed_runs=int((~outcomes.executed).sum()),
        errors=int((outcomes.status == "error").sum()),
        run_error=mostly,
        draws=drawn.draws,
        drawn=drawn.failing,
        collisions=int(outcomes.collision.sum()),
        distinct=sought.collisions,
        new=sought.new,
        cases=cases,
        regions=list(regions_of(made, cases)),
        failed=failures(
            made.space, made.episodes, known
        ).theta.tolist(),  # cases may be draws of the density as well
        real=_thinned(real).tolist(),
        tried=_thinned(made.history.theta).tolist(),
    )


def settings_of(target: SearchTarget, settings: SearchSettings) -> SearchSettings:
    """Settings of a search, with what was asked for of a target."""
    return settings if target.asked is None else replace(settings, **vars(target.asked.choice))


def found_by(rounds: Iterable[Searched]) -> FloatArray | None:
    """The failures of earlier rounds of one target, one a row; None where there are none."""
    rows = [row for round_ in rounds for row in round_.failed]
    return np.array(rows) if rows else None


def _cases(made: Generated, out: Path) -> Iterator[EdgeCase]:
    """The edge cases: parameters, evidence, files."""
    cases = made.cases
    # In the order of the cases, one file for each.
    scenarios = made.files[2:]  # after the variation file and that of the density
    for row, (file, theta) in enumerate(zip(scenarios, cases.theta.tolist(), strict=True)):
        survivors = [name for name in cases.judges if cases.drivers[name].survived[row]]
        # A judge whose run failed neither survives nor collides: of such a case nothing is known.
        all_collide = all(cases.drivers[name].collision[row] for name in cases.judges)
        careful = CarefulDriver.COLLIDES if all_collide else CarefulDriver.UNKNOWN
        yield EdgeCase(
            file=file.relative_to(out).as_posix(),
            road=road_of(file, out),
            theta=dict(zip(made.space.names, theta, strict=True)),
            verdict=CaseVerdict.COLLISION
            if cases.outcomes.collision[row]
            else CaseVerdict.VIOLATION,
            careful=CarefulDriver.AVOIDS if survivors else careful,
            likelihood=round(float(cases.log_likelihood[row]), _DIGITS),
            risk=round(float(cases.outcomes.r_risk[row]), _DIGITS),
            survivors=survivors,
        )


def regions_of(made: Generated, cases: Sequence[EdgeCase]) -> Iterator[SearchedRegion]:
    """Return the regions of failure, with the files of their edge cases."""
    of = varying(made)
    for region in regions(made, of):
        low, high = region.chance.interval
        yield SearchedRegion(
            rule=region.rule(of),
            precision=_share(region.precision),
            recall=_share(region.recall),
            failures=region.failures,
            draws=region.chance.draws,
            drawn=region.chance.failing,
            low=round(low, _DIGITS),
            high=round(high, _DIGITS),
            severity=round(region.severity, _DIGITS),
            cases=[cases[row].file for row in region.cases],
        )


def _share(of: Share) -> float | None:
    return round(of.collisions / of.runs, _DIGITS) if of.runs else None


def road_of(scenario: Path, out: Path) -> str | None:
    """The road file of a scenario, relative to the output folder; None where it has none there."""
    logic = xosc.load(scenario).node.need("RoadNetwork").find("LogicFile")
    if logic is None:
        return None
    # The page opens files below its own folder only: of a road elsewhere it shows no link.
    path = (scenario.parent / logic.get("filepath")).resolve()
    return (
        path.relative_to(out.resolve()).as_posix() if path.is_relative_to(out.resolve()) else None
    )


def _thinned(theta: FloatArray) -> FloatArray:
    """Evenly chosen rows, no more than can be seen, rounded to what can be seen."""
    rows = np.linspace(0, len(theta) - 1, min(len(theta), _SHOWN)).astype(int)
    return theta[rows].round(4)


class Searchers:
    """Processes that search. A context manager; they last as long as it does.

    A target is searched by the same process in each round: it remembers the densities that it has
    fitted.

    Args:
        out: output folder of the loop.
        settings: of the loop; `processes` says how many there are.
    """

    def __init__(self, out: Path, settings: LoopSettings) -> None:
        self._out, self._count, self._settings = (
            out,
            settings.processes,
            replace(settings, processes=1),
        )
        self._processes: list[ProcessPoolExecutor] = []
        self._numbers: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            dismiss(process)

    def begin(
        self, target: SearchTarget, number: int, known: FloatArray | None
    ) -> Callable[[], Searched]:
        """Begin to search, see `search`; what waits for the result.

        That raises ToolchainError where the process has died.
        """
        if not self._processes:
            self._processes = [executor(1, anew=True) for _ in range(self._count)]
        process = self._processes[
            # In turn by first request, the same in each round, so that a density is fitted once.
            self._numbers.setdefault(target.name, len(self._numbers) % self._count)
        ]
        future = process.submit(_searched, target, number, self._out, self._settings, known)
        return lambda: _result(future)


def _searched(
    target: SearchTarget, number: int, out: Path, settings: LoopSettings, known: FloatArray | None
) -> Searched:
    return search(target, number, out, settings, known, lambda _: None)


def _result(search: Future[Searched]) -> Searched:
    try:
        return search.result()
    except BrokenProcessPool:
        raise ToolchainError(
            "a process died, perhaps because memory ran out; go on with --jobs 1"
        ) from None


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
        sut, done = searches(folder)
        return cls(folder, sut, _by_target(done))

    def before(self, target: str) -> Before:
        """The failures of a target in all rounds.

        Raises:
            UsageError, InvalidFile: its edge cases are gone, or were changed.
        """
        rounds = [
            Before.of(
                self.folder / f"round_{search.round}" / target, Path(f"{search.scenario}.xosc")
            )
            for search in self.searches.get(target, ())
        ]
        # Rounds by different code have no one former system that could tell what is new.
        systems = {round_.system for round_ in rounds}
        values = [value for round_ in rounds for value in round_.values]
        return Before(
            self.folder, self.sut, values, system=systems.pop() if len(systems) == 1 else ""
        )


def compare(
    earlier: Earlier,
    targets: Sequence[SearchTarget],
    searched: Iterable[Searched],
    settings: LoopSettings,
    progress: Callable[[int], None],
) -> Against:
    """Replay the failures of an earlier loop, and say which failures are new.

    Targets that only one of the loops has searched are compared too: their failures are new or
    unknown.

    Args:
        targets: of this loop. searched: their searches.
        progress: called with 1 after each target.
    """
    done = _by_target(searched)

    def along() -> Iterator[Compared]:
        for target in targets:
            if target.name in done or target.name in earlier.searches:
                yield _compared(earlier, target, done.get(target.name, ()), settings)
            progress(1)
        for name in sorted(earlier.searches.keys() - {target.name for target in targets}):
            title = earlier.searches[name][0].title
            # A class of the earlier loop that is not even in these recordings: its failures may not
            # vanish from the sums.
            yield _unknown(earlier, name, title, "this loop does not search it")

    return Against(earlier.folder.resolve().name, earlier.sut, list(along()))


def _compared(
    earlier: Earlier, target: SearchTarget, now: Sequence[Searched], settings: LoopSettings
) -> Compared:
    then = earlier.searches.get(target.name, ())
    if not now:
        return _unknown(
            earlier, target.name, target.title, "this loop could not search it", blind=True
        )
    if all(search.in_vain for search in now):
        return _unknown(
            earlier, target.name, target.title, f"no run succeeded: {now[0].run_error}", blind=True
        )
    # Parameters of one name mean another thing in another scenario.
    if then and then[0].scenario != now[0].scenario:
        return _unknown(
            earlier, target.name, target.title, f"it was {then[0].scenario} that was searched"
        )
    failures = [
        case for search in now for case in search.cases if case.verdict is CaseVerdict.COLLISION
    ]
    search = settings_of(target, settings.search(now[0].round))
    try:
        space, before = space_of(target.scenario, search), earlier.before(target.name)
        theta = np.array([[case.theta[name] for name in space.names] for case in failures]).reshape(
            -1, len(space.names)
        )
        # Edge cases only: they were run again with other drivers and are no accidents of a search.
        tried = Tried(space, theta, np.ones(len(theta), bool))
        made = regression(before, target.scenario, tried, search)
    # A round that was cleared away, or a parameter that is gone, spoils this class alone.
    except UsageError as error:
        return _unknown(earlier, target.name, target.title, error.message)
    known = [
        KnownFailure(dict(values), fate)
        for values, fate in zip(before.values, made.fates, strict=True)
    ]
    fates: dict[str, Fate] = {
        case.file: fate for case, fate in zip(failures, made.found, strict=True) if fate is not None
    }
    new = [file for file, fate in fates.items() if fate is Fate.NEW]
    others: dict[str, Fate] = {file: fate for file, fate in fates.items() if fate is not Fate.NEW}
    reason = _NOTHING_BEFORE if then and all(search.in_vain for search in then) else ""
    return Compared(
        target=target.name, title=target.title, reason=reason, before=known, new=new, others=others
    )


def _unknown(
    earlier: Earlier, target: str, title: str, reason: str, blind: bool = False
) -> Compared:
    """Return a comparison that knows no fate; `blind` where this loop's searches say nothing."""
    failures = [
        KnownFailure(_texts(case), Fate.UNKNOWN)
        for search in earlier.searches.get(target, ())
        for case in search.cases
        if case.verdict is CaseVerdict.COLLISION
    ]
    return Compared(target=target, title=title, reason=reason, before=failures, blind=blind)


def _texts(case: EdgeCase) -> dict[str, str]:
    return {name: f"{value:g}" for name, value in case.theta.items()}


def _by_target(searches: Iterable[Searched]) -> dict[str, list[Searched]]:
    listed: dict[str, list[Searched]] = {}
    for search in searches:
        if not search.error:
            listed.setdefault(search.target, []).append(search)
    return listed
