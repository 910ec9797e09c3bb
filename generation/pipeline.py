"""Search of a logical scenario, step by step: space, density, search, judge, write.

`generate` has them in this order. A quarter of the budget are draws of the density; `_gate` says
by them whether the density may judge. The method spends the rest: its calls go through `_Course`
(time, interim results) and `Memory` (runs that are kept) to the `Evaluator`, which runs them. What
chooses and judges without runs is played in arrays (`_plays`). `made` makes of all runs so far the
edge cases and files, in the end and in between."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from generation.clock import PLAYED, SearchClock, TimedPlays, TimeOver
from generation.estimation.bound import DrawnBound, draws_needed, draws_until
from generation.estimation.estimate import (
    FAILURE,
    RUNS,
    Allowance,
    Estimate,
    EstimateSettings,
    Known,
    estimate,
)
from generation.estimation.probability import Driving, FailingDraws, Probability, driving
from generation.search.gate import (
    EVERYWHERE,
    NEAR,
    NO_DRAWS,
    Domain,
    Gate,
    Share,
    Statement,
    replay_shares,
)
from generation.search.methods.judging import NOT_JUDGED, JudgeCounts, Judging
from generation.search.outcomes import (
    Cases,
    Drivers,
    Episodes,
    Evaluate,
    Evaluator,
    Outcomes,
    Repeats,
    agrees,
    choose,
    joined,
    judges_of,
    remembering,
    write_episodes,
)
from generation.search.plays import ArrayPlays
from generation.search.problem import (
    Guidance,
    History,
    Memory,
    Realism,
    Reward,
    Search,
    SearchProblem,
    counted,
    counted_drivers,
    method,
    unlimited,
)
from generation.search.settings import SearchSettings
from generation.search.variations import Evidence, Writer, Written
from generation.space.density.base import Density
from generation.space.density.models import DEFAULT, UNIFORM
from generation.space.density.prior import Prior
from generation.space.density.roles import roles_of
from generation.space.recorded import Recorded
from generation.space.space import Space, apart, distinctive
from runner.batch.inputs import OURS, inputs
from runner.judging.settings import RunSettings
from runner.systems import system_name
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import Unsupported, UsageError
from schemas.common.storage import alone, digest, keep, write_object, writing
from schemas.common.terminal.text import many

LEAST = 30
"""Fewest recorded manoeuvres inside the box that a density is fitted on."""
_REPLAYED = 30, 300
"""Least and most replays of recorded units that a density is measured by; without plays; between
them a tenth of the budget
"""
_PLAYED, _MOST_PLAYED = 33, 10_000
"""Replays, and draws, that are played to measure a density for each run of the
budget, and how many at most
"""
_ONE_BY_ONE = 40
"""Plays for each run of the budget of a system that is asked run by run, which
costs as much as a run of it
"""
_GATED, _GATED_FIRST = 0.2, 250
"""Share of the time that is left which measuring a density takes, and replays, and draws, that are
played at first"""
DRAWS = "unguided draws"
"""Phase of the first runs: all that was asked for can be searched"""
_SEARCH = "search"
"""Phase of runs that a method chooses"""
_TIMED = 30
"""Draws that tell how long a run takes"""
_GATED_UNTIL = 0.6
"""Share of the search's time after which nothing more is replayed one by one"""
_DRAWN = 30, 0.25
"""Least number of unguided draws, and share of the budget that they are where that is more; never
more than half of the budget
"""


