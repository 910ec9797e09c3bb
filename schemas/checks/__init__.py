"""Checking files: the document as rules see it, the registry of rules, problems and reports.

Modules:

- `checker`: checking files: well-formed, valid against the official XSD
- `document`: document of a check: indexed elements
- `osi`: rules of ASAM OSI for ground-truth traces
- `registry`: the registry of rules
- `report`: reports of a check: text for people, JSON for scripts, JUnit for CI
- `road_elements`: the elements of OpenDRIVE 1.4 to 1.9 that are read: their children
- `road_references`: ids, lengths and lanes of road networks that references need
- `structure`: files are well-formed, valid documents of their standard

Example::

    schemas.check("mine.xosc")  # every problem with its rule, file and line
"""

from __future__ import annotations

from dataclasses import dataclass

LEVELS = ("error", "warning", "info")
"""Most severe first: an error breaks the standard, a warning deserves a look, an info is for the
record."""
LIMITS = "xosc.toolchain:xosc:1.0.0:limits"
"""Uid of problems with files that exceed the limits of time or memory; no rule of the registry"""


@dataclass(frozen=True)
class Problem:
    """One finding of one rule.

    Attributes:
        rule: uid of the rule that it breaks.
        level: "error", "warning" or "info".
        message: what is wrong and what would be right.
        path: the file.
        line: 1-based line of the element, where there is one.
        element: path of the element in the document, like /OpenSCENARIO/Storyboard/Story[2].

    Example:
        >>> import xosc_toolchain as xt
        >>> problem = xt.check("missing.xosc")[0]
        >>> problem.level, problem.path, problem.message
        ('error', 'missing.xosc', 'no such file')
    """

    rule: str
    level: str
    message: str
    path: str
    line: int | None = None
    element: str | None = None

    def __str__(self) -> str:
        place = self.path if self.line is None else f"{self.path}:{self.line}"
        return f"{place}: {self.level}: {self.message}"
