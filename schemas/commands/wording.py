"""Words that messages of all commands share."""

from __future__ import annotations


def many(count: int, one: str, several: str = "") -> str:
    """A number of things, as `1 run`, `2,000 runs`; `several` where the plural is not one with an s."""
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"
