"""Cycles of references."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from schemas.checks.registry import on_cycles

graphs = st.dictionaries(st.integers(0, 7), st.lists(st.integers(0, 9), max_size=4), max_size=8)


@given(graphs)
def test_nodes_on_cycles_are_those_that_reach_themselves(graph):
    def reached(node: int, steps: int = 10) -> set[int]:
        found = {node}
        for _ in range(steps):
            found |= {target for each in found for target in graph.get(each, [])}
        return found

    expected = [node for node in graph if any(node in reached(target) for target in graph[node])]
    assert list(on_cycles(graph)) == expected


def test_long_chains_take_no_time():
    assert list(on_cycles({number: [number + 1] for number in range(100_000)})) == []
