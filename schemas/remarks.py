"""What a reader that helps says: one remark is one assumption that it made about one place in one file."""

from __future__ import annotations

from typing import NamedTuple


class Remark(NamedTuple):
    """Something that a file leaves open or gets wrong, and what was assumed instead of refusing it.

    rule: uid of the rule that the file breaks, as in a check's report. path: the file. line: 1-based, None where there is none.
    text: what is wrong, a colon or semicolon, and what was assumed.
    """

    rule: str
    path: str
    line: int | None
    text: str

    def __str__(self) -> str:
        place = self.path if self.line is None else f"{self.path}:{self.line}"
        return f"{place}: {self.text}"
