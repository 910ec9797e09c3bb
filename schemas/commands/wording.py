"""Words that messages of all commands share."""

from __future__ import annotations

from collections.abc import Sequence

_MOST_SHOWN = 5


def many(count: int, one: str, several: str = "") -> str:
    """A number of things, as `1 run`, `2,000 runs`; `several` where the plural is not one with an s."""
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"


def shown(texts: Sequence[str]) -> list[str]:
    """The first five of many texts, and how many more there are."""
    more = len(texts) - _MOST_SHOWN
    return [*texts[:_MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])]
