"""Registry of rules: each is a function that yields the findings in a document.

A rule has the uid under which ASAM publishes it (Annex C of OpenSCENARIO XML, and the checker
bundles for both standards), or one of this project (`xosc.toolchain:…`) in the same grammar:
entity, standard, version in which the rule first appeared, name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import NamedTuple, TypeVar

from lxml import etree

from schemas.checks import Problem
from schemas.checks.document import CheckedDocument
from schemas.common import packages
from schemas.common.errors import nearest
from schemas.versions.registry import OPENDRIVE, OPENSCENARIO, FileType


class Finding(NamedTuple):
    """Finding of a rule: the element, the fault, and a level where it differs from the rule's."""

    element: etree._Element
    message: str
    level: str | None = None


Check = Callable[[CheckedDocument], Iterator[Finding]]

MAX_FINDINGS = 100
"""Problems reported per rule and file: one wrong habit of an exporter can break a rule ten thousand
times."""

_STANDARDS = {"xosc": OPENSCENARIO, "xodr": OPENDRIVE}


@dataclass(frozen=True)
class RegisteredRule:
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

    def problems(self, document: CheckedDocument) -> Iterator[Problem]:
        """Problems of the rule in a document."""
        for number, (element, message, level) in enumerate(self.check(document)):
            # Generators stop here: rules find lazily, and the rest is never worked out.
            if number == MAX_FINDINGS:
                yield document.problem(
                    self.uid,
                    "info",
                    f"more problems of this kind than the {MAX_FINDINGS} listed",
                    element,
                )
                return
            yield document.problem(self.uid, level or self.level, message, element)


_rules: dict[str, RegisteredRule] = {}
_PACKAGES = ("xosc.rules", "xodr.rules")
"""Packages whose modules register the rules of a standard, loaded by name: they are a floor above
"""


def rule(
    uid: str,
    *,
    level: str = "error",
    kinds: tuple[str, ...] = (),
    since: tuple[int, int] = (0, 0),
    precondition: bool = False,
) -> Callable[[Check], Check]:
    """Register a check function under its uid; its docstring's first paragraph is the rule's
    description."""

    def register(check: Check) -> Check:
        # Two checks under one uid would share its suppression and its place in reports.
        if uid in _rules:
            raise ValueError(f"the rule {uid} is registered twice")
        _rules[uid] = RegisteredRule(uid, level, kinds, since, precondition, check)
        return check

    return register


@cache
def all_rules() -> tuple[RegisteredRule, ...]:
    """Every rule, preconditions first, then by uid."""
    # Not at the top: it registers its rules here, and would import this module half made.
    import_module("schemas.checks.structure")
    for package in _PACKAGES:
        packages.load(package)
    return tuple(sorted(_rules.values(), key=lambda rule: (not rule.precondition, rule.uid)))


# findings that several rules share --------------------------------------------------------------


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Message for an unknown name, with the nearest known one, or all known ones."""
    return f"there is no {what} {name!r}; {nearest(name, sorted(known))}"


def unresolved(
    document: CheckedDocument, what: str, known: Iterable[str], *attributes: str, where: str = ""
) -> Iterator[Finding]:
    """A finding for each attribute with one of these names whose value is none of the known names
    of what it refers to."""
    known = frozenset(known)
    for element, attribute, name in document.values(*attributes):
        if name not in known:
            yield Finding(element, f"{attribute}: {unknown(what, name, known)}{where}")


def negative(document: CheckedDocument, attributes: Iterable[tuple[str, str]]) -> Iterator[Finding]:
    """A finding for each of these attributes (element name, attribute name) that is a negative
    number or none at all."""
    for tag, name in attributes:
        for element in document.elements(tag):
            value = document.number(element, name)
            if value is not None and not value >= 0:
                yield Finding(
                    element, f"{name}={element.get(name)!r} is {value:g}, 0 or more is expected"
                )


Node = TypeVar("Node", bound=Hashable)


def on_cycles(graph: Mapping[Node, Collection[Node]]) -> Iterator[Node]:
    """The nodes from which edges lead back to themselves, in the order of the mapping.

    Args:
        graph: successors of each node; nodes that are no key have none.
    """
    # Searching from each node takes quadratic time; most are on no cycle and are ruled out in
    # linear time first (A. B. Kahn, Topological sorting of large networks, 1962).
    suspects = _unfinished(graph)
    for node in graph:
        if node in suspects and node in _reachable(graph, node, suspects):
            yield node


def _unfinished(graph: Mapping[Node, Collection[Node]]) -> set[Node]:
    """Return the nodes on cycles and the nodes that lead to them."""
    users: dict[Node, list[Node]] = {node: [] for node in graph}
    open_edges = dict.fromkeys(graph, 0)
    for node, targets in graph.items():
        # Each target once: a count of doubled edges would never come down to 0.
        for target in set(targets) & graph.keys():
            users[target].append(node)
            open_edges[node] += 1
    # The list grows while it is gone through: a node is finished when all that it leads to are.
    finished = [node for node, count in open_edges.items() if count == 0]
    for node in finished:
        for user in users[node]:
            open_edges[user] -= 1
            if open_edges[user] == 0:
                finished.append(user)
    return graph.keys() - set(finished)


def _reachable(
    graph: Mapping[Node, Collection[Node]], start: Node, within: Collection[Node]
) -> set[Node]:
    reachable: set[Node] = set()
    pending = [start]
    while pending:
        for target in graph[pending.pop()]:
            if target in within and target not in reachable:
                reachable.add(target)
                pending.append(target)
    return reachable
