"""Searches for planted failures: what each finds of them with the same runs, against plain draws of
the density.

One search spends the whole budget, and is judged after each number of runs in `MARKS`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from generation.pipeline import drawn_of
from generation.search.gate import NEAR, Statement
from generation.search.methods.cover import CoverSettings, cover, draws
from generation.search.methods.judging import Judging
from generation.search.methods.mcsg import mcsg, mcsg_published
from generation.search.outcomes import Outcomes, survivors
from generation.search.problem import History, Plays, Search, SearchProblem
from generation.space.space import Space, distinctive
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError, guess
from schemas.common.storage import Records
from studies.generation.baselines.cma_es import cma_es
from studies.generation.baselines.level_sets import level_sets
from studies.generation.baselines.subset import subset
from studies.generation.lockstep import Work, together
from studies.generation.planted.designs import cells, maximin, sobol
from studies.generation.planted.systems import (
    CAREFUL,
    DECEPTIVE,
    GRADIENT,
    SILENT,
    UNDRIVEN,
    Plan,
    Planted,
    Pool,
    plant,
)

PLANS: Mapping[str, Sequence[Plan]] = {
    "development": (
        Plan("box", (1,), 1e-2),
        Plan("ellipsoid", (1, 1), 4e-3, SILENT),
        Plan("slab", (1,) * 5, 1e-2),
        Plan("interaction", (1,), 1e-3),
        Plan("shell", (1,), 1e-3),
        Plan("timing", (1,), 4e-3, SILENT),
        Plan("box", (1,), 4e-3, GRADIENT, CAREFUL),
        Plan("ellipsoid", (1,), 4e-3, DECEPTIVE),
        Plan("ellipsoid", (8, 1), 9e-3),
        Plan("box", (1, 1), 8e-3),
        Plan("speckles", (1,), 5e-3, SILENT),
        Plan("wave", (1,), 4e-3),
    ),
    "reported": (
        Plan("corner", (1,), 1e-3),
        Plan("ridge", (1, 1), 4e-3),
        Plan("ring", (1,) * 5, 1e-2, SILENT),
        Plan("history", (1,), 3e-3, SILENT),
        Plan("cone", (1, 1), 2e-3),
        Plan("tail", (1,), 1e-3),
        Plan("corner", (1,), 4e-3, GRADIENT, CAREFUL),
        Plan("cone", (1,), 4e-3, DECEPTIVE),
        Plan("corner", (10, 1), 1.1e-2, SILENT),
        Plan("cone", (1, 1), 8e-3),
        Plan("grains", (1,), 5e-3, SILENT),
        Plan("arc", (1,), 4e-3),
    ),
}
"""Plans of each generator"""
FIRST_SEED = {"development": 1000, "reported": 9400}
MARKS = (100, 300, 600, 1000)
"""Numbers of runs after which a search is judged"""
WITHIN = (0.05, 0.1)
"""Distances within which a failing draw counts as recalled by a found failure"""
ROWS: Mapping[str, Search] = {
    "draws": draws,
    "cells": cells,
    "sobol": sobol,
    "maximin": maximin,
    "cover": cover,
    "cover-plays": cover,
    "mcsg": mcsg,
    "mcsg-published": mcsg_published,
    "cma-es": cma_es,
    "level-sets": level_sets,
    "subset": subset,
}
"""Methods by name, the one that the others must not stay behind first"""
PLAYED = "cover-plays"
"""The method that has plays of the planted system, and of the reference drivers"""
_ALONE = frozenset({"mcsg", "mcsg-published"})
"""Methods that draw from a generator of the whole process: no other search may work beside them"""
OURS = "cover"
"""The method that the others are compared with"""


def row(name: str) -> Search:
    """The method of a name in `ROWS`; `cover:explored=0.25,spread=0` is `cover` with other settings
    (`generation.search.methods.cover.CoverSettings`).

    Raises:
        UsageError: there is no such method or setting, or a value is no number.
    """
    method, _, changes = name.partition(":")
    if method not in ROWS:
        raise UsageError(f"there is no row {name!r}; {guess(method, ROWS)}rows: {', '.join(ROWS)}")
    if not changes:
        return ROWS[method]
    known = {
        each.name: type(each.default)
        for each in fields(CoverSettings)
        if isinstance(each.default, int | float)
    }
    changed = dict[str, Any]()
    for entry in changes.split(","):
        setting, _, value = entry.partition("=")
        if ROWS[method] is not cover or setting not in known:
            raise UsageError(
                f"{method} has no setting {setting!r}; settings of {OURS}: {', '.join(known)}"
            )
        try:
            changed[setting] = known[setting](value)
        except ValueError:
            raise UsageError(f"{entry!r}: {value!r} is no number of this setting") from None
    return partial(cover, settings=replace(CoverSettings(), **changed))


class Found(NamedTuple):
    """Result of a search after a number of runs, those of judges included.

    Attributes:
        regions: share of the planted regions with a preventable failure found there.
        near, far: share of preventable failing draws of the density within 5 and 10 % of one.
        first: number of the first run that fails so; one more than the runs where none does.
        strange: share of the failing runs that are not foreseeable.
        own: share of the failing runs that lie in no region, or that no judge prevents.
    """

    regions: float
    near: float
    far: float
    first: int
    strange: float
    own: float


class Stated(NamedTuple):
    """Statements on failures that were not found, of repeated unguided draws.

    Attributes:
        missed: true probability of failures that were not found. bound: mean of the stated bounds.
        below: share of the statements whose bound is below that probability.
    """

    missed: float
    bound: float
    below: float


class Result(NamedTuple):
    """A judged search.

    Attributes:
        plan, method, seed, runs: the search, and after how many runs it was judged.
        found: what it found. seconds: processor time of the whole search, without what plays
            played.
        stated: the product's statement after so many runs, a quarter of them unguided draws.
    """

    plan: str
    method: str
    seed: int
    runs: int
    found: Found
    seconds: float
    stated: Stated


def judged(planted: Planted, problem: SearchProblem, pool: Pool, history: History) -> Found:
    """Judge a search by the failing draws of the pool; failures of the base are counted apart."""
    failing = np.flatnonzero(history.outcomes.collision & history.outcomes.executed)
    theta = history.theta[failing]
    held = np.zeros((len(planted.regions), len(failing)), bool)
    if failing.size:
        undriven = planted.plays(theta, UNDRIVEN)
        held = planted.within(theta, undriven) & undriven.collision
        held &= survivors(theta, planted.plays)
    within, hit = failing[held.any(axis=0)], held.any(axis=1)
    assert problem.prior is not None
    strange = 1.0 - float(problem.prior.foreseeable(theta).mean()) if failing.size else 0.0
    own = 1.0 - len(within) / len(failing) if failing.size else 0.0
    if not within.size:
        return Found(0.0, 0.0, 0.0, len(history.outcomes) + 1, strange, own)
    drawn = pool.hits
    drawn = drawn[planted.within(pool.theta[drawn], pool.undriven.take(drawn)).any(axis=0)]
    least = _distances(problem.space, pool.theta[drawn], history.theta[within])
    near, far = (float((least < each).mean()) for each in WITHIN)
    return Found(float(hit.mean()), near, far, int(within[0]) + 1, strange, own)


_STATED = 40
"""Repetitions of unguided draws"""


def stated(planted: Planted, problem: SearchProblem, pool: Pool, history: History) -> Stated:
    """Make the product's statement after a search: its unguided draws are runs of the pool, in
    place of its last runs."""
    unguided = drawn_of(len(history.theta))
    sought = history.theta[: len(history.theta) - unguided]
    failing = history.outcomes.collision[: len(sought)]
    drawn = pool.hits
    drawn = drawn[planted.within(pool.theta[drawn], pool.undriven.take(drawn)).any(axis=0)]
    unlike = np.zeros(len(pool.theta), bool)
    unlike[drawn] = (
        _distances(problem.space, pool.theta[drawn], sought[failing]) >= NEAR
        if failing.any()
        else True
    )
    fails = np.isin(np.arange(len(pool.theta)), drawn)
    generator, missed = np.random.default_rng(0), float(unlike.mean())
    rows = [generator.choice(len(pool.theta), unguided, replace=False) for _ in range(_STATED)]
    bounds = [
        Statement(unguided, int(fails[each].sum()), int(unlike[each].sum())).unknown
        for each in rows
    ]
    return Stated(
        missed, float(np.mean(bounds)), float(np.mean([each < missed for each in bounds]))
    )


def _distances(space: Space, theta: FloatArray, others: FloatArray) -> FloatArray:
    """Distances (n,) of points (n, d) from the nearest of others (m, d)."""
    columns = distinctive(space)
    one, other = (space.unit(each)[:, columns] for each in (theta, others))
    found: FloatArray = cdist(one, other).min(axis=1) / np.sqrt(columns.sum())
    return found


class Benchmark(NamedTuple):
    """A generator's systems in a scenario, and the searches of each.

    Attributes:
        problem: with prior. plays: plays points with any system. pool: what recall is measured by.
            plans: of the systems.
        first: seed of the first system. methods: names that `row` knows. budget: runs of a search.
    """

    problem: SearchProblem
    plays: Plays
    pool: Pool
    plans: Sequence[Plan]
    first: int
    methods: Sequence[str]
    budget: int

    def planted(self, plan: Plan, seed: int) -> Planted:
        """The system of a plan and a seed."""
        assert self.problem.prior is not None
        return plant(plan, self.problem.space, self.problem.prior, self.plays, self.pool, seed)

    @property
    def marks(self) -> list[int]:
        """Numbers of runs after which a search is judged."""
        return sorted({*(mark for mark in MARKS if mark < self.budget), self.budget})

    def results(self, seeds: int, records: Records) -> Iterator[Result]:
        """Search, or read what is kept; a seed's searches work in lockstep."""
        known = {_key(each): each for each in records.read()[0]}
        for seed in range(self.first, self.first + seeds):
            missing = [
                (plan, name)
                for name in self.methods
                for plan in self.plans
                if (str(plan), name, seed, self.budget) not in known
            ]
            groups = [[each] for each in missing if each[1] in _ALONE]
            for group in ([each for each in missing if each[1] not in _ALONE], *groups):
                for entry in self._searched(group, seed):
                    records.add([entry])
                    known[_key(entry)] = entry
            for name in self.methods:
                for plan in self.plans:
                    for mark in self.marks:
                        entry = known[str(plan), name, seed, mark]
                        yield Result(
                            *_key(entry),
                            Found(*entry["found"]),
                            entry["seconds"],
                            Stated(*entry["stated"]),
                        )

    def _searched(self, group: Sequence[tuple[Plan, str]], seed: int) -> Iterator[dict[str, Any]]:
        """Search by methods for plans, all at once."""
        systems = [self.planted(plan, seed) for plan, _ in group]
        works = [
            self._work(each, name, seed) for each, (_, name) in zip(systems, group, strict=True)
        ]
        found = together(works, self.plays)
        for each, (plan, name), (history, spent, seconds) in zip(
            systems, group, found, strict=True
        ):
            for mark in self.marks:
                part = History(*history.first(int((spent <= mark).sum())))
                yield {
                    "plan": str(plan), "method": name, "seed": seed, "runs": mark,
                    "seconds": seconds,
                    "found": judged(each, self.problem, self.pool, part),
                    "stated": stated(each, self.problem, self.pool, part),
                }  # fmt: skip

    def _work(
        self, planted: Planted, name: str, seed: int
    ) -> Work[tuple[History, IntArray, float]]:
        def work(plays: Plays) -> tuple[History, IntArray, float]:
            system, charged, spent = replace(planted, plays=plays), 0, list[int]()

            def evaluate(theta: FloatArray) -> Outcomes:
                nonlocal charged
                spent.extend(range(charged + 1, charged + len(theta) + 1))
                charged += len(theta)
                return system(theta)

            def drivers(theta: FloatArray, sut: str) -> Outcomes:
                nonlocal charged
                charged += len(theta)
                return plays(theta, sut)

            def own(theta: FloatArray, sut: str | None = None) -> Outcomes:
                return system(theta) if sut is None else plays(theta, sut)

            judging = Judging(self.problem.space, drivers)
            posed = replace(
                self.problem,
                evaluate=evaluate,
                plays=own if name == PLAYED else None,
                judging=judging,
            )
            start = time.thread_time()
            history = row(name)(posed, self.budget, seed)
            return history, np.array(spent), time.thread_time() - start

        return work


