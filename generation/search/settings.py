"""Settings of searches and of the loop: the options of `xosc-generate` and
`xosc-loop` have their defaults from here.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from generation.search.methods import DEFAULT as METHOD
from generation.search.methods import offered
from generation.space import SpaceChoice
from generation.space.density.models import JUDGE, UNIFORM, models
from generation.space.density.roles import ROLES
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError, guess
from schemas.common.policy import current
from schemas.common.terminal.options import completed, option, part

_OPTIONS = {"recordings": "recorded", "pinned": "pin", "maps": "map"}
_DECIDE_NOTHING = ("run", "processes", "ask", "against", "overwrite")
"""Options of the command by the attributes of `Ask` that are not called so."""
_METHODS = tuple(offered())


def _offered(name: str) -> str:
    """A wrong name is better known before anything else is asked for."""
    if name not in _METHODS:
        raise UsageError(
            f"there is no search method {name!r}; {guess(name, _METHODS)}methods: "
            f"{', '.join(_METHODS)}"
        )
    return name


def _method() -> Any:
    return option(
        METHOD,
        f"Search method: {', '.join(_METHODS)}.",
        callback=_offered,
        autocompletion=completed(lambda: _METHODS),
    )


def _kinds() -> tuple[str, ...]:
    from recognition.labels.maneuvers.parameters import KINDS

    return KINDS


def _processes() -> Any:
    return option(
        2, "Number of processes.", "--jobs", "-j", parameter="jobs", min=1, metavar="N", shared=True
    )


@dataclass(frozen=True)
class Choice:
    """Choice of the episodes that become files.

    Attributes:
        most: how many.
        apart: least distance of two in the unit cube, root mean square over the parameters that
            tell cases apart.
        violations: whether episodes that violate RSS distances without a failure are cases too,
            after the failures.
    """

    most: int = option(100, "Most edge cases to write.", min=1, metavar="N")
    apart: float = option(
        0.05, "Least distance of two edge cases, as a share of the ranges.", min=0.0
    )
    violations: bool = option(
        False,
        "Write violations of RSS distances as edge cases too, after the failures.",
        "--violations",
    )


@dataclass(frozen=True)
class SearchSettings(SpaceChoice):
    """Settings of a search, with those of `generation.space.SpaceChoice`: parameters to search.

    Attributes:
        run: how scenarios are run, with the system under test; `seed` is that of the search.
        method: name of the search method (`generation.search.methods`).
        budget: simulator calls.
        seed: of the search.
        density: name of the density model (`generation.space.density.models`).
        weight: of realism in the reward; None for the one of `Reward`.
        rss: name of the RSS parameter set.
        processes: how many runs at a time.
        ray: address of a Ray cluster that does the runs, or `local`; None for processes on this
            machine.
        choice: which episodes become files.
        concrete: whether each case becomes a scenario of its own as well.
        estimate: whether to estimate the rate of failures, by `RUNS` more runs, at most the budget.
        judges: reference drivers of which one has to survive a failure that counts as preventable;
            none for `generation.search.outcomes.JUDGES`.
        repeat: runs of each failing edge case with other seeds; with its own seed each is run again
            in any case.
        until: draw in arrays, after the search, until failures that were not found have a
            probability below it, or one stands against it; None for no such draws.
        domain: limits of the operational domain as texts (`generation.search.gate.Domain`).
        minutes: time for all phases; the search ends when .7 of it are over, or .5 with an
            estimate, which ends at .75 (`generation.clock`), whatever is left of the budget; None
            for no limit.
        plays: plays of the system in arrays, about: half of them measure the density, half choose
            runs; 0 for none; None for as many as the budget says, and fewer where the system is
            asked run by run.
        every: runs after which what was found so far is written; None to write once, at the end.
        overwrite: whether files in the way are replaced that no earlier search wrote as they are.

    Example:
        >>> import xosc_toolchain as xt
        >>> settings = xt.SearchSettings(run=xt.RunSettings(sut="adas"), budget=100, seed=1)
        >>> settings.budget, settings.run.sut
        (100, 'adas')
    """

    run: RunSettings = part(
        RunSettings, "timestep", "sut", "max_time", "world", "road_path", "catalog_path"
    )
    method: str = _method()
    budget: int = option(
        3000,
        "Runs of draws and search; plays, judges and --estimate come besides (--minutes "
        "limits all).",
        min=1,
        metavar="N",
    )
    seed: int = option(0, "Seed of the search.", shared=True)
    density: str = JUDGE
    weight: float | None = option(
        None, "Weight of realism in the reward.  [default: the method's]", min=0.0
    )
    rss: str = option("ad-rss", "RSS parameter set: ad-rss, r157.")
    processes: int = _processes()
    ray: str | None = option(
        None,
        "Run on this Ray cluster; 'local' starts one of --jobs processes on this machine.",
        metavar="ADDRESS",
        shared=True,
    )
    choice: Choice = part(Choice)
    concrete: bool = option(
        False, "Write each edge case as a scenario of its own too.", "--concrete"
    )
    estimate: bool = option(
        False,
        "Estimate how often traffic makes it fail: up to 600 more runs.",
        "--estimate",
    )
    judges: Sequence[str] = option(
        (),
        "Driver whose survival makes a failure preventable (repeatable): fsm, aeb, idm, rss, ... "
        "[default: r157-cc, fsm; in --domain r157: r157-cc, r157-reg]",
        "--judge",
        parameter="judge",
        metavar="DRIVER",
        show_default=False,
    )
    repeat: int = option(
        0,
        "Run each failing edge case with N other seeds too: how often its values "
        "fail, with interval.",
        "--repeat",
        min=0,
        metavar="N",
    )
    until: float | None = option(
        None,
        "Then draw in arrays until failures not found are rarer than P, as 1e-5, or "
        "one stands against it.",
        "--until",
        min=1e-9,
        max=0.5,
        metavar="P",
    )
    domain: Sequence[str] = option(
        (),
        "Operational domain of the system: r157 (ego up to 130 km/h), road (its speed limit), "
        "NAME=LOW..HIGH (repeatable).",
        "--domain",
        metavar="LIMIT",
    )
    minutes: float | None = option(
        None,
        "End after about so many minutes, with edge cases and report; the same command goes on.",
        min=0.0,
        metavar="M",
    )
    plays: int | None = option(
        None,
        "Plays in arrays, about, which test the density and choose runs; 0 for none.  "
        "[default: by --budget, fewer where the system has no control_batch]",
        min=0,
        metavar="N",
    )
    every: int | None = option(None, "Write the report after each N runs too.", min=1, metavar="N")
    overwrite: bool = option(
        False, "Replace what is in the way in --out, also files that were edited.", "--overwrite"
    )


@dataclass(frozen=True)
class Ask:
    """Options of searches as texts.

    Attributes:
        recordings: `--recorded`. kind: `--kind`. density: `--density`.
        pinned: `--pin`, by name. free: `--free`. maps: `--map`.
    """

    recordings: Path | None = option(
        None,
        "Recordings, or a table of their units.  [default: our own recordings' units]",
        "--recorded",
        parameter="recorded",
        metavar="PATH",
    )
    kind: str | None = option(
        None,
        "Kind of recorded units: cut_in, cut_out, lane_change, braking, acceleration.",
        autocompletion=completed(_kinds),
    )
    density: str = option(
        JUDGE,
        f"Density of recorded parameters: {', '.join(models())}; or {UNIFORM} within all limits, "
        "without recordings.",
        autocompletion=completed(lambda: [*models(), UNIFORM]),
    )
    pinned: Mapping[str, str] = option(
        {},
        "Keep a parameter at a value (repeatable).",
        "--pin",
        parameter="pin",
        metavar="NAME=VALUE",
    )
    free: Sequence[str] = option(
        (),
        "Search a parameter besides the default ones, or a literal, as 87@value=10..40 "
        "(repeatable).",
        "--free",
        metavar="NAME[=LOW..HIGH]",
    )
    maps: Sequence[str] = option(
        (),
        f"What a parameter is in recordings: {', '.join(ROLES)} (repeatable).",
        "--map",
        metavar="NAME=ROLE[*FACTOR]",
    )


@dataclass(frozen=True)
class LoopSettings:
    """Settings of a loop.

    Attributes:
        run: how scenarios are run, with the system under test; `seed` is that of the searches.
        model: folder of the model that recognises; None for the rules alone.
        rounds: how often is searched; each round after the first starts from the failures of those
            before.
        budget: simulator calls of each search: one for each class or scenario and round.
        most: edge cases that each search writes.
        shown: recorded scenarios of each class that can be played on the page.
        sample: parameter sets of each variation file that are run, where it has more; drawn by the
            seed.
        method: of the search.
        seed: of everything random.
        processes: how many runs, or searches of several targets, at a time.
        ask: what to search of the user's own scenarios, and what is likely of it.
        against: output folder of an earlier loop, of another version of the system under test; None
            to compare with none.
        overwrite: whether its searches replace files in the way that no earlier search wrote as
            they are.
    """

    run: RunSettings = part(RunSettings, "sut", "road_path", "catalog_path")
    model: Path | None = None
    rounds: int = option(
        2, "Rounds of search; each starts from failures before it.", min=1, metavar="N"
    )
    budget: int = option(300, "Runs of each search: one a class and round.", min=1, metavar="N")
    most: int = option(6, "Most edge cases that a search writes.", min=1, metavar="N")
    shown: int = option(12, "Recorded scenarios of each class with a replay.", min=1, metavar="N")
    sample: int = option(
        50,
        "Most parameter sets of each variation file, drawn by the seed.",
        min=1,
        metavar="N",
    )
    method: str = _method()
    seed: int = option(0, "Seed of everything random.", shared=True)
    processes: int = _processes()
    ask: Ask = part(Ask)
    against: Path | None = option(
        None,
        "Loop of another version of the system, whose failures are replayed.",
        metavar="DIR",
    )
    overwrite: bool = option(
        False, "Replace what is in the way in --out, also files that were edited.", "--overwrite"
    )

    def deciding(self) -> dict[str, str]:
        """Return the settings that decide the findings, as texts by name; those
        of `ask` by option.
        """
        own = {name: value for name, value in asdict(self).items() if name not in _DECIDE_NOTHING}
        ask = {_OPTIONS.get(name, name): value for name, value in asdict(self.ask).items()}
        return {name: _text(value) for name, value in (self.run.as_json() | own | ask).items()}

    def search(self, number: int) -> SearchSettings:
        """The settings of the searches of a round, whose number counts from 1."""
        # Rounds of one loop draw other points, and those of neighbouring seeds do not repeat each
        # other's.
        seed = self.seed + 1000 * (number - 1)
        return SearchSettings(
            run=self.run, method=self.method, budget=self.budget, seed=seed,
            processes=self.processes, density=self.ask.density,
            choice=Choice(self.most, violations=True), concrete=True, overwrite=self.overwrite,
        )  # fmt: skip


def _text(value: Any) -> str:
    """A setting as it is read: a dash where none is given."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        value = [f"{name}={entry}" for name, entry in value.items()]
    if isinstance(value, list | tuple):
        value = ", ".join(map(str, value))
    return "–" if value is None or value == "" else str(value)