@dataclass(frozen=True, eq=False)
class Generated:
    """Result of a search.

    Attributes:
        space: what was searched, and what was pinned.
        recorded: the recorded manoeuvres that the density was fitted on, inside the limits.
        prior: what traffic does.
        history: all episodes of the search, without draws.
        episodes: all runs that are kept: of this search and of those before, draws of the density,
            runs of the estimate.
        cases: the edge cases.
        files: what was written; empty where there are no edge cases.
        gate: what the density was measured by.
        reused: how many answers came from runs that were kept.
        estimate: how often the system fails; None where that was not asked for.
        damaged: how many runs that were kept were damaged, and made anew where the search asked for
            them.
        statement: bound on the probability of failures that were not found, from the unguided draws
            of this call.
        draws: the unguided draws of this call; None where there were none.
        played: the bound by draws that measured the density in arrays, whose verdicts are those of
            all `draws`; None where none were played in the space of the search.
        measuring: these draws (n, d) and their outcomes; None where there are none.
        domain: operational domain outside of which nothing is foreseeable.
        cut: whether its time was over before its budget.
        unestimated: whether no run or draw has a verdict that the estimate that was asked for could
            be made of.
        bound: result of the draws that were asked for by `settings.until`; None where they were
            not, or the search has not ended.
        density: name of the density of recorded parameters.
        not_found: probability of failures that the search has not found, by the estimate; None
            where there is none, or too few of its draws fail: then the unguided draws bound it.
        limits: by which runs fail besides collisions (`RunSettings.fail_if`).
        driving: how often recordings have the manoeuvre, or why that is not known.
        plays: how many points were played with the system under test to choose the runs of the
            search; 0 where its scenario does not play in arrays.
        judged: verdicts on failures during the search; none where plays give them.
        guidance: guided runs and draws of the search, and whether it ended as nothing new failed.
    """

    space: Space
    recorded: Recorded
    prior: Prior
    history: History
    episodes: Episodes
    cases: Cases
    files: list[Path]
    gate: Gate
    reused: int = 0
    estimate: Estimate | None = None
    damaged: int = 0
    statement: Statement = NO_DRAWS
    plays: int = 0
    draws: Episodes | None = None
    domain: Domain = EVERYWHERE
    cut: bool = False
    unestimated: bool = False
    judged: JudgeCounts = NOT_JUDGED
    guidance: Guidance = field(default_factory=Guidance)
    bound: DrawnBound | None = None
    density: str = DEFAULT
    not_found: Probability | None = None
    limits: tuple[str, ...] = ()
    driving: Driving | str = ""
    played: Statement | None = None
    measuring: tuple[FloatArray, Outcomes] | None = None

    @property
    def lost(self) -> bool:
        """Whether it ended since all its draws ended with errors."""
        return not len(self.history.theta) and _all_errors([self.episodes.outcomes])

    @property
    def failure(self) -> str:
        """Word for a failure: a collision, where no limits make others."""
        return "failure" if self.limits else "collision"

    @property
    def fails(self) -> str:
        """Word for what the system does in a failure."""
        return "fails" if self.limits else "collides"

    @property
    def measure(self) -> FailingDraws | None:
        """Draws by which failures and their parts have a probability; None where the unguided draws
        are these."""
        estimate = self.estimate
        stable = estimate is not None and estimate.probabilities[FAILURE].stable
        return estimate.failing if estimate is not None and stable else None

    @property
    def stated(self) -> str:
        """Sentence about failures that the search has not found, of the same draws as the
        probability of all."""
        if self.not_found is None or self.measure is None:
            if self.played is None or not self.statement.draws:
                return str(self.statement)
            return f"{self.statement}; {self.played.in_arrays}"
        low, high = self.not_found.interval
        found = f"{self.not_found.value:.1e} ({low:.1e} to {high:.1e})"
        found = f"of {found}" if self.not_found.value > 0.0 else f"below {high:.1e}"
        return (
            f"failures that the search has not found have a probability {found}, by the "
            f"{many(self.measure.draws, 'weighted draw')} of the estimate (95 %)"
        )


def generate(
    scenario: Path,
    recorded: Callable[[Space], Recorded],
    out: Path,
    settings: SearchSettings,
    progress: Callable[[int], None] = lambda runs: None,
    found: FloatArray | None = None,
    interim: Callable[[Generated], object] = lambda generated: None,
    drawing: Callable[[int], Callable[[int], object]] = lambda needed: lambda draws: None,
    clock: SearchClock | None = None,
    forecast: Callable[[float, float], object] = lambda least, most: None,
) -> Generated:
    """Search a logical scenario for edge cases and write them.

    Runs are kept in the folder as they come: after an interruption the same call goes on where it
    was, and one with another budget, seed or method extends the search. Edge cases are chosen from
    all runs that are kept; files of a search before that no user has changed are replaced. Draws of
    the density and runs of an estimate are among those that cases are chosen from.

    A quarter of the budget are unguided draws of the density, which no method sees: they bound the
    probability of failures that the search did not find. The method spends the rest, with the runs
    of judges that say which failures a careful driver prevents.

    Args:
        scenario: the file.
        recorded: gives the recorded parameters of a space.
        out: folder for the files.
        settings: what to search for.
        progress: called with the number of runs after each batch of them.
        found: critical points (m, d) of earlier searches of the same space: this one starts from
            them, where its method starts from scenarios at all, and none of its cases is much like
            one of them.
        interim: called with what was found and written so far, after each `settings.every` runs.
        drawing: called with the number of draws that `settings.until` needs; gives what is called
            with the number of those made, after each block of them.
        clock: of all phases; one that starts now, with the minutes of the settings, where it is
            None.
        forecast: called with the seconds that runs take after the draws, least and most.

    Raises:
        UsageError: a setting is wrong, the method searches no manoeuvres, too few recorded ones are
            inside the box, or something is in the way in the folder.
        Unsupported: `settings.until` is given, and the scenario does not play in arrays.
        InvalidFile: the scenario is malformed.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> from generation.search.variations import asked_of
        >>> from generation.search.settings import Ask
        >>> asked = asked_of(Ask(density="uniform"), Path("xosc/library/cut_in_highway.xosc"))
        >>> run = xt.RunSettings(sut="cas", world="kinematic", timestep=0.1)
        >>> settings = xt.SearchSettings(run, budget=40, density="uniform", processes=1)
        >>> found = xt.search(asked.scenario, asked.recorded, Path("found"), settings)
        >>> found.statement.draws, len(found.history.theta)
        (20, 20)
    """
    clock = SearchClock(settings.minutes) if clock is None else clock
    search = method(settings.method)  # refuse an unknown name before recordings are read
    judges_of(settings.judges, settings.domain)
    clock.begin(settings.estimate + (settings.until is not None))
    clock.phase("reading what is recorded")
    asked = _Asked.of(scenario, recorded, settings)
    with alone(out, "a search"), evaluator_of(scenario, asked.space, settings) as evaluator:
        work = _Work(asked, out, clock, evaluator, progress, found, interim, drawing)
        if work.lost:  # whatever is sought would end with the same errors
            return work.made(work.course.history, ended=False)
        forecast(*work.forecast)
        try:
            history = work.search(search)
        except TimeOver:
            return work.made(work.course.history, cut=True)
        return work.made(history, cut=len(work.unseen.theta) < drawn_of(settings.budget))


