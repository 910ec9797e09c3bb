"""Which parameter sets of a variation file are run, how often, and which files the user means."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import ToolchainError, UsageError

if TYPE_CHECKING:
    from xosc.distributions import ParameterSpace

_SPAN = re.compile(r"(\d+)(?:-(\d+))?")
_MOST_REJECTED = 10_000
"""So many draws in a row outside the constraints end a sample."""


@dataclass(frozen=True)
class Selection:
    """What is run of each file: by default every parameter set once.

    Args:
        only: numbers of parameter sets as first and last, from 0; empty for all.
        sample: how many sets are drawn; None for all. Where a file has fewer, it is all of them.
        seed: of the draws, and of the first of repeated runs.
        repeat: how often each set is run, with seeds that count up from `seed`; None for once, with the seed of the settings.
    """

    only: tuple[tuple[int, int], ...] = ()
    sample: int | None = None
    seed: int = 0
    repeat: int | None = None

    def __post_init__(self) -> None:
        if self.only and self.sample is not None:
            raise UsageError("--only and --sample exclude each other")

    @property
    def seeds(self) -> list[int | None]:
        """The seed of each run of a parameter set; None for that of the settings."""
        return [None] if self.repeat is None else [self.seed + number for number in range(self.repeat)]

    def count(self, space: ParameterSpace) -> int:
        """How many runs there are of a space, at most: sets that constraints exclude are counted."""
        sets = space.size if self.sample is None else min(self.sample, space.size)
        if self.only:
            sets = sum(max(0, min(last, space.size - 1) - first + 1) for first, last in self.only)
        return sets * len(self.seeds)

    def sets(self, space: ParameterSpace, enforce_constraints: bool) -> Iterator[tuple[int, dict[str, str]]]:
        """Number and values of each set, in ascending order; those that violate constraints are left out, unless they were
        named.

        Raises:
            UsageError: a number is beyond the last one, or practically nothing in the space keeps the constraints.
        """
        if self.only:
            for index in dict.fromkeys(index for first, last in sorted(self.only) for index in range(first, last + 1)):
                yield index, space.variation(index)[1]
            return
        if self.sample is not None and self.sample < space.size:
            for index in self._drawn(space, enforce_constraints):
                yield index, space.variation(index)[1]
            return
        from xosc.distributions import Variations

        every = Variations(space, enforce_constraints)
        for _, values in every:
            yield every.index, values

    def _drawn(self, space: ParameterSpace, enforce_constraints: bool) -> list[int]:
        """Numbers of different sets; the space, of any size, is not enumerated."""
        assert self.sample is not None
        draws, found, rejected = random.Random(self.seed), set[int](), set[int]()
        tries = 0
        while len(found) < self.sample and len(found) + len(rejected) < space.size and tries < _MOST_REJECTED:
            index = draws.randrange(space.size)
            tries += 1
            if index in found or index in rejected:
                continue
            if enforce_constraints and not space.admits(space.variation(index)[1]):
                rejected.add(index)
            else:
                found.add(index)
                tries = 0
        if not found:
            raise UsageError(f"none of {len(rejected)} samples satisfies the constraints of {space.scenario}")
        return sorted(found)


def spans(text: str) -> tuple[tuple[int, int], ...]:
    """Numbers of parameter sets as first and last, from a text such as `3,7-9`.

    Raises:
        UsageError: it is of another form.
    """
    found = []
    for part in text.split(","):
        match = _SPAN.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first:
            raise UsageError(f"--only {text!r}: numbers of parameter sets are expected, such as 3,7-9")
        found.append((first, last))
    return tuple(found)


def runnable(arguments: Iterable[str]) -> list[Path]:
    """The files that are meant by names of files, folders and globs; of folders and globs only what can be run.

    Raises:
        UsageError: a folder or glob stands for nothing that can be run.
    """
    from schemas.commands.files import expand

    found: dict[Path, None] = {}
    for argument in arguments:
        files = expand([argument])
        alone = files == [Path(argument)]
        meant = files if alone else [file for file in files if file.suffix.lower() == ".xosc" and not _is_catalog(file)]
        if not meant:
            raise UsageError("this stands for no scenario or variation file", path=argument)
        found |= dict.fromkeys(meant)
    return list(found)


def _is_catalog(path: Path) -> bool:
    import xosc

    try:
        return xosc.load(path).kind == "catalog"
    except ToolchainError:
        return False  # it is told when it is to be run
