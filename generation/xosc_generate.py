"""The command `xosc-generate`: a logical scenario or a catalogue becomes edge
cases for a system under test.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from generation.report.options import Failing, fates
from generation.search.settings import (
    Ask,
    SearchSettings,
    budget_within_limits,
    limits_and_fates,
)
from schemas.common.errors import ExitCode, InvalidFile, NotWritten, UsageError, exit_codes, gravest
from schemas.common.terminal.command_line import (
    ProgressBar,
    Quiet,
    Verbose,
    Version,
    epilog,
    guarded,
    interruptible,
    new_app,
    out_folder,
    progress_bar,
    protected,
    say,
)
from schemas.common.terminal.files import complete_name, named
from schemas.common.terminal.options import with_settings
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from generation.clock import SearchClock
    from generation.pipeline import Generated
    from generation.report.regression import Fate
    from generation.space.recorded import Recorded as Units
    from generation.space.recorded import RecordedScenario
    from generation.space.space import Space

NAME = "xosc-generate"
_LISTED = 3
"""Files that are named on the screen"""
_EXAMPLES = ("xosc-generate cut_in_highway --budget 60 --out edge_cases",)
_EPILOG = exit_codes(
    "edge cases are written",
    "there is none (with --against: 0 no failure is new, 1 one is)",
    "no run tested what its file describes, or a failure never came again",
)

app = new_app()


class Search(NamedTuple):
    """A scenario to search, what gives the recorded parameters of its space, the folder for its
    files, the settings, and the folder of another version's search."""

    scenario: Path
    recorded: Callable[[Space], Units]
    out: Path
    settings: SearchSettings
    against: Path | None


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected()
@with_settings
def xosc_generate(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SCENARIO_OR_CATALOGUE",
            autocompletion=complete_name,
            help="A scenario, variation file or name; a folder of a catalogue or one class.",
        ),
    ],
    out: Annotated[
        Path,
        out_folder(
            "Folder for the files; those of an earlier call are replaced unless they were edited."
        ),
    ],
    settings: SearchSettings,
    ask: Ask,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Search of another version of the system, whose failures are replayed.",
        ),
    ] = None,
    fail_if: Failing = None,
    draw: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Write N draws of the density as a table (CSV), and run nothing.",
        ),
    ] = None,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Search for edge cases of a logical scenario: collisions that traffic may
    cause and a careful driver prevents.

    Writes a variation file with the values of each case and OpenLABEL tags that tell the evidence,
    the density of recorded parameters as a stochastic variation file, copies of all that they need
    to run, and report.html, a page about all of it.

    A quarter of the budget are unguided draws of the density. They bound the probability of
    failures that the search did not find, so that a search without a finding is a result too.

    --against compares with a search of another version of the system: its failures are replayed,
    and are fixed or still there; failures found now that are unlike them are played with the former
    version, and are new where it survives.

    --fail-if searches failures by limits of measures too: the distance to a limit leads to them.
    """
    source = named(source)
    from generation.clock import SearchClock
    from generation.estimation.estimate import RUNS
    from generation.search.problem import method as search_of

    if draw is not None and (against is not None or settings.estimate or settings.until):
        raise UsageError("--draw runs nothing: without --against, --estimate and --until")
    search_of(settings.method)  # what it needs is better asked for before recordings are read
    budget = budget_within_limits(settings.budget, RUNS if settings.estimate else 0, NAME)
    settings = replace(settings, budget=budget, density=ask.density)
    limits, others = limits_and_fates(fail_if)
    settings = replace(settings, run=replace(settings.run, fail_if=limits))
    wanted = fates(others, against) if others or against else ()
    # What was spent until here counts: loading alone takes seconds.
    clock = SearchClock(settings.minutes, time.process_time())
    with interruptible(NAME, f"the same command goes on with the runs in {out}"):
        searches = list(_searches(source, ask, out, settings, against))
        if draw is not None:
            for search in searches:
                _drawn(search, draw, quiet)
            raise typer.Exit(ExitCode.PASSED)
        found = [
            _found(search, wanted, quiet, source.is_dir(), partial(clock.shared, left))
            for left, search in zip(range(len(searches), 0, -1), searches, strict=True)
        ]
    raise typer.Exit(
        gravest(found) if against is not None or ExitCode.PASSED not in found else ExitCode.PASSED
    )


def _searches(
    source: Path, ask: Ask, out: Path, settings: SearchSettings, against: Path | None
) -> Iterator[Search]:
    from generation.search.variations import asked_of, freed, with_literals
    from generation.space.recorded import folders_of, not_searched, of_catalogue

    if not source.exists():
        raise InvalidFile("no such file or folder", path=source)
    if not source.is_dir():
        ask, path = with_literals(ask, source, out / "source", settings.overwrite)
        asked = asked_of(ask, path)
        what = replace(settings, **vars(asked.choice))
        yield Search(asked.scenario, asked.recorded, out, what, against)
        return
    if ask.recordings is not None or ask.kind is not None or ask.maps:
        raise UsageError(
            "a catalogue brings its recorded parameters along: --recorded, --kind, --map are for "
            "single scenarios"
        )
    catalogue = list(of_catalogue(source, alone=bool(settings.run.fail_if)))
    searched = {scenario.path.parent for scenario in catalogue}
    left = {path: not_searched(path) for path in folders_of(source) if path not in searched}
    for path, reason in left.items():
        if reason:
            say(f"{NAME}: {path}: nothing is searched: {reason}", to=sys.stderr)
    if not catalogue:
        if not any(left.values()):
            raise UsageError(
                "no scenario with parameters to search is in this folder or those in it",
                path=source,
            )
        raise typer.Exit(ExitCode.FINDING)
    free, ranges = freed(ask.free)
    if ranges:
        raise UsageError(
            f"--free {next(iter(ranges))}=LOW..HIGH is for single scenarios: a catalogue has "
            "recorded values, within the limits that its scenarios declare; --free NAME searches "
            "a parameter by these"
        )
    for scenario in catalogue:
        what, name = replace(settings, pinned=ask.pinned, free=free), scenario.path.parent.name
        yield Search(
            scenario.path,
            partial(_own_or_shipped, scenario),
            out / name,
            what,
            against / name if against is not None else None,
        )


def _own_or_shipped(scenario: RecordedScenario, space: Space) -> Units:
    """Recorded units of a catalogue, or the shipped ones in the place of too few."""
    from generation.pipeline import LEAST
    from generation.space.recorded import shipped_instead

    instead = shipped_instead(scenario, space, LEAST)
    if instead is None:
        return scenario.on(space)
    count = len(scenario.on(space).within(space).theta)
    what = (
        f"{count} of its class are recorded, {LEAST} of two recordings make a density: that of "
        "the shipped units counts"
    )
    say(f"{NAME}: {scenario.path.name}: {what}", to=sys.stderr)
    return instead


def _likely(search: Search, space: Space) -> Units:
    """Recorded units, or draws from the limits where shipped units have nothing inside them."""
    from generation.space.recorded import stated_instead

    found = search.recorded(space)
    instead = stated_instead(found, space, search.settings.density)
    if instead is None:
        return found
    what = (
        "the shipped units have nothing inside the limits of its parameters: these are "
        "drawn evenly, and no probability is that of traffic"
    )
    say(f"{NAME}: {search.scenario.name}: {what}", to=sys.stderr)
    return instead


def _drawn(search: Search, count: int, quiet: bool) -> None:
    """Write draws of the density of a scenario."""
    from generation.pipeline import write_draws

    settings = search.settings
    path, density = write_draws(
        search.scenario, partial(_likely, search), search.out, settings, count
    )
    if not quiet:
        drawn = f"{many(count, 'draw')} of the {density}, seed {settings.seed}"
        say(f"{search.scenario.name}: {drawn}, which no run has tested: {path}")


def _found(
    search: Search,
    wanted: Sequence[Fate],
    quiet: bool,
    catalogue: bool,
    clock: Callable[[Callable[[str], object]], SearchClock],
) -> ExitCode:
    """Search one scenario; passed if there are edge cases, or with `--against`,
    if no failure has one of the fates.

    In a catalogue the next one follows where one can't be searched.
    """
    from generation.pipeline import generate
    from generation.report.assurance import Assurance
    from generation.report.regression import Before, Tried, regression
    from generation.report.report import render, write_report

    settings, scenario, compared = search.settings, search.scenario, None
    try:
        before = Before.of(search.against, scenario) if search.against is not None else None
        with progress_bar(scenario.stem, settings.budget, quiet) as progress:
            generated = generate(
                scenario, partial(_likely, search), search.out, settings, progress,
                interim=lambda made: render(scenario, made, settings, search.out),
                drawing=lambda needed: progress.below("draws", needed),
                clock=clock(partial(_entered, search, progress, quiet)),
                forecast=lambda least, most: None if quiet else _forecast(search, least, most),
            )  # fmt: skip
            progress.phase("report")
            if before is not None:
                compared = regression(before, scenario, Tried.of(generated), settings)
            assured = Assurance.of(scenario, generated, settings)
            page = write_report(scenario, generated, settings, search.out, compared, assured)
    except UsageError as error:
        if not catalogue or isinstance(error, NotWritten):
            raise
        say(f"{NAME}: {error}", to=sys.stderr)
        return ExitCode.FINDING
    if not quiet and not generated.lost:
        say(*_report(scenario, generated, settings), *(f"  {line}" for line in assured.lines()))
        if compared is not None:
            say(f"  {compared}")
        say(f"  {page} shows all of it")
    repeats = generated.cases.repeats
    gone = repeats.gone if repeats is not None else 0
    if repeats is not None and (gone or (quiet and repeats.lost)):
        say(f"{NAME}: {scenario.name}: {repeats}", to=sys.stderr)
    outcomes = generated.episodes.outcomes
    lost = len(outcomes) > 0 and not outcomes.executed.any()  # it may have failures
    errors = outcomes.error[outcomes.status == "error"]
    if outcomes.inconclusive.any():
        untested = outcomes.error[outcomes.inconclusive]
        several = f"{many(len(untested), 'run')} inconclusive, the first"
        say(f"{NAME}: {scenario.name}: {several}: {untested[0]}", to=sys.stderr)
    if lost and len(errors):
        after = f"ended after {many(len(errors), 'draw')}: " if generated.lost else ""
        say(
            f"{NAME}: {scenario.name}: {after}no run succeeded, the first error: {errors[0]}",
            to=sys.stderr,
        )
        return ExitCode.INTERNAL
    if lost or (gone and compared is None):
        return ExitCode.INCONCLUSIVE
    done = bool(generated.files) if compared is None else not compared.counts.fails(*wanted)
    return ExitCode.PASSED if done else ExitCode.FINDING


def _entered(search: Search, progress: ProgressBar, quiet: bool, phase: str) -> None:
    """Show a phase; before the first runs, say what the search does."""
    from generation.pipeline import DRAWS

    progress.phase(phase)
    if phase == DRAWS and not quiet:
        say(_begun(search), to=sys.stderr)


def _begun(search: Search) -> str:
    """Say what a search does, in its budget and besides."""
    from generation.estimation.estimate import RUNS
    from generation.pipeline import drawn_of

    settings = search.settings
    draws = drawn_of(settings.budget)
    besides = ["plays in arrays", "careful drivers in its failures"]
    if settings.estimate:
        besides.append(f"up to {min(RUNS, settings.budget)} runs of --estimate and such drivers")
    besides.append(f"{many(1 + settings.repeat, 'run')} of each edge case again")
    if settings.until is not None:
        besides.append("draws of --until")
    limit = "--minutes limits all"
    if settings.minutes is not None:
        limit = f"all of it in about {settings.minutes:g} min"
    return (
        f"{search.scenario.stem}: {many(draws, 'unguided draw')} and up to "
        f"{many(settings.budget - draws, 'run')} of {settings.method}; besides: "
        f"{', '.join(besides)}; {limit}"
    )


_MINUTE = 60.0


def _forecast(search: Search, least: float, most: float) -> None:
    """Say how long the rest takes, where no limit says so."""
    if search.settings.minutes is None and least > _MINUTE / 2.0:
        low, high = (max(round(each / _MINUTE), 1) for each in (least, most))
        span = f"{low} to {high}" if high > low else f"{low}"
        say(
            f"{search.scenario.stem}: about {span} min for the other runs, besides plays",
            to=sys.stderr,
        )


def _report(scenario: Path, generated: Generated, settings: SearchSettings) -> Iterator[str]:
    """Yield the results as lines."""
    from generation.report.report import basis
    from generation.search.gate import Share

    outcomes, cases = generated.history.outcomes, generated.cases
    pinned = ", ".join(f"{name}={value}" for name, value in generated.space.pinned.items())
    yield (
        f"{scenario.name}: {settings.method} against {settings.run.sut}, seed "
        f"{settings.seed}{pinned and f', with {pinned}'}"
    )
    errors, drawn = outcomes.error[outcomes.status == "error"], generated.statement
    if len(errors):
        yield f"  {many(len(errors), 'run')} failed, the first with: {errors[0]}"
    low, high = Share(drawn.failing, drawn.draws).interval
    yield (
        f"  {many(drawn.draws, 'unguided draw')} of the density: "
        f"{many(drawn.failing, generated.failure)} ({low:.2%} to {high:.2%}); {_prior(generated)}"
    )
    chosen = f", chosen by {many(generated.plays, 'play')}" if generated.plays else ""
    yield from _sought(generated, chosen)
    yield from _course(generated, settings)
    if generated.reused:
        yield f"  {generated.reused} of them were kept in the folder from runs before"
    if generated.damaged:
        yield (
            f"  removed {many(generated.damaged, 'damaged record')} of runs before: made anew "
            "where needed"
        )
    yield f"  {generated.gate}"
    if generated.gate.refusal is not None:
        yield f"  so this density is no judge of what is foreseeable: {generated.gate.refusal}"
    yield f"  operational domain: {generated.domain}"
    if generated.limits:
        yield f"  failures are collisions and runs with {' or '.join(generated.limits)}"
    collision = cases.outcomes.collision
    worth = (
        f", {int(collision.sum())} of them foreseeable and preventable {generated.failure}s"
        if len(cases)
        else f": {_nothing(generated)}"
    )
    yield f"  {many(len(cases), 'edge case')}{worth}"
    yield from _chosen(generated, settings)
    if cases.repeats is not None and len(cases.repeats.again):
        yield f"  {cases.repeats}"
    if by := cases.prevented_by():
        yield f"  prevented: {', '.join(f'{count} by {name}' for name, count in by.items())}"
    survived = ", ".join(
        f"{name} {int((collision & outcomes.survived).sum())}"
        for name, outcomes in cases.drivers.items()
    )
    if collision.any():
        yield f"  of these, reference drivers survive: {survived}"
    if cases.agreed:
        judges = ", ".join(cases.judges)
        yield (
            f"  judges were run ({judges}), and all their {cases.agreed} verdicts are those of "
            "plays, in which the other drivers drove"
        )
    yield f"  {generated.stated}"
    if generated.bound is not None:
        yield f"  {generated.bound}"
    yield f"  {basis(generated)}"
    if generated.unestimated:
        yield "  no estimate: no run or draw has a verdict"
    if generated.estimate is not None:
        yield from (f"  {line}" for line in generated.estimate.lines(generated.failure))
    yield from (f"  {path}{_alone(path)}" for path in generated.files[:_LISTED])
    if len(generated.files) > _LISTED:
        yield (
            f"  and {many(len(generated.files) - _LISTED, 'more file')} in "
            f"{generated.files[0].parent}"
        )


def _sought(generated: Generated, chosen: str) -> Iterator[str]:
    """Yield a line on the sought runs, or why there are none."""
    outcomes = generated.history.outcomes
    if len(outcomes):
        collisions, risk = (
            many(int(outcomes.collision.sum()), generated.failure),
            outcomes.r_risk.mean(),
        )
        yield f"  {many(len(outcomes), 'sought run')}{chosen}: {collisions}, mean R_risk {risk:.3f}"
    elif generated.cut:
        yield f"  no sought runs{chosen}: the time was over before"
    else:
        yield (
            f"  no sought runs{chosen}: nothing that is foreseeable and preventable fails in plays"
        )


def _course(generated: Generated, settings: SearchSettings) -> Iterator[str]:
    """Yield lines on the choice of runs, the judges, and an end before the budget."""
    budget, guidance = many(settings.budget, "run"), generated.guidance
    if guidance.guided or guidance.drawn:
        yield f"  {guidance}"
    if generated.judged.judged:
        yield f"  {generated.judged}"
    if generated.cut:
        yield (
            f"  ended by --minutes {settings.minutes:g} before its budget of {budget}: the same "
            "command goes on"
        )
    elif guidance.saturated:
        yield (
            f"  ended before its budget of {budget}: nothing failed for long that is "
            "unlike known failures"
        )


def _alone(path: Path) -> str:
    """Say what the file of a density can't."""
    if not path.name.endswith("_density.xosc"):
        return ""
    return " draws each parameter on its own; --draw N draws them together"


