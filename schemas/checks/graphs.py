"""Cycles of definitions and references."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator, Mapping
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def on_cycles(graph: Mapping[Node, Collection[Node]]) -> Iterator[Node]:
    """The nodes from which edges lead back to themselves, in the order of the mapping.

    Args:
        graph: the nodes that each node points to; those that are no key point nowhere.
    """
    suspects = _unfinished(graph)
    for node in graph:
        if node in suspects and node in _reachable(graph, node, suspects):
            yield node


def _unfinished(graph: Mapping[Node, Collection[Node]]) -> set[Node]:
    """What is left when nodes that point only to finished ones are finished, again and again: cycles and what leads there."""
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
