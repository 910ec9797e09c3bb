"""Which parameter sets of a variation file are run, or exported."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

from schemas.errors import UsageError
from xosc.distributions.space import ParameterSpace, Variations

_SPAN = re.compile(r"(\d+)(?:-(\d+))?")
_MOST_REJECTED = 10_000
"""So many draws in a row outside the constraints end a sample."""


@dataclass(frozen=True)
class Selection:
    """Parameter sets of each variation file: by default every one. A scenario, which is no variation file, is always chosen.

    Args:
        only: numbers of parameter sets as first and last, from 0; empty for all.
        sample: how many sets are drawn; None for all. Where a file has fewer, it is all of them.
        seed: of the draws.

    Raises:
        UsageError: both are given.
    """

    only: tuple[tuple[int, int], ...] = ()
    sample: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.only and self.sample is not None:
            raise UsageError("--only and --sample exclude each other")

    @property
    def chooses(self) -> bool:
        """Whether sets are left out."""
        return bool(self.only) or self.sample is not None

    def count(self, space: ParameterSpace) -> int:
        """How many sets are chosen of a space, at most: those that constraints exclude are counted."""
        if self.only and space.distribution is not None:
            return sum(max(0, min(last, space.size - 1) - first + 1) for first, last in self.only)
        return space.size if self.sample is None else min(self.sample, space.size)

    def sets(self, space: ParameterSpace, enforce_constraints: bool) -> Iterator[tuple[int, dict[str, str]]]:
        """Number and values of each set, in ascending order; those that violate constraints are left out, unless they were
        named.

        Raises:
            UsageError: a number is beyond the last one, or practically nothing in the space keeps the constraints.
        """
        if self.only and space.distribution is not None:
            for index in dict.fromkeys(index for first, last in sorted(self.only) for index in range(first, last + 1)):
                yield index, space.variation(index)[1]
            return
        if self.sample is not None and self.sample < space.size:
            for index in self._drawn(space, enforce_constraints):
                yield index, space.variation(index)[1]
            return
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
