"""The registry of rules: each is a function that looks at a document and yields what it finds.

A rule has the uid under which ASAM publishes it (Annex C of OpenSCENARIO XML, and the checker bundles for both
standards), or one of this project (`xosc.toolchain:…`) in the same grammar: entity, standard, version in which the
rule first appeared, name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.problems import Problem
from schemas.common import discovery
from schemas.registry import OPENDRIVE, OPENSCENARIO, FileType


class Finding(NamedTuple):
    """Finding of a rule: the element, the fault, and a level where it differs from the rule's."""

    element: etree._Element
    message: str
    level: str | None = None


Check = Callable[[Document], Iterator[Finding]]

MAX_FINDINGS = 100
"""Problems reported per rule and file: one wrong habit of an exporter can break a rule ten thousand times."""

_STANDARDS = {"xosc": OPENSCENARIO, "xodr": OPENDRIVE}


@dataclass(frozen=True)
class Rule:
    """A registered rule.

    Attributes:
        uid: its unique id.
        level: level of its problems.
        kinds: the kinds of files that it concerns (see `FileType`); empty for all of its standard.
        since: the first version of the standard that it concerns.
        precondition: whether nothing else can be checked where it is broken.
        check: yields the findings in a document.
    """

    uid: str
    level: str
    kinds: tuple[str, ...]
    since: tuple[int, int]
    precondition: bool
    check: Check

    @property
    def standard(self) -> str:
        """The standard that it concerns."""
        return _STANDARDS[self.uid.split(":")[1]]

    @property
    def description(self) -> str:
        """Requirement of the rule, in one sentence."""
        return " ".join((self.check.__doc__ or "").split("\n\n")[0].split())

    def concerns(self, file: FileType) -> bool:
        """Whether it is to be checked in such a file."""
        kinds = self.kinds or (file.kind,)
        return self.standard == file.standard and file.version >= self.since and file.kind in kinds

    def problems(self, document: Document) -> Iterator[Problem]:
        """Its problems in a document."""
        for number, (element, message, level) in enumerate(self.check(document)):
            if number == MAX_FINDINGS:
                yield document.problem(self.uid, "info", f"more problems of this kind than the {MAX_FINDINGS} listed", element)
                return
            yield document.problem(self.uid, level or self.level, message, element)


_rules: dict[str, Rule] = {}
_PACKAGES = ("schemas.rules", "xodr.rules")
"""Packages whose modules register rules: those of `schemas`, and those that take the exact geometry of roads."""


def rule(
    uid: str,
    *,
    level: str = "error",
    kinds: tuple[str, ...] = (),
    since: tuple[int, int] = (0, 0),
    precondition: bool = False,
) -> Callable[[Check], Check]:
    """Register a check function under its uid; its docstring's first paragraph is the rule's description."""

    def register(check: Check) -> Check:
        if uid in _rules:
            raise ValueError(f"the rule {uid} is registered twice")
        _rules[uid] = Rule(uid, level, kinds, since, precondition, check)
        return check

    return register


@cache
def all_rules() -> tuple[Rule, ...]:
    """Every rule of this package, preconditions first, then by uid."""
    for package in _PACKAGES:
        discovery.load(package)
    return tuple(sorted(_rules.values(), key=lambda each: (not each.precondition, each.uid)))
