"""Remarks: what was assumed so that a file could be used which breaks its standard, or which asks for what is not done.

Checking is strict and names every fault; loading and running repair what has one sensible meaning. Each repair is told once,
as a remark on what was loaded:

    remarks = Remarks(strict)
    remarks.add(node.remark("xosc.toolchain:xosc:1.0.0:…", "the speed 'fast' is no number; 0 is assumed"))
    document = Resolved(…, remarks=remarks.found)

A loader that is told to be strict refuses with the same sentence. What would change the meaning is no repair: it is refused
in any case, by the errors of `schemas.errors`.
"""

from __future__ import annotations

from dataclasses import dataclass

from schemas.errors import InvalidFile


@dataclass(frozen=True)
class Remark:
    """One repair.

    Attributes:
        rule: uid of the rule that the file breaks, as `xosc-check` names it.
        message: what is wrong, and what is assumed.
        path: the file.
        line: 1-based line, where there is one.
    """

    rule: str
    message: str
    path: str
    line: int | None = None

    def __str__(self) -> str:
        place = self.path if self.line is None else f"{self.path}:{self.line}"
        return f"{place}: {self.message} [{self.rule}]"

    def error(self) -> InvalidFile:
        """The refusal that takes the repair's place where loading is strict."""
        return InvalidFile(f"{self.message} [{self.rule}]", path=self.path, line=self.line)


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
        """Add remarks on what is no fault of a file but not done here; strict loading accepts them."""
        self._found.update(dict.fromkeys(remarks))

    @property
    def found(self) -> tuple[Remark, ...]:
        """All remarks so far."""
        return tuple(self._found)