def _key(entry: Mapping[str, Any]) -> tuple[str, str, int, int]:
    return entry["plan"], entry["method"], entry["seed"], entry["runs"]


def summary(found: Sequence[Result]) -> str:
    """A row for each method over all systems, in Markdown; several figures in a cell are those
    after each number of runs.

    Intervals are of 95 %, by bootstrap over systems.
    """
    runs = sorted({each.runs for each in found})
    marks = ", ".join(map(str, runs))
    lines = [
        f"| method | recall after {marks} runs | lead of `{OURS}` | regions found | nothing found "
        "| recall within 5 % | of the base | processor s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(each.method for each in found):
        of = [[each for each in found if (each.method, each.runs) == (name, mark)] for mark in runs]
        last = of[-1]

        def means(figure: str, parts: Sequence[Sequence[Result]]) -> str:
            return ", ".join(
                f"{np.mean([getattr(each.found, figure) for each in part]):.2f}" for part in parts
            )

        nothing = ", ".join(str(sum(each.found.regions == 0.0 for each in part)) for part in of)
        lines.append(
            f"| {name} | {means('far', of)} | {_lead(last, found)} | {means('regions', of)} "
            f"| {nothing} | {means('near', [last])} | {means('own', [last])} "
            f"| {np.mean([each.seconds for each in last]):.1f} |"
        )
    return "\n".join(lines)


def _lead(of: Sequence[Result], found: Sequence[Result]) -> str:
    """Mean lead in recall of `cover` over results of another method on the same systems."""
    ours = {
        (each.plan, each.seed, each.runs): each.found.far for each in found if each.method == OURS
    }
    keys = [(each.plan, each.seed, each.runs) for each in of]
    ahead = [ours[key] - each.found.far for key, each in zip(keys, of, strict=True) if key in ours]
    return _mean(np.array(ahead), "+.2f") if ahead and of[0].method != OURS else "–"


def table(found: Sequence[Result]) -> str:
    """A row for each number of runs and method over all systems, then for each plan after the last
    run, in Markdown.

    Intervals are of 95 %, by bootstrap over systems; the lead of `cover` is the difference in
    recall on the same systems.
    """
    lines = [
        "| planted | runs | method | systems | regions found | recall 5 % | recall 10 % | lead of "
        "`cover` | first failure "
        "| nothing found | not foreseeable | of the base | processor s |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    runs = sorted({each.runs for each in found})
    for mark in runs:
        lines += _rows("all", [each for each in found if each.runs == mark])
    for plan in dict.fromkeys(each.plan for each in found):
        lines += _rows(
            plan, [each for each in found if each.plan == plan and each.runs == runs[-1]]
        )
    return "\n".join(lines)


def _rows(plan: str, found: Sequence[Result]) -> Iterator[str]:
    for name in dict.fromkeys(each.method for each in found):
        of = [each for each in found if each.method == name]
        regions, near, far = (
            np.array([getattr(each.found, which) for each in of])
            for which in ("regions", "near", "far")
        )
        lead = _lead(of, found)
        first = np.median([each.found.first for each in of])
        nothing = sum(each.found.regions == 0.0 for each in of)
        strange, own, seconds = np.mean(
            [(each.found.strange, each.found.own, each.seconds) for each in of], axis=0
        )
        yield (
            f"| {plan} | {of[0].runs} | {name} | {len(of)} | {_mean(regions, '.2f')} | "
            f"{near.mean():.2f} | {_mean(far, '.2f')} "
            f"| {lead} | {first:.0f} | {nothing} | {strange:.2f} | {own:.2f} | {seconds:.1f} |"
        )


def statements(found: Sequence[Result]) -> str:
    """Share of wrong statements on failures that were not found, for each number of runs of
    `cover`."""
    lines = [
        (
            "| runs | true probability of what was missed, mean | stated bound, mean | statements "
            "below the truth |"
        ),
        "|---|---|---|---|",
    ]
    for mark in sorted({each.runs for each in found}):
        of = [each.stated for each in found if each.method == OURS and each.runs == mark]
        if of:
            missed, bound, below = np.mean(of, axis=0)
            lines.append(f"| {mark} | {missed:.2e} | {bound:.2e} | {below:.3f} |")
    return "\n".join(lines)


def _mean(values: FloatArray, form: str) -> str:
    low, high = interval(values)
    return f"{values.mean():{form}} ({low:{form}} to {high:{form}})"


def interval(values: FloatArray) -> tuple[float, float]:
    """95 % interval of a mean by bootstrap."""
    drawn = np.random.default_rng(0).choice(values, (2000, len(values))).mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)
