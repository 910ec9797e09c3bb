"""Findings that several rules share: unknown names, negative numbers, cycles."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from typing import TypeVar

from schemas.checks.document import Document
from schemas.checks.registry import Finding
from schemas.common.errors import nearest


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """There is no such thing; the nearest name, or all that there are."""
    return f"there is no {what} {name!r}; {nearest(name, sorted(known))}"


def unresolved(document: Document, what: str, known: Iterable[str], *attributes: str, where: str = "") -> Iterator[Finding]:
    """A finding for each attribute with one of these names whose value is none of the known names of what it refers to."""
    known = frozenset(known)
    for element, attribute, name in document.values(*attributes):
        if name not in known:
            yield Finding(element, f"{attribute}: {unknown(what, name, known)}{where}")


def negative(document: Document, attributes: Iterable[tuple[str, str]]) -> Iterator[Finding]:
    """A finding for each of these attributes (element name, attribute name) that is a negative number or none at all."""
    for tag, name in attributes:
        for element in document.elements(tag):
            value = document.number(element, name)
            if value is not None and not value >= 0:
                yield Finding(element, f"{name}={element.get(name)!r} is {value:g}, 0 or more is expected")


Node = TypeVar("Node", bound=Hashable)


def on_cycles(graph: Mapping[Node, Collection[Node]]) -> Iterator[Node]:
    """The nodes from which edges lead back to themselves, in the order of the mapping.

    Args:
        graph: successors of each node; nodes that are no key have none.
    """
    suspects = _unfinished(graph)
    for node in graph:
        if node in suspects and node in _reachable(graph, node, suspects):
            yield node


def _unfinished(graph: Mapping[Node, Collection[Node]]) -> set[Node]:
    """Return the nodes on cycles and the nodes that lead to them."""
    users: dict[Node, list[Node]] = {node: [] for node in graph}
    open_edges = dict.fromkeys(graph, 0)
    for node, targets in graph.items():
        for target in set(targets) & graph.keys():
            users[target].append(node)
            open_edges[node] += 1
    finished = [node for node, count in open_edges.items() if count == 0]
    for node in finished:
        for user in users[node]:
            open_edges[user] -= 1
            if open_edges[user] == 0:
                finished.append(user)
    return graph.keys() - set(finished)


def _reachable(graph: Mapping[Node, Collection[Node]], start: Node, within: Collection[Node]) -> set[Node]:
    found: set[Node] = set()
    pending = [start]
    while pending:
        for target in graph[pending.pop()]:
            if target in within and target not in found:
                found.add(target)
                pending.append(target)
    return found
