"""A second search with the failures of a first one, and without them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from generation.loop.searches import Failures, failures
from generation.pipeline import generate
from generation.search.settings import SearchSettings
from generation.space.recorded import kind_of, of_recordings, of_samples
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray


class Rounds(NamedTuple):
    """Failures of the first search, of a second one that starts from them, and of a second one that
    does not know them."""

    first: Failures
    fed: Failures
    alone: Failures


def compared(
    scenario: Path,
    recorded: Path | None,
    kind: str | None,
    sut: str,
    budget: int,
    seeds: int,
    processes: int,
) -> Iterator[Rounds]:
    """The rounds of each seed.

    Args:
        scenario: a logical scenario.
        recorded: recordings, or a table of their units; None for our own.
        kind: of the recorded units; None for that of the scenario's name.
        sut: name of the system under test.
        budget: simulator calls of each search.
        seeds: how many.
        processes: how many runs at a time.
    """
    samples = of_recordings(recorded, kind or kind_of(scenario))

    def search(
        seed: int, found: FloatArray | None = None, before: FloatArray | None = None
    ) -> Failures:
        settings = SearchSettings(
            RunSettings(sut=sut), budget=budget, seed=seed, processes=processes
        )
        with TemporaryDirectory() as out:
            made = generate(
                scenario, partial(of_samples, samples), Path(out), settings, found=found
            )
        return failures(made.space, made.history, before)

    for seed in range(seeds):
        first = search(seed)
        yield Rounds(
            first,
            search(seed + 1000, first.theta, first.theta),
            search(seed + 1000, None, first.theta),
        )
