"""Searches for planted failures: what each finds of them with the same runs, against plain draws of the density."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from generation.density.prior import Prior
from generation.search.emitters import Frame
from generation.search.methods.cover import cover
from generation.search.methods.mcsg import mcsg
from generation.search.methods.quality import quality
from generation.search.problem import BATCH, Calls, History, Problem, Search
from generation.search.space import distinctive
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.storage import Records
from studies.generation.baselines.cma_es import cma_es
from studies.generation.planted.systems import Plan, Planted, Pool, plant

PLANS: Mapping[str, Sequence[Plan]] = {
    "development": (
        Plan("box", 1, 1e-2, True),
        Plan("ellipsoid", 2, 4e-3, False),
        Plan("ellipsoid", 5, 1e-2, True),
    ),
    "reported": (
        Plan("slab", 1, 1e-2, False),
        Plan("shell", 2, 1e-2, True),
        Plan("slab", 5, 1e-2, True),
        Plan("interaction", 2, 3e-3, True),
        Plan("interaction", 1, 1e-3, True),
        Plan("timing", 1, 3e-3, False),
    ),
}
"""Plans of each generator"""
FIRST_SEED = {"development": 1000, "reported": 5000}
NEAR = (0.05, 0.1)
"""Distances within which a failing draw counts as recalled by a found failure"""


def draws(problem: Problem, budget: int, seed: int) -> History:
    """Draws of the density."""
    assert problem.prior is not None
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    while calls.left:
        calls(problem.prior.sample(min(BATCH, calls.left), generator))
    return calls.history


def cells(problem: Problem, budget: int, seed: int) -> History:
    """One draw in each cell of equal probability: a design that covers the density evenly."""
    assert problem.prior is not None
    calls, generator = Calls(problem, budget), np.random.default_rng(seed)
    frame = Frame.of(problem.space, problem.prior, generator)
    calls(stratified(problem.prior, frame, budget, generator))
    return calls.history


def stratified(prior: Prior, frame: Frame, n: int, generator: np.random.Generator) -> FloatArray:
    """One draw from each of n cells of equal probability, or up to twice as many (m, d), in a drawn order.

    The cells halve draws of the prior at the median of the coordinate in which they spread most.
    """
    depth = max(int(np.ceil(np.log2(max(n, 1)))), 0)
    drawn = prior.sample(_PER_CELL << depth, generator)
    rows, cells = frame.coordinates(drawn), [np.arange(len(drawn))]
    for _ in range(depth):
        cells = [half for cell in cells for half in _halves(rows, cell)]
    chosen = np.array([generator.choice(cell) for cell in cells])
    return drawn[generator.permutation(chosen)]


_PER_CELL = 4
"""Draws of the prior for each cell"""


def _halves(rows: FloatArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    widest = int(np.argmax(rows[cell].std(axis=0)))
    order = cell[np.argsort(rows[cell, widest], kind="stable")]
    return order[: len(order) // 2], order[len(order) // 2 :]


ROWS: Mapping[str, Search] = {
    "draws": draws,
    "cells": cells,
    "cover": cover,
    "quality": quality,
    "mcsg": mcsg,
    "cma-es": cma_es,
}
"""Methods by name, the one that the others must not stay behind first"""


class Found(NamedTuple):
    """Result of a search.

    Attributes:
        regions: share of the planted regions with a run that fails there.
        near, far: share of failing draws of the density within 5 and 10 % of a found failure.
        first: number of the first run that fails; one more than the budget where none does.
        strange: share of the failing runs that are not foreseeable.
    """

    regions: float
    near: float
    far: float
    first: int
    strange: float


def judged(planted: Planted, problem: Problem, pool: Pool, history: History) -> Found:
    """Judge a search by the failing draws of the pool."""
    failing = np.flatnonzero(history.outcomes.collision & history.outcomes.executed)
    if not failing.size:
        return Found(0.0, 0.0, 0.0, len(history.outcomes) + 1, 0.0)
    hit = planted.within(history.theta[failing]).any(axis=1)
    drawn = pool.theta[pool.collides]
    drawn = drawn[planted.within(drawn).any(axis=0)]
    columns = distinctive(problem.space)
    one, other = (problem.space.unit(each)[:, columns] for each in (drawn, history.theta[failing]))
    least = cdist(one, other).min(axis=1) / np.sqrt(columns.sum())
    near, far = (float((least < each).mean()) for each in NEAR)
    assert problem.prior is not None
    strange = 1.0 - float(problem.prior.foreseeable(history.theta[failing]).mean())
    return Found(float(hit.mean()), near, far, int(failing[0]) + 1, strange)


def searches(
    problem: Problem, pool: Pool, generator: str, methods: Sequence[str], budget: int, seeds: int, out: Path
) -> Iterator[tuple[str, str, int, Found]]:
    """Search, or read what was kept in the folder: plan, method, seed and what was found."""
    assert problem.prior is not None and problem.twin is not None
    records = Records(out / f"{generator}_{budget}.jsonl")
    known = {(each["plan"], each["method"], each["seed"]): each["found"] for each in records.read()[0]}
    for seed in range(FIRST_SEED[generator], FIRST_SEED[generator] + seeds):
        for plan in PLANS[generator]:
            planted = plant(plan, problem.space, problem.prior, problem.twin, pool, seed)
            posed = replace(problem, evaluate=planted, twin=None)
            for name in methods:
                key = str(plan), name, seed
                if key not in known:
                    found = judged(planted, problem, pool, ROWS[name](posed, budget, seed))
                    known[key] = list(found)
                    records.add([{"plan": key[0], "method": name, "seed": seed, "found": known[key]}])
                yield *key, Found(*known[key])


def table(found: Sequence[tuple[str, str, int, Found]]) -> str:
    """Means over seeds, with 95 % intervals by bootstrap over seeds for recall within 10 %; in Markdown."""
    lines = ["| planted | method | regions found | recall 5 % | recall 10 % (95 % interval) | no failure | not foreseeable |"]
    lines.append("|---|---|---|---|---|---|---|")
    for plan in dict.fromkeys(each[0] for each in found):
        lines += _rows(plan, [each for each in found if each[0] == plan])
    lines += _rows("all", found)
    return "\n".join(lines)


_Row = tuple[str, str, int, Found]


def _rows(plan: str, found: Sequence[_Row]) -> list[str]:
    names = dict.fromkeys(each[1] for each in found)
    return [_row(plan, name, [each[3] for each in found if each[1] == name]) for name in names]


def _row(plan: str, name: str, of: Sequence[Found]) -> str:
    regions, near, far = (np.array([getattr(each, which) for each in of]) for which in ("regions", "near", "far"))
    low, high = interval(far)
    nothing = sum(each.regions == 0.0 for each in of)
    return (
        f"| {plan} | {name} | {regions.mean():.2f} | {near.mean():.2f} | {far.mean():.2f} ({low:.2f} to {high:.2f}) "
        f"| {nothing} of {len(of)} | {np.mean([each.strange for each in of]):.2f} |"
    )


def interval(values: FloatArray) -> tuple[float, float]:
    """95 % interval of a mean by bootstrap."""
    drawn = np.random.default_rng(0).choice(values, (2000, len(values))).mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)
