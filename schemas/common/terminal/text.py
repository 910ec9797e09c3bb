"""Text from files and their names in what is printed and written: nothing in it is obeyed by a
terminal, a CI service, a spreadsheet, a browser, or a viewer of reports.

A name or message is escaped where it is printed or written, by what it goes into; before that it is
as in the file.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

_MOST_SHOWN = 5
_COMMAND = re.compile(r"^\s*(?=::)|(?<=#)(?=#\w*\[)")
"""Start of a workflow command in a line of text: GitHub (`::error::`, `##[error]`), Azure
(`##vso[…]`), TeamCity (`##teamcity[…]`)"""
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
_LOCATION = re.compile(r"^.*?:\d+: ")
"""Start of a remark: the file and its line"""
_NUMBER = re.compile(r"\d+(\.\d+)?")
_MARKS = re.compile(r"([\\`*_{}\[\]<>|])")


def one_line(text: str) -> str:
    r"""Text as a line of a terminal or of a CI service's log: no line breaks, no control
    characters, no workflow command.

    Characters that can't be printed become blanks; what a service would take for a command gets a
    backslash: `\::error::`, `#\#[error]`.
    """
    # Lone surrogates stay: they stand for bytes of file names, which output streams escape.
    line = (
        text
        if text.isprintable()
        else "".join(c if c.isprintable() or "\ud800" <= c <= "\udfff" else " " for c in text)
    )
    return _COMMAND.sub(lambda found: found[0] + "\\", line)


def of_service(report: str) -> str:
    """A report for the log of a CI service or a terminal: commands in it are written as references
    to their characters.

    Args:
        report: in JSON or XML; another text stays as it is.
    """
    if report[:1] not in ("{", "<"):
        return report
    refer = _json_reference if report.startswith("{") else _xml_reference
    shown = report
    if not report.replace("\n", " ").isprintable():
        shown = "".join(
            c if c.isprintable() or c == "\n" or "\ud800" <= c <= "\udfff" else refer(c)
            for c in report
        )
    return re.sub(r"(?<=#)#(?=\w*\[)", lambda found: refer(found[0]), shown)


def _json_reference(character: str) -> str:
    return f"\\u{ord(character):04x}" if character == "#" else json.dumps(character)[1:-1]


def _xml_reference(character: str) -> str:
    return f"&#{ord(character)};"


def cell(value: Any) -> Any:
    """A value as a cell of CSV: a text that a spreadsheet would compute begins with `'`; numbers,
    and texts that are one, stay.

    Source: OWASP, CSV Injection.
    """
    if not isinstance(value, str):
        return value
    line = one_line(value)
    return (
        f"'{line}"
        if (value.startswith(_FORMULA) or line.lstrip().startswith(_FORMULA))
        and not _is_number(value)
        else line
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and text == text.strip()


def finite_number(text: str) -> float | None:
    """The number that a text is; None for other texts, and for infinite numbers and NaN."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def csv_text(rows: Iterable[Sequence[Any]]) -> str:
    """Rows as CSV, each value as a `cell`; None is blank."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([cell(value) for value in row] for row in rows)
    return text.getvalue()


def xml_text(text: str) -> str:
    """Text without the characters that XML can't hold or a viewer would obey; line breaks and tabs
    stay."""
    return "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)


def sarif_text(text: str) -> str:
    """Text of a SARIF message, with links escaped (2.1.0, 3.11.6)."""
    line = one_line(text)
    return re.sub(r"([\\\[\]])", r"\\\1", line) if "](" in line else line


def markdown(text: str) -> str:
    """Text as a word or cell of Markdown."""
    return _MARKS.sub(r"\\\1", one_line(text))


# words of messages
# ----------------------------------------------------------------------------------


def many(count: int, one: str, several: str = "") -> str:
    """A number of things, as `1 run`, `2,000 runs`; `several` where the plural is not one with an
    s."""
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"


def alike(texts: Iterable[str]) -> list[str]:
    """Texts that differ in file, line and numbers only as one: the first, and how many there are.

    Examples:
        >>> alike(["a.xosc:3: 2.5 s late", "b.xosc:9: 4.0 s late", "off the road"])
        ['a.xosc:3: 2.5 s late (and 1 more like it)', 'off the road']
    """
    groups: dict[str, list[str]] = {}
    for text in texts:
        groups.setdefault(_NUMBER.sub("…", _LOCATION.sub("", text)), []).append(text)
    return [
        f"{same[0]} (and {len(same) - 1:,} more like it)" if len(same) > 1 else same[0]
        for same in groups.values()
    ]


def shown(texts: Sequence[str]) -> list[str]:
    """The first five of many texts, and how many more there are."""
    more = len(texts) - _MOST_SHOWN
    return [*texts[:_MOST_SHOWN], *([f"and {more} more"] if more > 0 else [])]
