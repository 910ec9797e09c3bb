"""Search problem: its reward, calls of the simulator within a budget, and runs remembered between
searches.

A search is deterministic given the answers of the simulator. So its own state (networks,
populations, generators) is not stored: a resumed search starts anew, is answered from memory up to
the point of interruption, and continues.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from generation.search.methods import Method, offered
from generation.search.methods.judging import Judging
from generation.search.outcomes import (
    JUDGES,
    NOTHING,
    Drivers,
    Episodes,
    Evaluate,
    Outcomes,
    joined,
)
from generation.space.density.base import Density
from generation.space.density.prior import Prior, fitted, held_out
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import InvalidFile, UsageError, guess
from schemas.common.storage import Records, writing

COLLISION, SAFE, RISK = 0.25, -0.1, 0.2
"""Rewards of a collision, of a scenario without any risk, and of R_risk = 1 in addition to that."""
Criticality = Callable[[Outcomes], FloatArray]
"""Reward (n,) without realism."""


def additive(outcomes: Outcomes) -> FloatArray:
    """−0.1 + 0.2·R_risk, and 0.25 for a collision on top: of two collisions the one that was
    dangerous all along counts more.

    An episode that failed counts as one without any risk.
    """
    return SAFE + RISK * outcomes.r_risk + COLLISION * outcomes.collision


@dataclass(frozen=True, eq=False)
class Realism:
    """Implausibility of parameters, from 0 for common traffic to 1.

    clip((NLL − Q99) / IQR, 0, 1), NLL = −log p(θ). Q99 and IQR are those of the training samples,
    each by the density of the other recordings: by a density that holds its own kernel a sample
    seems far more likely than any new one ever can.

    Attributes:
        density: p. limit: Q99. scale: IQR.
    """

    density: Density
    limit: float
    scale: float

    @classmethod
    def fitted(cls, name: str, theta: FloatArray, recordings: NDArray[np.str_]) -> Realism:
        """Fit the density to recorded parameters (n, d).

        Args:
            name: of the density (`generation.space.density.models`).
            recordings: of each row (n,).

        Raises:
            UsageError: there is no such density, or the rows hold none.
        """
        return cls.of(fitted(name, theta, recordings), held_out(name, theta, recordings))

    @classmethod
    def of(cls, density: Density, held_out: FloatArray) -> Realism:
        """Limits by held-out log-densities (n,) of the training samples.

        Raises:
            UsageError: they are all the same.
        """
        low, high, limit = np.quantile(-held_out, [0.25, 0.75, 0.99])
        if not high > low:
            raise UsageError(
                "held-out likelihoods of the samples do not differ: they set no scale for realism"
            )
        return cls(density, float(limit), float(high - low))

    def judged(self, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Log-densities (n,) of rows (n, d), and which of them are plausible: NLL ≤ Q99, so that
        they have no excess."""
        densities = self.density.log_density(theta)
        return densities, -densities <= self.limit

    def excess(self, theta: FloatArray) -> FloatArray:
        """max((NLL − Q99) / IQR, 0) of rows (n, d): (n,)."""
        return np.maximum((-self.density.log_density(theta) - self.limit) / self.scale, 0.0)

    def penalty(self, theta: FloatArray) -> FloatArray:
        """Return the penalties of rows (n, d): (n,) in 0 … 1."""
        return np.minimum(self.excess(theta), 1.0)


@dataclass(frozen=True, eq=False)
class Reward:
    """Criticality minus weight times implausibility.

    Attributes:
        realism: how implausible.
        weight: w; 0 leaves realism out.
        criticality: reward without realism.
    """

    realism: Realism
    weight: float = 0.2
    criticality: Criticality = additive

    def __call__(self, theta: FloatArray, outcomes: Outcomes) -> FloatArray:
        """Rewards (n,) of rows (n, d) and their outcomes."""
        critical = self.criticality(outcomes)
        return critical - self.weight * self.realism.penalty(theta) if self.weight else critical


BATCH = 50
"""Points asked for at a time, wherever a method has no number of its own."""


