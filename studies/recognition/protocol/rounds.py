"""The order in which classes become known: two at first, then three new ones in each round."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from schemas.common.errors import UsageError

FIRST, STEP = 2, 3


class Round(NamedTuple):
    """One round.

    Attributes:
        number: from 1.
        known: classes known before it.
        new: classes that appear in it.
    """

    number: int
    known: tuple[int, ...]
    new: tuple[int, ...]


def rounds(classes: Sequence[int]) -> list[Round]:
    """The rounds over these classes, in ascending order of their ids; the last has fewer new ones
    where they don't come out even.

    Raises:
        UsageError: fewer than three classes.
    """
    ordered = sorted(classes)
    if len(ordered) <= FIRST:
        raise UsageError(
            f"the protocol needs {FIRST} known classes and a new one, there are "
            f"{len(ordered)} in every split"
        )
    starts = range(FIRST, len(ordered), STEP)
    return [
        Round(number, tuple(ordered[:start]), tuple(ordered[start : start + STEP]))
        for number, start in enumerate(starts, 1)
    ]
