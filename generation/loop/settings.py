"""All that can be chosen of a loop."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from generation.declared import Ask
from generation.outcomes.cases import Choice
from generation.pipeline import SearchSettings
from generation.search.method import DEFAULT as METHOD
from runner.settings import RunSettings


@dataclass(frozen=True)
class LoopSettings:
    """What a loop does.

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

    def deciding(self) -> dict[str, Any]:
        """Those that decide what is found."""
        own = {name: value for name, value in asdict(self).items() if name not in ("run", "processes", "against")}
        return {name: str(value) for name, value in (self.run.as_json() | own).items()}

    def search(self, number: int) -> SearchSettings:
        """The settings of the searches of a round, whose number counts from 1."""
        seed = self.seed + 1000 * (number - 1)
        return SearchSettings(
            run=self.run, method=self.method, budget=self.budget, seed=seed, processes=self.processes, density=self.ask.density,
            choice=Choice(self.most, violations=True), concrete=True,
        )  # fmt: skip
