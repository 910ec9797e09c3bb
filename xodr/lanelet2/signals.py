"""Traffic lights at the ends of roads, and the controllers that switch them."""

from __future__ import annotations

from collections import defaultdict

from xodr.builders.elements import Controller, Signal
from xodr.lanelet2.bundles import Layout
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.lines.shapes import Shape

_BESIDE = 1.0
"""How far a light stands from the road's right edge, m."""


def signals(graph: Graph, plan: Layout, shapes: list[Shape]) -> dict[int, tuple[Signal, ...]]:
    """The lights at the end of each bundle that has some: one for all neighbouring lanes that it holds."""
    found: dict[int, tuple[Signal, ...]] = {}
    count = 0
    for number, bundle in enumerate(plan.bundles):
        here = []
        for light, lanes in _held(graph, bundle.last):
            count += 1
            edge = shapes[number].end[-1]
            here.append(Signal(count, light, shapes[number].length, edge - _BESIDE, "+", (-lanes[-1] - 1, -lanes[0] - 1)))
        if here:
            found[number] = tuple(here)
    return found


def _held(graph: Graph, names: tuple[str, ...]) -> list[tuple[str, list[int]]]:
    """Each light with the lanes that it holds; a light for lanes that are apart comes once for each group of them."""
    runs: dict[str, list[list[int]]] = defaultdict(list)
    for lane, name in enumerate(names):
        for light in graph.lanelets[name].lights:
            if runs[light] and runs[light][-1][-1] == lane - 1:
                runs[light][-1].append(lane)
            else:
                runs[light].append([lane])
    return [(light, run) for light, groups in runs.items() for run in groups]


def controllers(lights: dict[int, tuple[Signal, ...]]) -> tuple[Controller, ...]:
    """One controller for each light, which may stand at the ends of several roads."""
    groups: dict[str, list[int]] = defaultdict(list)
    for here in lights.values():
        for signal in here:
            groups[signal.name].append(signal.id)
    return tuple(Controller(place, name, tuple(ids)) for place, (name, ids) in enumerate(groups.items(), 1))