def write_draws(
    scenario: Path,
    recorded: Callable[[Space], Recorded],
    out: Path,
    settings: SearchSettings,
    count: int,
) -> tuple[Path, str]:
    """Write draws of the density that a search would use as a table, without a run: all parameters,
    pinned ones too, and the logarithm of the density in their units; the file, and the density's
    name. Arguments as in `generate`.

    Raises:
        UsageError: as of `generate`; or the file is there already, without `settings.overwrite`.
        NotWritten: it can't be written.
    """
    asked = _Asked.of(scenario, recorded, settings)
    path = out / f"{scenario.stem}_draws.csv"
    if path.exists() and not settings.overwrite:
        raise UsageError("this file is there already: --overwrite replaces it", path=path)
    # By the search's own generator: the first draws are those that it starts with.
    theta = _sampled(asked, count)
    sets, densities = asked.space.sets(theta), asked.prior.log_density(theta).tolist()
    table = StringIO(newline="")
    rows = csv.DictWriter(table, [*{**asked.space.pinned, **sets[0]}, _LOG_DENSITY])
    rows.writeheader()
    for values, density in zip(sets, densities, strict=True):
        rows.writerow({**asked.space.pinned, **values, _LOG_DENSITY: repr(density)})
    with writing("the table of draws", path):
        keep(table.getvalue().encode(), path)
    if len(asked.source.marginals) == len(asked.space.names):
        return path, "limits and densities as stated"
    return (
        path,
        f"density {settings.density} of {many(len(asked.real.theta), 'recorded manoeuvre')}",
    )


_LOG_DENSITY = "log_density"
"""Column of `write_draws`"""


def _sampled(asked: _Asked, count: int) -> FloatArray:
    """Unguided draws (n, d) of the density."""
    generator = np.random.default_rng([asked.settings.seed, len(asked.space.names)])
    return asked.prior.sample(count, generator)


class _Asked(NamedTuple):
    """Question of a search: what is searched, and what is likely in it.

    Attributes:
        space: the box of parameters. source: what is recorded of them. real: the part of it inside
            the box.
        reward: keeps a search to traffic. prior: what traffic does. domain: operational domain.
    """

    scenario: Path
    settings: SearchSettings
    space: Space
    source: Recorded
    real: Recorded
    reward: Reward
    prior: Prior
    domain: Domain

    @classmethod
    def of(
        cls, scenario: Path, recorded: Callable[[Space], Recorded], settings: SearchSettings
    ) -> _Asked:
        """Read the scenario and the recordings."""
        space = space_of(scenario, settings)
        if settings.until is not None:  # say so before the budget is spent
            if settings.plays == 0:
                raise UsageError("--until draws in arrays: it can't go with --plays 0")
            # Made for its refusal alone, before hours are spent on a budget that --until can't
            # follow.
            ArrayPlays(scenario, space, settings.run, settings.rss)
        source = recorded(space)
        real = source.within(space)
        reward = _reward(real, settings, scenario)
        prior = source.prior(space, settings.density)
        domain = domain_of(scenario, space, source, settings)
        prior = prior.within(partial(domain.holds, space) if domain else None)
        return cls(scenario, settings, space, source, real, reward, prior, domain)


