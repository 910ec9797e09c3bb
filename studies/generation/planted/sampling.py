"""Estimates of the probability of planted failures by as many plays: draws of the density, one draw
of each of cells of equal probability, and draws that a model of the first quarter chooses.

What a method costs beside its plays counts: its spread is that of estimates that take as long as
plain draws.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from sklearn.ensemble import RandomForestClassifier

from generation.search.methods.models import Frame
from generation.search.problem import Plays
from generation.space.density.prior import Prior
from schemas.common.array_types import BoolArray, FloatArray
from studies.generation.planted.designs import stratified
from studies.generation.planted.systems import UNDRIVEN, Plan, Planted

_FIRST = 4
"""One in so many plays is a draw that the model learns from"""
_CANDIDATES = 12
"""Draws that it chooses from, for each play"""
_FEWEST = 3
"""Failures that it learns from: with fewer it chooses at random"""
_TREES, _LEAF = 60, 2


class Played(NamedTuple):
    """Points of an estimate that were played undriven.

    Attributes:
        fails: whether each of some systems fails at points (k, n).
        weights: of the points; those of all methods have the mean 1 in expectation (n,).
        seconds: processor time beside the plays.
    """

    fails: BoolArray
    weights: FloatArray
    seconds: float


class Sampler:
    """Draws and plays points of a density for all systems of a space at once.

    Args:
        n: plays of an estimate; a power of 2 fills the cells with one draw each.
    """

    def __init__(
        self, prior: Prior, frame: Frame, plays: Plays, systems: Sequence[Planted], n: int
    ) -> None:
        self._prior, self._frame, self._plays = prior, frame, plays
        self._systems, self._n = systems, n
        self.played = 0
        self.seconds = 0.0

    def draws(self, generator: np.random.Generator) -> Iterator[Played]:
        """Draws of the density."""
        yield self._evenly(lambda: self._prior.sample(self._n, generator))

    def cells(self, generator: np.random.Generator) -> Iterator[Played]:
        """One draw of each of cells of equal probability."""
        yield self._evenly(lambda: stratified(self._prior, self._frame, self._n, generator))

    def chosen(self, generator: np.random.Generator) -> Iterator[Played]:
        """For each system the draws of a first quarter, and others by what a forest makes of it.

        Half of these are chosen evenly, half in proportion to the root of the probability of a
        failure, which is best for one that is known.
        """
        first = self._n // _FIRST
        start = time.process_time()
        drawn = self._prior.sample(first, generator)
        candidates = self._prior.sample(_CANDIDATES * self._n, generator)
        learned, asked = self._frame.coordinates(drawn), self._frame.coordinates(candidates)
        shared = time.process_time() - start
        failed = self._fails(drawn)
        for number, fails in enumerate(failed):
            start = time.process_time()
            share = np.full(len(candidates), 1.0 / len(candidates))
            if fails.sum() >= _FEWEST:
                forest = RandomForestClassifier(_TREES, min_samples_leaf=_LEAF, random_state=0)
                likely = np.sqrt(forest.fit(learned, fails).predict_proba(asked)[:, 1])
                if likely.any():
                    share = 0.5 * share + 0.5 * likely / likely.sum()
            rows = generator.choice(len(candidates), self._n - first, p=share)
            seconds = shared + time.process_time() - start
            later = self._fails(candidates[rows])[number]
            weights = 1.0 / (len(candidates) * share[rows])
            yield Played(
                np.concatenate([fails, later])[None],
                np.concatenate([np.ones(first), weights]),
                seconds,
            )

    def _evenly(self, draw: Callable[[], FloatArray]) -> Played:
        start = time.process_time()
        theta = draw()
        seconds = time.process_time() - start
        return Played(self._fails(theta), np.ones(len(theta)), seconds)

    def _fails(self, theta: FloatArray) -> BoolArray:
        start = time.process_time()
        undriven = self._plays(theta, UNDRIVEN)
        self.seconds, self.played = (
            self.seconds + time.process_time() - start,
            self.played + len(theta),
        )
        return np.array(
            [
                undriven.collision & each.within(theta, undriven).any(axis=0)
                for each in self._systems
            ]
        )


METHODS: Mapping[str, Callable[[Sampler, np.random.Generator], Iterator[Played]]] = {
    "draws": Sampler.draws,
    "cells": Sampler.cells,
    "chosen": Sampler.chosen,
}
"""Methods by name; the others are compared with the first"""


def estimates(
    sampler: Sampler, repeats: int, seed: int
) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Estimated probabilities (repeats, k) by each method, and its processor time beside the plays
    (s)."""
    found = {name: list[FloatArray]() for name in METHODS}
    spent = {name: list[float]() for name in METHODS}
    for repeat in range(repeats):
        for number, (name, method) in enumerate(METHODS.items()):
            parts = [*method(sampler, np.random.default_rng([seed, repeat, number]))]
            rows = [(part.fails * part.weights).mean(axis=1) for part in parts]
            found[name].append(np.concatenate(rows))
            spent[name] += [part.seconds for part in parts]
    return (
        {name: np.array(rows) for name, rows in found.items()},
        {name: float(np.mean(seconds)) for name, seconds in spent.items()},
    )


def table(
    plans: Sequence[Plan],
    found: Mapping[str, FloatArray],
    spent: Mapping[str, float],
    playing: float,
) -> str:
    """Coefficients of variation of each plan, and their ratio to that of draws at equal processor
    time, in Markdown.

    Args:
        playing: processor time of the plays of an estimate (s).
    """
    usual, *others = METHODS
    truth = np.mean([found[usual], found["cells"]], axis=(0, 1))
    spread = {name: rows.std(axis=0, ddof=1) / truth for name, rows in found.items()}
    lines = [f"| planted | probability | {' | '.join(METHODS)} |", "|---|---|---|---|---|"]
    for number, plan in enumerate(plans):
        cells = " | ".join(f"{spread[name][number]:.3f}" for name in METHODS)
        lines.append(f"| {plan} | {truth[number]:.2e} | {cells} |")
    lines += ["", "| method | beside plays, s | ratio of spreads at equal time |", "|---|---|---|"]
    lines.append(f"| {usual} | {spent[usual]:.2f} | 1 |")
    for name in others:
        longer = (playing + spent[name]) / (playing + spent[usual])
        logs = np.log(spread[name] / spread[usual]) + 0.5 * np.log(longer)
        drawn = np.random.default_rng(0).choice(logs, (2000, len(logs))).mean(axis=1)
        low, high = np.exp(np.quantile(drawn, [0.025, 0.975]))
        ratio = f"{np.exp(logs.mean()):.2f} ({low:.2f} to {high:.2f})"
        lines.append(f"| {name} | {spent[name]:.2f} | {ratio} |")
    return "\n".join(lines)