def budget_within_limits(budget: int, more: int, name: str) -> int:
    """Return the runs that a search may spend under `--max-runs`; a reduction is reported on
    standard error.

    Args:
        budget: the runs asked for.
        more: runs that are done besides.
        name: of the command.

    Raises:
        UsageError: `--max-runs` leaves none.
    """
    from schemas.common.terminal.command_line import say

    most = current().max_runs
    if most is None or budget + more <= most:
        return budget
    if most <= more:
        raise UsageError(
            f"--estimate takes up to {more} runs, and the search some: --max-runs {most} is too few"
        )
    say(
        f"{name}: --max-runs {most} leaves {most - more} of {budget} runs to the search",
        to=sys.stderr,
    )
    return most - more


FATES = ("new", "still-there")
"""Fates of failures (`generation.report.regression.Fate`) that `--fail-if` may name"""


def limits_and_fates(texts: Sequence[str] | None) -> tuple[tuple[str, ...], list[str]]:
    """Limits of runs among texts of `--fail-if`, and the other texts.

    Raises:
        UsageError: a limit is none.
    """
    from runner.judging.measures.measure import Limit

    named = [text for text in texts or () if text.strip() in FATES]
    limits = [text for text in texts or () if text not in named]
    try:
        return tuple(Limit.parse(text).text for text in limits), [text.strip() for text in named]
    except UsageError as error:
        raise UsageError(f"{error}; with --against also {' or '.join(FATES)}") from None