class _Work:
    """A search under way: draws, gate and search by `search`, the rest by `made`.

    Args:
        asked: the question. out: folder for the files. clock: of all phases.
        evaluator: runs points. The others are those of `generate`.

    Attributes:
        unseen: unguided draws, which no method sees.
        course: runs of the method so far.
    """

    def __init__(
        self,
        asked: _Asked,
        out: Path,
        clock: SearchClock,
        evaluator: Evaluator,
        progress: Callable[[int], None],
        found: FloatArray | None,
        interim: Callable[[Generated], object],
        drawing: Callable[[int], Callable[[int], object]],
    ) -> None:
        self._asked, self._out, self._clock, self._evaluator = asked, out, clock, evaluator
        self._found, self._interim, self._drawing = found, interim, drawing
        self._progress = progress
        scenario, space, settings = asked.scenario, asked.space, asked.settings
        # Four files: what each run was made for decides what it may bound. A guided run is no draw.
        self._runs, self._draws, self._more, self._refuting = (
            Memory(evaluator, _runs_file(scenario, space, out, settings, kind))
            for kind in ("runs", "draws", "estimate", "until")
        )
        self._drivers = _drivers(scenario, space, out, settings, evaluator)
        self._seeded = remembering(lambda theta, seed: evaluator(theta, seed=int(seed)))
        clock.phase(DRAWS)
        begun = time.monotonic()
        self.unseen = self._drawn()
        self._per_run = (time.monotonic() - begun) / max(evaluator.calls, 1)
        self._per_run *= evaluator.calls >= _TIMED
        clock.phase("measuring the density by replays and draws")
        self._plays = _plays(scenario, space, settings)
        timed = (
            None
            if self._plays is None
            else TimedPlays(
                self._plays,
                clock,
                PLAYED * settings.processes,
                _most_plays(self._plays, settings) / 2,
            )
        )
        self._gate, self._measuring = _gate(asked, self.unseen, out, self._plays, timed, clock)
        self._screen, self._measured = timed, timed.played if timed is not None else 0
        judges = clock.limited(counted_drivers(self._drivers, progress))
        self._judges = judges_of(settings.judges, settings.domain)
        # Plays give the verdicts of judges as well; without them judges have to run.
        self._judging = None if timed is not None else Judging(space, judges, self._judges)
        self.course = _Course(
            counted(self._runs, progress),
            asked.reward,
            self.unseen,
            settings,
            clock,
            self._shown,
        )
        self._problem = SearchProblem(
            space, self.course, asked.reward, asked.real.theta, found, asked.prior, timed,
            self._judging, room=timed.within if timed is not None else unlimited,
            judges=self._judges,
        )  # fmt: skip

    def search(self, method: Search) -> History:
        """Spend the rest of the budget.

        Raises:
            TimeOver: the time was over before; `course` has what was run.
        """
        settings = self._asked.settings
        self._clock.phase(_SEARCH)
        self._clock.grant()
        return method(self._problem, settings.budget - drawn_of(settings.budget), settings.seed)

    def _shown(self, history: History) -> None:
        """Hand over what was found so far."""
        self._interim(self.made(history, False))
        self._clock.phase(_SEARCH)

    @property
    def forecast(self) -> tuple[float, float]:
        """Seconds that the other runs take, at the rate of the draws: least, most; 0 where too few
        were run to tell.
        """
        settings, per_run = self._asked.settings, self._per_run
        sought = settings.budget - len(self.unseen.theta)
        estimated = min(RUNS, settings.budget) if settings.estimate else 0
        cases = min(settings.choice.most, sought)
        driven = len(self._judges) * (cases + estimated) + (1 + settings.repeat) * cases
        runs = sought + estimated
        # Small plays do not tell how long large ones take: a step costs nearly as much for one.
        return per_run * runs, per_run * (runs + driven)

    @property
    def lost(self) -> bool:
        """Whether all draws ended with errors."""
        return _all_errors([self.unseen.outcomes])

    def _drawn(self) -> Episodes:
        """Unguided draws, as many as there is time for."""
        asked, settings = self._asked, self._asked.settings
        theta = _sampled(asked, drawn_of(settings.budget))
        draw, parts = counted(self._draws, self._progress), list[Outcomes]()
        # In parts: a slow simulator may leave no time for the search itself.
        for part in self._clock.parts(theta, _DRAWN_UNTIL):
            parts.append(draw(part))
            if _all_errors(parts):
                break
        outcomes = joined(parts)
        theta = theta[: len(outcomes)]
        return Episodes(theta, outcomes, asked.reward(theta, outcomes))

    def made(self, history: History, ended: bool = True, cut: bool = False) -> Generated:
        """Estimate the rate of failures, choose edge cases among all runs that are kept, and write
        them.

        Args:
            history: runs of the method so far.
            ended: whether it has ended. cut: whether its time was over before.
        """
        asked, settings, runs, draws = self._asked, self._asked.settings, self._runs, self._draws
        reward, space = asked.reward, asked.space
        sought, drawings = runs.episodes(reward), draws.episodes(reward)
        every = Episodes.joined([sought, drawings])
        plays = self._screen.played - self._measured if self._screen is not None else 0
        # Only at the end: an interim result has no use for it, and its runs are the dearest.
        rate = self._rate(every) if settings.estimate and ended else None
        unestimated = settings.estimate and ended and rate is None
        estimates = self._more.episodes(reward)
        bound = self._bound(every) if ended else None
        against = self._refuting.episodes(reward)
        every = Episodes.joined([every, estimates, against])
        self._clock.phase("edge cases, and what careful drivers make of them")
        # After estimate and bound, whose runs may fail too and are cases like others.
        cases, files = self._written(every, rate, cut or settings.estimate)
        statement = _statement(
            space, runs.episodes(reward), self.unseen.theta, self.unseen.outcomes
        )
        played = None
        if self._measuring is not None:
            played = _statement(space, runs.episodes(reward), *self._measuring)
        generated = Generated(
            space, asked.real, asked.prior, history, every, cases, files, self._gate, runs.reused,
            rate,
            runs.damaged + draws.damaged + self._more.damaged, statement=statement,
            plays=plays,
            draws=self.unseen,
            domain=asked.domain, cut=cut, unestimated=unestimated,
            judged=NOT_JUDGED if self._judging is None else self._judging.counts,
            bound=bound, density=settings.density, guidance=self._problem.guidance,
            not_found=_not_found(space, runs.episodes(reward), rate), limits=settings.run.fail_if,
            driving=driving(asked.source, space, asked.prior), played=played,
            measuring=self._measuring,
        )  # fmt: skip
        write_object(
            summary(asked.scenario, generated, settings), self._out / summary_file(asked.scenario)
        )
        parts = {"sought": sought, "drawn": drawings, "estimate": estimates, "until": against}
        write_episodes(space, parts, self._out)
        return generated

    def _rate(self, every: Episodes) -> Estimate | None:
        """Estimate the failure rate by runs of its own, fewer where time is limited; None where no
        run or draw has a verdict.
        """
        settings, clock = self._asked.settings, self._clock
        clock.phase("estimate", own=True)
        allowed, ran = None, self.unseen.outcomes.executed
        if clock.finite:
            if not ran.any():
                return None
            room = self._screen.within if self._screen is not None else unlimited
            theta, outcomes = self.unseen.theta[ran], self.unseen.outcomes.take(ran)
            allowed = Allowance(lambda: clock.over, room, theta, outcomes)
        return _estimate(
            self._problem, self._asked.source, self._more, self._drivers, every, settings, allowed
        )

    def _bound(self, every: Episodes) -> DrawnBound | None:
        """Draw until the bound holds that `settings.until` asks for; None where
        it asks for none.
        """
        asked, until = self._asked, self._asked.settings.until
        if until is None or self._plays is None:
            return None
        self._clock.phase("draws for the bound", own=True)
        failed = every.theta[every.outcomes.executed & every.outcomes.collision]
        return draws_until(
            until, asked.space, asked.prior, self._plays, self._refuting, failed,
            asked.settings.seed, lambda: self._clock.over,
            self._drawing(draws_needed(until)),
        )  # fmt: skip

    def _written(
        self, every: Episodes, rate: Estimate | None, cut: bool
    ) -> tuple[Cases, list[Path]]:
        """Edge cases of all runs, and the files of these."""
        asked, settings = self._asked, self._asked.settings
        most = self._clock.most(settings.choice.most, self._evaluator.calls, cut, settings.repeat)
        choice = replace(settings.choice, most=most)
        # A refused density calls nothing foreseeable: without a judge of it there are no edge
        # cases.
        judged = asked.prior.judged if self._gate.refusal is None else asked.prior.unjudged
        cases = choose(
            asked.space,
            every,
            judged,
            self._drivers,
            choice,
            self._found,
            self._plays,
            self._judges,
        )
        cases = replace(cases, repeats=self._repeated(cases.theta[cases.outcomes.collision]))
        density = asked.reward.realism.density
        calls = len(every.theta)
        files = _write(
            asked.scenario, asked.space, self._out, settings, cases, density, rate, calls
        )
        return cases, files

    def _repeated(self, theta: FloatArray) -> Repeats:
        """Run failures (n, d) again."""
        settings = self._asked.settings

        def run(seed: int) -> tuple[BoolArray, BoolArray]:
            outcomes = self._seeded(theta, str(seed))
            return outcomes.executed, outcomes.collision

        return Repeats.of(len(theta), run, settings.run.seed, settings.repeat)


