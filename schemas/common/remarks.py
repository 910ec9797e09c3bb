"""Remarks: assumptions by which a file is used although it breaks its standard or asks for
something that is not done.

Checking is strict and names every fault; loading and running repair what has one sensible meaning.
Each repair is reported once, as a remark on what was loaded:

    remarks = Remarks(strict)
    remarks.add(node.remark("xosc.toolchain:xosc:1.0.0:…", "the speed 'fast' is no number; 0 is
    assumed"))
    document = Resolved(…, remarks=remarks.found)

A strict loader refuses with the same sentence. What would change the meaning is no repair: it is
refused in any case, by the errors of `schemas.common.errors`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from schemas.common.errors import InvalidFile


@dataclass(frozen=True)
class Remark:
    """One repair.

    Attributes:
        rule: uid of the rule that the file breaks, as `xosc-check` names it.
        message: what is wrong, and what is assumed.
        path: the file.
        line: 1-based line, where there is one.
        cause: name of the cause for which a run is inconclusive by this
            (`runner.judging.evidence.least.CAUSES`); empty where it is none.
        element: name of the element that it is about; empty where it is not known.
    """

    rule: str
    message: str
    path: str
    line: int | None = None
    cause: str = ""
    element: str = ""

    def __str__(self) -> str:
        place = self.path if self.line is None else f"{self.path}:{self.line}"
        return f"{place}: {self.message} [{self.rule}]"

    def error(self) -> InvalidFile:
        """The refusal that takes the repair's place where loading is strict."""
        return InvalidFile(f"{self.message} [{self.rule}]", path=self.path, line=self.line)


BREACH = re.compile(r"\[[\w.-]+:xo(?:sc|dr):[\w.:-]+\]$")
"""End of a remark on a breach of a rule"""


def told_quietly(remarks: Iterable[str]) -> str:
    """Return the summary of remarks for a quiet command: the first one on a broken rule; "" without
    one.

    Args:
        remarks: of one file or several, as text.
    """
    # Only breaches: a quiet run may keep to itself what is merely not executed.
    repairs = dict.fromkeys(remark for remark in remarks if BREACH.search(remark))
    first = next(iter(repairs), "")
    more = f" (and {len(repairs) - 1} more, see without --quiet)" if len(repairs) > 1 else ""
    return f"read though it breaks its standard: {first}{more}" if first else ""


@contextmanager
def with_ignored(remarks: Iterable[Remark]) -> Iterator[None]:
    """Context manager around the reading of a document: an error names an element that is ignored,
    as a reference into it leads nowhere.

    Args:
        remarks: those on the document.
    """
    try:
        yield
    except InvalidFile as error:
        reason = next((remark for remark in remarks if remark.cause), None)
        # A nested reading has told it already.
        if reason is not None and reason.message not in error.message:
            error.message += (
                f"; line {reason.line}: {reason.message}" if reason.line else f"; {reason.message}"
            )
        raise


class Remarks:
    """Remarks in the order in which they are found, each once.

    Args:
        strict: refuse the first repair instead.
    """

    def __init__(self, strict: bool = False) -> None:
        self.strict = strict
        self._found: dict[Remark, None] = {}

    def add(self, *remarks: Remark) -> None:
        """Add remarks.

        Raises:
            InvalidFile: there is one, and loading is strict.
        """
        if self.strict and remarks:
            raise remarks[0].error()
        self.note(*remarks)

    def note(self, *remarks: Remark) -> None:
        """Add remarks on valid contents that are not executed; strict loading accepts them."""
        self._found.update(dict.fromkeys(remarks))

    @property
    def found(self) -> tuple[Remark, ...]:
        """All remarks so far."""
        return tuple(self._found)
