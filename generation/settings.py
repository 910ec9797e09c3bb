"""Settings of searches and of the loop: the options of `xosc-generate` and `xosc-loop` have their defaults from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from generation.density.models import JUDGE
from generation.search.methods import DEFAULT as METHOD
from runner.settings import RunSettings

if TYPE_CHECKING:
    from generation.density.marginals import Marginal

_OPTIONS = {"recordings": "recorded", "pinned": "pin", "maps": "map"}
"""Options of the command by the attributes of `Ask` that are not called so."""


@dataclass(frozen=True)
class Choice:
    """Which episodes become files.

    Attributes:
        most: how many.
        apart: least distance of two in the unit cube, root mean square over the parameters that tell cases apart.
        violations: whether episodes that violate RSS distances without a failure are cases too, after the failures.
    """

    most: int = 100
    apart: float = 0.05
    violations: bool = False


@dataclass(frozen=True)
class SearchSettings:
    """Settings of a search.

    Attributes:
        run: how scenarios are run, with the system under test; `seed` is that of the search.
        method: name of the search method (`generation.search.methods`).
        budget: simulator calls.
        seed: of the search.
        density: name of the density model (`generation.density.models`).
        weight: of realism in the reward; None for the one of `Reward`.
        rss: name of the RSS parameter set.
        processes: how many runs at a time.
        ray: address of a Ray cluster that does the runs, or `local`; None for processes of one's own.
        pinned: values of parameters that are not searched.
        free: names of parameters to search besides the default ones.
        marginals: densities, and ranges, of parameters to search besides.
        default: whether to search what is searched by default; otherwise only what is free or has a range.
        choice: which episodes become files.
        concrete: whether each case becomes a scenario of its own as well.
        estimate: whether to estimate how often the system fails, by `RUNS` more runs, or as many as the budget.
        domain: limits of the operational domain as texts (`generation.density.domain`).
        minutes: time after which the search ends, whatever is left of its budget; None for no limit.
        every: runs after which what was found so far is written; None to write once, at the end.
    """

    run: RunSettings = field(default_factory=RunSettings)
    method: str = METHOD
    budget: int = 3000
    seed: int = 0
    density: str = JUDGE
    weight: float | None = None
    rss: str = "ad-rss"
    processes: int = 2
    ray: str | None = None
    pinned: Mapping[str, str] = field(default_factory=dict)
    free: Sequence[str] = ()
    marginals: Mapping[str, Marginal] = field(default_factory=dict)
    default: bool = True
    choice: Choice = field(default_factory=Choice)
    concrete: bool = False
    estimate: bool = False
    domain: Sequence[str] = ()
    minutes: float | None = None
    every: int | None = None


@dataclass(frozen=True)
class Ask:
    """Options of searches as texts.

    Attributes:
        recordings: `--recorded`. kind: `--kind`. density: `--density`.
        pinned: `--pin`, by name. free: `--free`. maps: `--map`.
    """

    recordings: Path | None = None
    kind: str | None = None
    density: str = JUDGE
    pinned: Mapping[str, str] = field(default_factory=dict)
    free: Sequence[str] = ()
    maps: Sequence[str] = ()


@dataclass(frozen=True)
class LoopSettings:
    """Settings of a loop.

    Attributes:
        run: how scenarios are run, with the system under test; `seed` is that of the searches.
        model: folder of the model that recognises; None for the rules alone.
        rounds: how often is searched; each round after the first starts from the failures of those before.
        budget: simulator calls of each search: one for each class or scenario and round.
        most: edge cases that each search writes.
        shown: recorded scenarios of each class that can be played on the page.
        sample: parameter sets of each variation file that are run, where it has more; drawn by the seed.
        method: of the search.
        seed: of everything random.
        processes: how many runs, or searches of several targets, at a time.
        ask: what to search of the user's own scenarios, and what is likely of it.
        against: output folder of an earlier loop, of another version of the system under test; None to compare with none.
    """

    run: RunSettings = field(default_factory=RunSettings)
    model: Path | None = None
    rounds: int = 2
    budget: int = 300
    most: int = 6
    shown: int = 12
    sample: int = 50
    method: str = METHOD
    seed: int = 0
    processes: int = 2
    ask: Ask = field(default_factory=Ask)
    against: Path | None = None

    def deciding(self) -> dict[str, str]:
        """Return the settings that decide the findings, as texts by name; those of `ask` by option."""
        own = {name: value for name, value in asdict(self).items() if name not in ("run", "processes", "ask", "against")}
        ask = {_OPTIONS.get(name, name): value for name, value in asdict(self.ask).items()}
        return {name: _text(value) for name, value in (self.run.as_json() | own | ask).items()}

    def search(self, number: int) -> SearchSettings:
        """The settings of the searches of a round, whose number counts from 1."""
        seed = self.seed + 1000 * (number - 1)
        return SearchSettings(
            run=self.run, method=self.method, budget=self.budget, seed=seed, processes=self.processes, density=self.ask.density,
            choice=Choice(self.most, violations=True), concrete=True,
        )  # fmt: skip


def _text(value: Any) -> str:
    """A setting as it is read: a dash where none is given."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        value = [f"{name}={each}" for name, each in value.items()]
    if isinstance(value, list | tuple):
        value = ", ".join(map(str, value))
    return "–" if value is None or value == "" else str(value)