class _Course:
    """Runs of a search: ends it when its time is over, and hands over what it
    has found after each so many runs.

    Args:
        evaluate: runs points. reward: of the problem. before: runs that the budget was spent on
            before.
        interim: called with the history so far.
    """

    def __init__(
        self,
        evaluate: Evaluate,
        reward: Reward,
        before: Episodes,
        settings: SearchSettings,
        clock: SearchClock,
        interim: Callable[[History], object],
    ) -> None:
        self._clock = clock
        self._evaluate, self._reward, self._interim, self._every = (
            evaluate,
            reward,
            interim,
            settings.every,
        )
        self._runs, self._budget, self._parts = (
            len(before.theta),
            settings.budget,
            [before.first(0)],
        )

    def __call__(self, theta: FloatArray) -> Outcomes:
        """Outcomes of points (n, d).

        Raises:
            TimeOver: the time is over.
        """
        self._clock.check()
        outcomes, before = self._evaluate(theta), self._runs
        self._runs += len(theta)
        self._parts.append(Episodes(theta, outcomes, self._reward(theta, outcomes)))
        if (
            self._every is not None
            and self._runs < self._budget
            # A batch of runs may step over several multiples at once, and seldom ends on one.
            and self._runs // self._every > before // self._every
        ):
            self._interim(self.history)
        return outcomes

    @property
    def history(self) -> History:
        """All runs so far."""
        return History(*Episodes.joined(self._parts))