def _chosen(generated: Generated, settings: SearchSettings) -> Iterator[str]:
    """Yield a line on failures that are no edge cases."""
    every, cases = generated.episodes, generated.cases
    failing = every.outcomes.executed & every.outcomes.collision
    left = int(failing.sum()) - int(cases.outcomes.collision.sum())
    if len(cases) and left > 0 and generated.gate.refusal is None:
        foreseeable = int(generated.prior.foreseeable(every.theta[failing]).sum())
        yield (
            f"  of {many(int(failing.sum()), generated.failure)} in all runs {foreseeable} are "
            f"foreseeable; left out: {left}, as not foreseeable, prevented by no careful driver, "
            f"or nearer than {settings.choice.apart:.0%} of the ranges to a case"
        )


def _nothing(generated: Generated) -> str:
    """Reason for which there is no edge case."""
    outcomes = generated.history.outcomes
    colliding, near = outcomes.executed & outcomes.collision, outcomes.clearance[outcomes.executed]
    if not near.size:
        return "no sought run succeeded" if len(outcomes.executed) else "no run was sought"
    if not colliding.any():
        return (
            f"no sought run {generated.fails}; the least distance of the ego to another one is "
            f"{near.min():.2f} m"
        )
    judged = generated.gate.refusal is None
    failures = f"{generated.failure}s"
    foreseeable = (
        generated.prior.foreseeable(generated.history.theta[colliding]).sum() if judged else 0
    )
    return (
        f"{failures}: {colliding.sum()}, foreseeable: {foreseeable}, of these prevented by a "
        "careful driver: 0"
    )


def _prior(generated: Generated) -> str:
    if generated.gate.replayed is None:
        return "prior as stated, independent of recordings in part or in whole"
    return f"prior from {len(generated.recorded.theta)} recorded manoeuvres"


def main() -> None:
    """Entry point of the command."""
    guarded(NAME, app)


if __name__ == "__main__":
    main()