class Plays(Protocol):
    """Plays points of a space without a simulator; `generation.search.plays.ArrayPlays` does."""

    def __call__(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        """The outcomes at points (n, d), driven by the problem's system under test, or by the one
        of a name."""
        ...


def unlimited(share: float) -> float:
    """Points that can be played in a share of time without an end."""
    return math.inf


class History(Episodes):
    """All episodes of a search, in their order."""

    def save(self, path: Path) -> None:
        """Write it whole or not at all."""
        draft = path.with_suffix(".draft")
        with draft.open("wb") as file:
            np.savez_compressed(
                file, theta=self.theta, rewards=self.rewards, **asdict(self.outcomes)
            )
        draft.replace(path)

    @classmethod
    def load(cls, path: Path) -> History:
        """Read what `save` wrote.

        Raises:
            InvalidFile: it is something else.
        """
        try:
            with np.load(path, allow_pickle=False) as arrays:
                outcomes = Outcomes(
                    **{field.name: arrays[field.name] for field in fields(Outcomes)}
                )
                return cls(arrays["theta"], outcomes, arrays["rewards"])
        # A file cut short, or of another kind, fails in numpy, zipfile or zlib, depending on where.
        except (
            OSError,
            ValueError,
            TypeError,
            KeyError,
            EOFError,
            RuntimeError,
            BadZipFile,
            zlib.error,
        ) as error:
            raise InvalidFile(
                f"this is no search's history ({error}); remove it to have it made again", path=path
            ) from None


@dataclass
class Guidance:
    """Record of a method's choices while it searches.

    Attributes:
        guided: runs that earlier ones led to. drawn: runs that are draws of the density.
        saturated: whether it ended before its budget, since nothing new failed for long.
    """

    guided: int = 0
    drawn: int = 0
    saturated: bool = False

    def __str__(self) -> str:
        runs = self.guided + self.drawn
        return (
            f"{self.guided} of these runs ({self.guided / max(runs, 1):.0%}) guided by earlier "
            f"ones or plays, {self.drawn} drawn"
        )


@dataclass(frozen=True, eq=False)
class SearchProblem:
    """One search problem, the same for all methods.

    Attributes:
        space: the box of θ.
        evaluate: runs scenarios; what it is asked for counts against the budget.
        reward: what MCSG is after; its density says what is plausible.
        real: parameters (n, d) extracted from recordings, within the box.
        found: critical points (m, d) that earlier searches of the same space have found; None for
            none.
        prior: what traffic does in this space; None where only the published reward is asked for.
        plays: plays points without a simulator, with any system under test; None where there is
            none.
        judging: judges failures before the search learns from them, within the budget; None where
            all failures count alike.
        guidance: record that a method keeps, if it tells guided runs from draws.
        judges: names of the drivers that decide what is preventable in plays.
        room: points that can be played in a share of the time that is left.
    """

    space: Space
    evaluate: Evaluate
    reward: Reward
    real: FloatArray
    found: FloatArray | None = None
    prior: Prior | None = None
    plays: Plays | None = None
    judging: Judging | None = None
    guidance: Guidance = field(default_factory=Guidance)
    room: Callable[[float], float] = unlimited
    judges: Sequence[str] = JUDGES

    @property
    def starts(self) -> FloatArray:
        """Return the starting points of a search (k, d): earlier finds, else real scenarios."""
        return self.real if self.found is None else self.found


Search = Callable[[SearchProblem, int, int], History]
"""Spends a budget of simulator calls on a problem, all that is drawn by a seed."""


def method(name: str, methods: Mapping[str, Method] | None = None) -> Search:
    """The search of that name.

    Args:
        name: of the method.
        methods: where it is looked for; those of `xosc-generate` where it is None.

    Raises:
        UsageError: no method has that name.
    """
    methods = offered() if methods is None else methods
    if name not in methods:
        raise UsageError(
            f"there is no search method {name!r}; {guess(name, methods)}methods: "
            f"{', '.join(methods)}"
        )
    search: Search = getattr(import_module(methods[name].module), name.replace("-", "_"))
    return search


class Calls:
    """The simulator calls of one search: spends the budget, and keeps the outcomes.

    Args:
        problem: the problem.
        budget: how many points may be evaluated in all.
    """

    def __init__(self, problem: SearchProblem, budget: int) -> None:
        self.problem, self.left = problem, budget
        self._parts: list[Episodes] = []

    def __call__(self, theta: FloatArray) -> Episodes:
        """Evaluate the points (n, d), brought into the box; only the first ones, where the budget
        ends before them."""
        # Clipped before the run, so that history and files hold the values that were run.
        theta = self.problem.space.clip(np.asarray(theta, dtype=np.float64)[: self.left])
        outcomes = self.problem.evaluate(theta)
        self.left -= len(theta)
        self._parts.append(Episodes(theta, outcomes, self.problem.reward(theta, outcomes)))
        return self._parts[-1]

    def prevented(self, episodes: Episodes) -> BoolArray:
        """Failures among episodes that a judge prevents (n,); all of them where the problem has no
        judges."""
        failing, judging = (
            episodes.outcomes.collision & episodes.outcomes.executed,
            self.problem.judging,
        )
        if judging is not None and failing.any():
            before = judging.runs
            failing[failing] = judging(episodes.theta[failing], self.left)
            self.left -= judging.runs - before
        return failing

    @property
    def history(self) -> History:
        """All episodes so far."""
        if not self._parts:
            return History(
                np.empty((0, len(self.problem.space.parameters))), Outcomes.of(0), np.empty(0)
            )
        thetas, outcomes, rewards = zip(*self._parts, strict=True)
        return History(np.concatenate(thetas), joined(outcomes), np.concatenate(rewards))


def counted(evaluate: Evaluate, progress: Callable[[int], None]) -> Evaluate:
    """Evaluate, and call `progress` with the number of points each time."""

    def evaluating(theta: FloatArray) -> Outcomes:
        outcomes = evaluate(theta)
        progress(len(theta))
        return outcomes

    return evaluating


def counted_drivers(drivers: Drivers, progress: Callable[[int], None]) -> Drivers:
    """Drive, and call `progress` with the number of points each time."""

    def driving(theta: FloatArray, sut: str) -> Outcomes:
        return counted(lambda rows: drivers(rows, sut), progress)(theta)

    return driving


class Memory:
    """An evaluator that remembers.

    Args:
        evaluate: answers what was not asked before.
        path: records of the points (see `schemas.common.storage.Records`), each kept as soon as
            there is an answer. Damaged ones are removed, and their points are asked again.

    Attributes:
        reused: how many answers came from memory.
        damaged: how many records were.

    Raises:
        InvalidFile: the file holds something else.
        UsageError: the file can't be read, or damaged records can't be removed.
    """

    def __init__(self, evaluate: Evaluate, path: Path) -> None:
        self._evaluate, self._path, self.reused = evaluate, path, 0
        self._records = Records(path)
        with writing("this", path):
            entries, damaged = self._records.read()
            if damaged:
                self._records.replace(entries)
        self.damaged = len(damaged)
        if any(entry.keys() != {"theta", *NOTHING} for entry in entries):
            raise InvalidFile(
                "these are no simulator calls; remove the file to begin anew", path=path
            )
        self._places: dict[bytes, tuple[int, int]] = {}
        self._blocks: list[tuple[FloatArray, Outcomes]] = []
        # A point may be there twice: the last record counts.
        entries = list({tuple(entry["theta"]): entry for entry in entries}.values())
        if entries:
            self._keep(
                np.array([entry["theta"] for entry in entries], np.float64), _outcomes(entries)
            )

    def __call__(self, theta: FloatArray) -> Outcomes:
        """Outcomes of points (n, d)."""
        theta = np.ascontiguousarray(theta, np.float64)
        # Bytes, not rounded values: an answer counts for exactly the point that was run.
        keys = [row.tobytes() for row in theta]
        # Backwards, so that of equal rows in one request the first one is asked.
        missing = {
            key: number
            for number, key in reversed(list(enumerate(keys)))
            if key not in self._places
        }
        self.reused += len(keys) - len(missing)
        if missing:
            self._ask(theta[sorted(missing.values())])
        places = [self._places[key] for key in keys]
        if not places:
            return Outcomes.of(0)
        parts, order = list[Outcomes](), list[int]()
        # Answers lie in blocks, one for each request; gathering by block copies columns instead of
        # values.
        for block in dict.fromkeys(block for block, _ in places):
            numbers = [number for number, (of, _) in enumerate(places) if of == block]
            parts.append(
                self._blocks[block][1].take(np.array([places[number][1] for number in numbers]))
            )
            order += numbers
        return joined(parts).take(np.argsort(order))

    @property
    def everything(self) -> tuple[FloatArray, Outcomes]:
        """All points that are remembered (m, d), and their outcomes."""
        if not self._blocks:
            return np.array([]), Outcomes.of(0)
        thetas, outcomes = zip(*self._blocks, strict=True)
        return np.concatenate(thetas), joined(outcomes)

    def episodes(self, reward: Reward) -> Episodes:
        """All points that are remembered, with their outcomes and rewards."""
        theta, outcomes = self.everything
        return Episodes(theta, outcomes, reward(theta, outcomes) if len(theta) else np.empty(0))

    def _ask(self, theta: FloatArray) -> None:
        outcomes = self._evaluate(theta)
        columns = {name: getattr(outcomes, name).tolist() for name in NOTHING}
        with writing("this", self._path):
            self._records.add(
                {
                    "theta": row,
                    **{name: _finite(values[number]) for name, values in columns.items()},
                }
                for number, row in enumerate(theta.tolist())
            )
        self._keep(theta, Outcomes.of(len(theta), **columns))

    def _keep(self, theta: FloatArray, outcomes: Outcomes) -> None:
        """Remember points (n, d) as columns: a hundred thousand of them take some 50 MB."""
        self._places.update(
            (row.tobytes(), (len(self._blocks), number)) for number, row in enumerate(theta)
        )
        self._blocks.append((theta, outcomes))


def _outcomes(entries: list[dict[str, Any]]) -> Outcomes:
    return Outcomes.of(
        len(entries), **{name: [entry[name] for entry in entries] for name in NOTHING}
    )


def _finite(value: Any) -> Any:
    """A value as records hold it: texts for infinite numbers, which `Outcomes.of` reads as numbers
    again."""
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value