_LOST = 20
"""Draws that all end with errors after which a search ends"""


def _all_errors(parts: Sequence[Outcomes]) -> bool:
    outcomes = joined(parts)
    # A few errors may be of single points; so many without one run are of the scenario or the
    # system.
    return len(outcomes) >= _LOST and bool((outcomes.status == "error").all())


_DRAWN_UNTIL = 0.3
"""Share of the search's time after which nothing more is drawn"""


def domain_of(scenario: Path, space: Space, recorded: Recorded, settings: SearchSettings) -> Domain:
    """The operational domain of a search.

    Raises:
        UsageError: it is none. InvalidFile: a road network is malformed.
    """
    roles = recorded.roles or roles_of((*space.names, *space.pinned))
    return Domain.of(settings.domain, scenario, space, roles, settings.run)


def drawn_of(budget: int) -> int:
    """Number of unguided draws in a budget of runs."""
    least, share = _DRAWN
    # Of small budgets half at most: the least number alone would leave no run for the method.
    return min(max(least, int(share * budget)), budget // 2)


def _gate(
    asked: _Asked,
    unseen: Episodes,
    out: Path,
    plays: ArrayPlays | None,
    timed: TimedPlays | None,
    clock: SearchClock,
) -> tuple[Gate, _Measuring | None]:
    """Measure a density: by plays where these have the verdicts of all unguided
    draws, else by these draws and by runs.

    Recorded units have their own values of what is pinned, and so have the draws that are
    played: where nothing is pinned, these are draws of the search's space, and are returned too.
    """
    scenario, space, recorded, settings = asked.scenario, asked.space, asked.source, asked.settings
    drawn, replays = Share.of(unseen.outcomes), recorded.replays(space)
    if replays is None:
        unrecorded = tuple(name for name in space.names if name in recorded.marginals)
        some = len(unrecorded) < len(space.names)
        return Gate(None, drawn, unrecorded=unrecorded if some else ()), None
    (own, units), generator = replays, np.random.default_rng(0)
    # In any order but the file's: the first units may all be of one recording.
    units = units[generator.permutation(len(units))]
    # Without pinned parameters the units are points of the space itself.
    replaying = plays if own.names == space.names else _plays(scenario, own, settings)
    ran = unseen.outcomes.executed
    if not ran.any():
        return Gate(Share(0, 0), drawn), None  # which is not testable
    try:
        if (
            timed is not None
            and replaying is not None
            and agrees(timed(unseen.theta[ran]), unseen.outcomes.take(ran))
        ):
            return _played_gate(asked, own, units, replaying, generator, clock)
    except TimeOver:
        return Gate(Share(0, 0), drawn), None  # which is not testable
    least, most = _REPLAYED
    with evaluator_of(scenario, own, settings) as evaluator:
        replay = Memory(evaluator, _runs_file(scenario, own, out, settings, "replays"))
        number = min(settings.budget, max(least, min(settings.budget // 10, most)))
        outcomes = joined([replay(part) for part in clock.parts(units[:number], _GATED_UNTIL)])
        replayed, unprevented = replay_shares(units[: len(outcomes)], outcomes, evaluator)
    return Gate(replayed, drawn, unprevented), None


_Measuring = tuple[FloatArray, Outcomes]
"""Draws (n, d) that measured a density, and their outcomes in arrays"""


def _played_gate(
    asked: _Asked,
    own: Space,
    units: FloatArray,
    plays: ArrayPlays,
    generator: np.random.Generator,
    clock: SearchClock,
) -> tuple[Gate, _Measuring | None]:
    """Measure a density by plays of recorded units (n, d) in a space of their own, and of draws, as
    many as a share of the time allows.

    Raises:
        TimeOver: the time was over before the first one.
    """
    settings = asked.settings
    number = int(min(_PLAYED * settings.budget, _MOST_PLAYED, _most_plays(plays, settings) / 4))
    units = units[:number]
    # In the units' own space: pinned values would set draws and recordings apart.
    draws = asked.source.prior(own, settings.density).sample(number, generator)
    timed, until = TimedPlays(plays, clock, 2 * number), clock.left * (1.0 - _GATED)
    replayed, drawn = list[Outcomes](), list[Outcomes]()
    done, block = 0, number if settings.minutes is None else _GATED_FIRST
    while True:
        rows = units[done : done + block]
        # At once: a step of a play costs hardly more for twice as many points.
        both = timed(np.concatenate([rows, draws[done : done + block]]))
        replayed.append(both.take(np.arange(len(rows))))
        drawn.append(both.take(np.arange(len(rows), len(both))))
        done += block
        left = clock.left
        if done >= number or left <= until:
            break
        block = int(min(timed.within(1.0 - until / left) / 2, number - done))
        if block < _GATED_FIRST:
            break
    outcomes = joined(replayed)
    share, unprevented = replay_shares(units[: len(outcomes)], outcomes, plays)
    found = joined(drawn)
    gate, draws = Gate(share, Share.of(found), unprevented, True), draws[: len(found)]
    # Draws of another space bound nothing in that of the search.
    if own.names != asked.space.names or own.pinned != asked.space.pinned:
        return gate, None
    # Outside of the domain nothing is foreseeable, and no draw of the search is.
    inside = asked.domain.holds(asked.space, draws)
    return gate, (draws[inside], found.take(inside))


def _statement(space: Space, sought: Episodes, unguided: FloatArray, drawn: Outcomes) -> Statement:
    """The bound that draws (n, d) with these outcomes set on failures unlike
    those of the search.
    """
    return Statement.of(drawn, _unlike(space, sought, unguided))


def _not_found(space: Space, sought: Episodes, estimate: Estimate | None) -> Probability | None:
    """Probability of failures unlike those of the search, by an estimate that is stable."""
    if estimate is None or estimate.failing is None or not estimate.probabilities[FAILURE].stable:
        return None
    part = estimate.failing.part(partial(_unlike, space, sought))
    return part.within(estimate.probabilities[FAILURE])


def _unlike(space: Space, sought: Episodes, theta: FloatArray) -> BoolArray:
    """Points (n, d) that are far from each failure of a search (n,)."""
    failures = sought.theta[sought.outcomes.executed & sought.outcomes.collision]
    if not len(failures):
        return np.ones(len(theta), bool)
    columns = distinctive(space)
    return apart(space.unit(theta)[:, columns], space.unit(failures)[:, columns], NEAR)


def summary_file(scenario: Path) -> str:
    """Name of the file, in a search's folder, that tells runs, draws and plays
    apart and states the bound.
    """
    return f"{scenario.stem}_search.json"


def summary(scenario: Path, made: Generated, settings: SearchSettings) -> dict[str, Any]:
    """Numbers of a search for programs: its system, runs by kind with their
    failures, the bound on failures not found.
    """
    sought, drawn = made.history.outcomes, made.statement
    return {
        "scenario": scenario.name,
        "file": scenario.as_posix(),
        "pinned": dict(made.space.pinned),
        "sut": system_name(settings.run.sut),
        "system": system_digest(scenario, settings.run),
        "method": settings.method,
        "seed": settings.seed,
        "budget": settings.budget,
        "draws": {"runs": drawn.draws, "failures": drawn.failing},
        "sought": {
            "runs": int(sought.executed.sum()),
            "failures": int((sought.executed & sought.collision).sum()),
        },
        "plays": made.plays,
        "judges": made.judged._asdict(),
        "guided": asdict(made.guidance),
        "edge_cases": len(made.cases),
        "preventable_by": made.cases.prevented_by(),
        "repeats": None if made.cases.repeats is None else made.cases.repeats.as_json(),
        "statement": made.statement.as_json(),
        "played": None if made.played is None else made.played.as_json(),
        "not_found": None if made.not_found is None else made.not_found.as_json(),
        "until": None if made.bound is None else made.bound.as_json(),
        "limits": list(made.limits),
        "domain": {name: list(limits) for name, limits in made.domain.limits.items()},
    }


def system_digest(scenario: Path, run: RunSettings) -> str:
    """Digest of a system under test: its name and parameters, and the code of a plug-in.

    Raises:
        UsageError: there is no such system.
    """
    return digest(repr(inputs(scenario, run)["system"]).encode())


def _estimate(
    problem: SearchProblem,
    recorded: Recorded,
    run: Evaluate,
    drivers: Drivers,
    episodes: Episodes,
    settings: SearchSettings,
    allowed: Allowance | None,
) -> Estimate:
    """Estimate the failure rate of the system."""
    assert problem.prior is not None
    known = Known.of(episodes.theta, episodes.outcomes)
    chosen = EstimateSettings(
        min(RUNS, settings.budget),
        settings.seed,
        judges=judges_of(settings.judges, settings.domain),
    )
    found = estimate(problem.prior, run, drivers, known, problem.plays, chosen, allowed)
    return found._replace(driving=driving(recorded, problem.space, problem.prior))


def estimate_file(scenario: Path) -> str:
    """Name of the file, in a search's folder, that says how often the system fails."""
    return f"{scenario.stem}_estimate.json"


def _reward(real: Recorded, settings: SearchSettings, scenario: Path) -> Reward:
    """The reward of a search, with realism by the density of recorded parameters."""
    if len(real.theta) < LEAST:
        reason = (
            f"{len(real.theta)} recorded manoeuvres are inside the limits of its parameters, at "
            f"least {LEAST} are needed: more recordings, or --density uniform, which needs none"
        )
        raise UsageError(reason, path=scenario)
    name = DEFAULT if settings.density == UNIFORM else settings.density
    realism = Realism.fitted(name, real.theta, real.recordings)
    return Reward(realism) if settings.weight is None else Reward(realism, settings.weight)


def _runs_file(
    scenario: Path, space: Space, out: Path, settings: SearchSettings, kind: str
) -> Path:
    """The file of the runs of a kind, another one for everything that decides what a run gives."""
    given = inputs(scenario, settings.run, space.pinned, (*OURS, "generation.search.outcomes"))
    # Not seed, method or budget: a search with others goes on with the same runs.
    deciding = (given, settings.rss, space.names, sorted(space.pinned.items()))
    return out / f"{scenario.stem}_{kind}_{digest(repr(deciding).encode())}.jsonl"


def _drivers(
    scenario: Path, space: Space, out: Path, settings: SearchSettings, evaluator: Evaluator
) -> Drivers:
    """Reference drivers; what judges drive is kept in the folder, as the runs are."""

    def kept(judge: str) -> Memory:
        # Runs of a judge are as good for every system under test.
        own = replace(settings, run=replace(settings.run, sut=judge))
        path = _runs_file(scenario, space, out, own, f"judge_{judge}")
        return Memory(partial(evaluator, sut=judge), path)

    judges = {judge: kept(judge) for judge in judges_of(settings.judges, settings.domain)}
    return remembering(
        lambda theta, sut: judges[sut](theta) if sut in judges else evaluator(theta, sut)
    )


def _plays(scenario: Path, space: Space, settings: SearchSettings) -> ArrayPlays | None:
    """Plays of a scenario in arrays; None where it, its system or a setting does not play so."""
    if settings.plays == 0:
        return None
    with suppress(Unsupported):
        return ArrayPlays(scenario, space, settings.run, settings.rss, processes=settings.processes)
    return None


def _most_plays(plays: ArrayPlays, settings: SearchSettings) -> float:
    """Plays of a search, about: half of them measure the density, half choose runs."""
    if settings.plays is not None:
        return settings.plays
    return math.inf if plays.together else _ONE_BY_ONE * settings.budget


def space_of(scenario: Path, settings: SearchSettings) -> Space:
    """The space of a search.

    Raises:
        UsageError, Unsupported: the scenario can't be searched. InvalidFile: it is malformed.
    """
    return Space.of(scenario, settings)


def evaluator_of(scenario: Path, space: Space, settings: SearchSettings) -> Evaluator:
    """Return the evaluator of a search's points.

    Raises:
        UsageError: a setting is wrong, or there is no such cluster.
    """
    return Evaluator(
        scenario,
        space,
        run=settings.run,
        rss=settings.rss,
        processes=settings.processes,
        ray=settings.ray,
    )


def evidence(settings: SearchSettings, calls: int) -> Evidence:
    """Return the evidence for all files of a search.

    Args:
        calls: number of runs that its cases are chosen from.
    """
    # Not the budget: a search may end before it, by its time or where nothing new fails.
    run = settings.run
    return Evidence(
        system_name(run.sut),
        settings.method,
        settings.rss,
        settings.seed,
        calls,
        run.timestep,
    )


def _write(
    scenario: Path,
    space: Space,
    out: Path,
    settings: SearchSettings,
    cases: Cases,
    density: Density,
    rate: Estimate | None,
    calls: int,
) -> list[Path]:
    """Write the estimate, and the files of edge cases in the place of those of a search before."""
    if rate is not None:
        # By name: a system may be an object, which JSON has not.
        sut = system_name(settings.run.sut)
        of = {"scenario": scenario.name, "sut": sut, "pinned": dict(space.pinned)}
        write_object({**of, **rate.as_json()}, out / estimate_file(scenario))
    written = Written(out, scenario.stem)
    # Before the new ones: cases that are none any more would stay beside them.
    written.withdraw(settings.overwrite)
    files: list[Path] = []
    if len(cases):
        of_all, writer = (
            evidence(settings, calls),
            Writer(scenario, space, out, settings.run, settings.overwrite),
        )
        files = [writer.cases(cases, of_all), writer.density(density, settings.seed)]
        files += writer.concrete(cases, of_all) if settings.concrete else []
    written.note()
    return files
