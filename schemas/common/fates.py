"""Fates of the fields of a model in a format: kept, changed or lost, as the writer of the format
declares them.

A writer has a table of the fate of each field; a test reads files back and compares each field that
is said to be kept. The tables of documents are made from the same declarations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

KEPT, CHANGED, LOST = "kept", "changed", "lost"
SIGNS = {KEPT: "●", CHANGED: "◐", LOST: "○"}
"""Signs of the fates in tables."""


class FieldFate(NamedTuple):
    """FieldFate of a field.

    Attributes:
        outcome: `KEPT`, `CHANGED` or `LOST`.
        text: where it is, what becomes of it, or why it is lost.
    """

    outcome: str
    text: str


def kept(where: str = "") -> FieldFate:
    """The field is read back with the same value."""
    return FieldFate(KEPT, where)


def changed(how: str) -> FieldFate:
    """The field is there in part, or in another form."""
    return FieldFate(CHANGED, how)


def lost(why: str) -> FieldFate:
    """The field is not there."""
    return FieldFate(LOST, why)


Fates = Mapping[str, FieldFate]
"""Fates by field."""


def undeclared(fields: Mapping[str, str], fates: Fates) -> list[str]:
    """Fields without a fate, and fates of fields that do not exist."""
    # Both ways: a field that was added, and a fate of one that was renamed.
    return sorted(fields.keys() ^ fates.keys())


def share_kept(tables: Mapping[str, Fates]) -> tuple[int, int]:
    """Number of kept fields, and of all, of some formats together."""
    fates = [fate for table in tables.values() for fate in table.values()]
    return sum(fate.outcome == KEPT for fate in fates), len(fates)


def matrix(fields: Mapping[str, str], tables: Mapping[str, Fates]) -> Iterator[str]:
    """Lines of a table in Markdown: a row a field, a column a format, and notes on all that is
    changed or lost.

    Args:
        fields: meaning of each field.
        tables: fates of all fields by format.
    """
    notes: list[str] = []
    yield f"| field | {' | '.join(tables)} |"
    yield f"|---|{'---|' * len(tables)}"
    for field, meaning in fields.items():
        cells = [_cell(fates[field], notes) for fates in tables.values()]
        yield f"| {field}{f' ({meaning})' if meaning else ''} | {' | '.join(cells)} |"
    if notes:
        yield ""
        yield " ".join(f"{number}: {text}." for number, text in enumerate(notes, 1))


def _cell(fate: FieldFate, notes: list[str]) -> str:
    if not fate.text:
        return SIGNS[fate.outcome]
    if fate.outcome == KEPT:
        return f"{SIGNS[KEPT]} {fate.text}"
    # One number for one reason, however many fields share it.
    if fate.text not in notes:
        notes.append(fate.text)
    return f"{SIGNS[fate.outcome]} {notes.index(fate.text) + 1}"


def replaced(text: str, name: str, lines: Sequence[str]) -> str:
    """A document with new lines between its markers `<!-- NAME -->` and `<!-- end of NAME -->`.

    Raises:
        ValueError: it has no such markers.
    """
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    head, found, rest = text.partition(begin)
    _, ended, tail = rest.partition(end)
    if not (found and ended):
        raise ValueError(f"there are no markers of {name!r}")
    return "\n".join([head + begin, *lines, end + tail])
