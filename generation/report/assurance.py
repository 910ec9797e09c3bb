"""Assurance of a search: tested cells, parameters that decide failures, exposure, versions, and
sentences on what the search can and cannot say, each filled from its runs."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from generation.estimation.estimate import FAILURE
from generation.estimation.probability import Driving
from generation.pipeline import Generated, system_digest
from generation.search.gate import Share
from generation.search.methods.models import differences, evenly
from generation.search.settings import SearchSettings
from generation.space.space import Space, distinctive
from runner.batch.inputs import OURS, files, program
from runner.systems import system_name
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.packages import MissingExtra, optional
from schemas.common.storage import fingerprint
from schemas.common.terminal.text import many

_PARTS, _DRAWN, _TAIL = 5, 10_000, 0.005
"""Parts of each parameter's range, draws that say which cells traffic reaches, and share of these
beyond the range on each side"""
_NAMED = 8
"""Untested cells that are named, the likeliest first"""
_FEWEST = 20
"""Failures, and other runs, that a model of failures needs"""
_REFITTED, _TREES, _LEARNT, _POINTS = 20, 40, 1000, 512
"""Models, each of runs drawn with replacement; trees of each, runs that it learns from, and base
points of its indices, a power of 2"""
_DECIDE_NOTHING = ("run", "processes", "ray", "every", "overwrite")
"""Settings that decide no result, and those of runs"""
_LIBRARIES = ("numpy", "scipy", "scikit-learn", "libsumo", "eclipse-sumo")


class Cell(NamedTuple):
    """A cell of two parameters: their names, the limits of both, its share of draws."""

    names: tuple[str, str]
    limits: tuple[tuple[float, float], tuple[float, float]]
    share: float

    def __str__(self) -> str:
        sides = (
            f"{name} {low:.3g} to {high:.3g}"
            for name, (low, high) in zip(self.names, self.limits, strict=True)
        )
        return f"{', '.join(sides)} ({self.share:.2%} of draws)"


@dataclass(frozen=True)
class Coverage:
    """Cells of each two parameters that runs have tested.

    The range of a parameter that holds 99 % of the density's draws has `_PARTS` equal parts, or one
    for each value of a set. Cells without a foreseeable draw are left out.

    R. Kuhn, R. Kacker, Y. Lei, Practical combinatorial testing, NIST SP 800-142, 2010.

    Attributes:
        pairs: of parameters. cells: that the density reaches. tested: of these, with a run.
        failing: of these, with a failure.
        least: share of draws in tested cells, of the pair with the least.
        untested: the likeliest cells without a run.
    """

    pairs: int
    cells: int
    tested: int
    failing: int
    least: float
    untested: tuple[Cell, ...]

    def __str__(self) -> str:
        if not self.pairs:
            return "one parameter alone is searched: there are no cells of two"
        return (
            f"{self.tested} of {many(self.cells, 'cell')} of two parameters are tested "
            f"({self.tested / max(self.cells, 1):.1%}), {self.failing} with a failure; they hold "
            f"at least {self.least:.2%} of the density"
        )


def coverage(generated: Generated) -> Coverage:
    """Count the tested cells of a search."""
    space, generator = generated.space, np.random.default_rng(0)
    drawn = generated.prior.sample(_DRAWN, generator)
    # Cells that only far tails of the density reach would never be tested, and count as a lack.
    drawn = drawn[generated.prior.foreseeable(drawn)]
    # Of parameters that tell cases apart: a start time has cells, and no meaning.
    told = np.flatnonzero(distinctive(space)).tolist()
    outcomes = generated.episodes.outcomes
    ran = generated.episodes.theta[outcomes.executed]
    failed = outcomes.collision[outcomes.executed]
    sides = {column: _Ranges.of(space, column, drawn) for column in told}
    places = {column: (side.at(drawn), side.at(ran)) for column, side in sides.items()}
    pairs = list(combinations(told, 2))
    cells = tested = failing = 0
    least, untested = 1.0, list[Cell]()
    for one, other in pairs:
        shape = len(sides[one].limits), len(sides[other].limits)
        reached, run, fails = (
            _counted(places[one][which][rows], places[other][which][rows], shape)
            for which, rows in ((0, slice(None)), (1, slice(None)), (1, failed))
        )
        there = reached > 0
        cells += int(there.sum())
        tested += int((there & (run > 0)).sum())
        failing += int((there & (fails > 0)).sum())
        shares = reached / max(len(drawn), 1)
        # By weight: a single untested cell may hold half of the density.
        least = min(least, float(shares[run > 0].sum()))
        for row, column in zip(*np.nonzero(there & (run == 0)), strict=True):
            limits = sides[one].limits[row], sides[other].limits[column]
            names = space.names[one], space.names[other]
            untested.append(Cell(names, limits, float(shares[row, column])))
    untested.sort(key=lambda cell: -cell.share)
    return Coverage(len(pairs), cells, tested, failing, least, tuple(untested[:_NAMED]))


class _Ranges(NamedTuple):
    """Parts of a parameter's range: its column, their limits, and the values that begin them."""

    column: int
    limits: tuple[tuple[float, float], ...]
    begins: FloatArray

    @classmethod
    def of(cls, space: Space, column: int, drawn: FloatArray) -> _Ranges:
        choices = space.choices.get(space.names[column])
        # A set of more values is cut into parts like a range; each value of one would be a cell.
        if choices is not None and len(choices) <= _PARTS:
            # Search points lie between values and stand for the nearest.
            middles = (np.array(choices[1:]) + np.array(choices[:-1])) / 2.0
            return cls(column, tuple((value, value) for value in choices), middles)
        values = drawn[:, column] if len(drawn) else np.array([space.low[column]])
        low, high = np.quantile(values, [_TAIL, 1.0 - _TAIL]).tolist()
        edges = np.linspace(low, high, _PARTS + 1)
        limits = zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        return cls(column, tuple(limits), edges[1:-1])

    def at(self, theta: FloatArray) -> IntArray:
        """Part (n,) of each point (n, d); what is beyond the range belongs to its ends."""
        return np.searchsorted(self.begins, theta[:, self.column], "right")


def _counted(one: IntArray, other: IntArray, shape: tuple[int, int]) -> IntArray:
    """Number of points in each cell."""
    counts = np.zeros(shape, np.int64)
    # `counts[one, other] += 1` would count points of the same cell once.
    np.add.at(counts, (one, other), 1)
    return counts


@dataclass(frozen=True)
class Sensitivity:
    """Sobol indices of failure: the share of its variance that a parameter explains alone, and with
    all others.

    They are of models of the runs, at points where parameters vary independently and evenly within
    the range that holds 99 % of the density's draws; intervals of 95 % are those of models of runs
    drawn anew.

    A. Saltelli and others, Variance based sensitivity analysis of model output, Computer Physics
    Communications 181, 2010.

    Attributes:
        first, total: index with its interval by parameter, the greatest total first.
        explained: share of the variance of runs that a model explains which did not learn from
            them.
    """

    first: Mapping[str, tuple[float, float, float]]
    total: Mapping[str, tuple[float, float, float]]
    explained: float

    def __str__(self) -> str:
        told = (
            f"{name} {value:.2f} ({low:.2f} to {high:.2f})"
            for name, (value, low, high) in list(self.total.items())[:3]
        )
        return (
            f"failures depend most on {', '.join(told)} (total Sobol indices of models that "
            f"explain {max(self.explained, 0.0):.0%} of the variance of other runs)"
        )


def sensitivity(generated: Generated) -> Sensitivity | str:
    """Sobol indices of failure, or the reason why there are none."""
    space, outcomes = generated.space, generated.episodes.outcomes
    failing = outcomes.collision[outcomes.executed]
    failures, others = int(failing.sum()), int((~failing).sum())
    if min(failures, others) < _FEWEST:
        return (
            f"{many(failures, 'failure')} and {many(others, 'other run')}: {_FEWEST} of each make "
            "a model of what failures depend on"
        )
    told = np.flatnonzero(distinctive(space))
    drawn = space.unit(generated.prior.sample(_DRAWN, np.random.default_rng(0)))[:, told]
    low, high = np.quantile(drawn, [_TAIL, 1.0 - _TAIL], axis=0)
    # A parameter without spread has a distribution without width, and so no index.
    told, low, high = told[high > low], low[high > low], high[high > low]
    if len(told) < 2:
        return "one parameter alone varies in the density's draws"
    # The rarer outcome is kept whole: a model of passes alone explains nothing.
    rows = evenly(failing, _LEARNT)
    x = space.unit(generated.episodes.theta[outcomes.executed])[np.ix_(rows, told)]
    try:
        forests = optional("sklearn.ensemble")
    except MissingExtra as error:  # methods without a model do without it
        return str(error)
    indices, explained = _indices(forests, x, failing[rows].astype(float), low, high)
    if not len(indices):
        return "failures do not depend on one parameter more than on chance, by models of the runs"
    # Median over the models: single models' have outliers where little depends on anything.
    value = np.median(indices, axis=0)
    least, most = np.quantile(indices, [0.025, 0.975], axis=0)
    # By the total index: a parameter that decides only together with another has no first one.
    order = np.argsort(-value[1])
    first, total = (
        {
            space.names[told[place]]: (
                float(value[kind, place]),
                float(least[kind, place]),
                float(most[kind, place]),
            )
            for place in order
        }
        for kind in (0, 1)
    )
    return Sensitivity(first, total, explained)


def _indices(
    forests: Any, x: FloatArray, values: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, float]:
    """First and total indices (m, 2, d) of models of rows (n, d) drawn with replacement, and the
    share of variance that they explain at the other rows."""
    from scipy.stats import sobol_indices, uniform

    dists = [uniform(a, b - a) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    refitted, explained = list[FloatArray](), list[float]()
    for number in range(_REFITTED):
        generator = np.random.default_rng(number)
        learnt = generator.integers(len(x), size=len(x))
        forest = forests.ExtraTreesRegressor(_TREES, random_state=number)
        # Differences of parameters too, or no tree finds that two speeds matter by their
        # difference.
        forest.fit(differences(x[learnt]), values[learnt])
        # About a third of the runs is in no sample: they test the model without being spent.
        left = np.setdiff1d(np.arange(len(x)), learnt)
        error = values[left] - forest.predict(differences(x[left]))
        explained.append(
            1.0 - float(error @ error) / max(float(values[left].var() * len(left)), 1e-12)
        )
        with np.errstate(all="ignore"):  # a model without variance has no indices
            predict = partial(_predicted, forest)
            one = sobol_indices(func=predict, n=_POINTS, dists=dists, rng=generator)
        indices = np.stack([one.first_order, one.total_order])
        if np.isfinite(indices).all():
            refitted.append(indices)
    return np.array(refitted), float(np.mean(explained))


def _predicted(forest: Any, points: FloatArray) -> FloatArray:
    """Prediction (n,) of a forest at points (d, n)."""
    predicted: FloatArray = forest.predict(differences(points.T))
    return predicted


@dataclass(frozen=True)
class Assurance:
    """See the module.

    Attributes:
        coverage: of cells. sensitivity: of failure, or why there is none.
        exposure: of the manoeuvre, or why it is not known.
        versions: by library. digests: of the inputs.
        can, cannot: sentences.
    """

    coverage: Coverage
    sensitivity: Sensitivity | str
    exposure: Driving | str
    versions: Mapping[str, str]
    digests: Mapping[str, str]
    can: tuple[str, ...]
    cannot: tuple[str, ...]

    @classmethod
    def of(cls, scenario: Path, generated: Generated, settings: SearchSettings) -> Assurance:
        """Build from a search."""
        covered, decides = coverage(generated), sensitivity(generated)
        can = tuple(_can(generated, covered, decides))
        cannot = tuple(_cannot(generated, settings, covered))
        # Of libraries that compute results; those that draw and read are left out.
        versions = {"xosc-toolchain": version("xosc-toolchain")}
        versions |= {"python": platform.python_version()}
        for name in _LIBRARIES:
            with suppress(PackageNotFoundError):
                versions[name] = version(name)
        digests = _digests(scenario, generated, settings)
        return cls(covered, decides, generated.driving, versions, digests, can, cannot)

    def lines(self) -> Iterator[str]:
        """Yield what the terminal shows."""
        yield str(self.coverage)
        if isinstance(self.sensitivity, Sensitivity):
            yield str(self.sensitivity)
        if isinstance(self.exposure, Driving):
            met = (
                f"{rate.value:,.3g} ({rate.interval[0]:,.3g} to {rate.interval[1]:,.3g}) {name}"
                for name, rate in self.exposure.met.items()
            )
            yield f"exposure: manoeuvres {self.exposure.kind}: {', '.join(met)}"

    def as_json(self) -> dict[str, Any]:
        """Return it as a JSON object, for files and the page."""
        decides, exposure = self.sensitivity, self.exposure
        driven = exposure.as_json() if isinstance(exposure, Driving) else exposure
        return {
            "can": list(self.can),
            "cannot": list(self.cannot),
            "coverage": asdict(self.coverage)
            | {"parts": _PARTS, "untested": [str(cell) for cell in self.coverage.untested]},
            "sensitivity": asdict(decides) if isinstance(decides, Sensitivity) else decides,
            "exposure": driven,
            "versions": dict(self.versions),
            "digests": dict(self.digests),
        }


def _can(generated: Generated, covered: Coverage, decides: Sensitivity | str) -> Iterator[str]:
    """Yield sentences on what the runs show."""
    outcomes, repeats = generated.episodes.outcomes, generated.cases.repeats
    failures = int((outcomes.executed & outcomes.collision).sum())
    if repeats is not None and len(repeats.again):
        again = int(repeats.again.sum())
        yield (
            f"{again} of {many(len(repeats.again), 'failure')} among the edge cases failed again "
            "with the same values and seed: anyone can play them from the files"
        )
    elif failures:
        yield f"{many(failures, 'run')} failed, at values that are in the files"
    if generated.statement.draws:
        yield generated.stated
    estimate = generated.estimate
    if estimate is not None and estimate.probabilities[FAILURE].stable:
        yield f"a failure has a probability of {estimate.probabilities[FAILURE]} under this density"
    yield str(covered)
    if isinstance(decides, Sensitivity):
        yield str(decides)


def _cannot(generated: Generated, settings: SearchSettings, covered: Coverage) -> Iterator[str]:
    """Yield sentences on what the runs leave open."""
    space, gate, recorded = generated.space, generated.gate, generated.recorded
    yield (
        f"anything outside the ranges of {', '.join(space.names)}"
        + (f", or at other values of {', '.join(space.pinned)}" if space.pinned else "")
    )
    if gate.replayed is None:
        yield "how likely a failure is in traffic: the density is stated, in whole or in part"
    elif gate.refusal is not None:
        yield f"which failures are foreseeable: {gate.refusal}"
    else:
        traffic = "simulated traffic" if recorded.simulated else "traffic"
        places = len(set(recorded.recordings.tolist()))
        yield f"{traffic} unlike that of the {many(places, 'recording')} behind the density"
        if not gate.testable:
            yield "whether the density is that of the recordings: too few replays test it"
    if covered.tested < covered.cells:
        some = covered.untested[0]
        yield f"{many(covered.cells - covered.tested, 'cell')} without a run, the likeliest: {some}"
    estimate = generated.estimate
    if estimate is None:
        yield "how often the system fails: --estimate measures it"
    elif not estimate.probabilities[FAILURE].stable:
        yield "how often the system fails: too few effective failures"
    if isinstance(generated.driving, str):
        yield f"rates per hour or kilometre: {generated.driving}"
    if settings.repeat == 0:
        yield "the effect of chance: values ran with one seed, --repeat N runs failures with others"
    yield (
        f"failures of another kind than {' or '.join(('collisions', *generated.limits))}: "
        "--fail-if names others"
    )
    yield (
        f"what a driver other than {' and '.join(generated.cases.judges)} prevents, and what the "
        "others would do: they keep to the scenario, whatever the ego does"
    )
    outcomes = generated.episodes.outcomes
    lost = Share(int((~outcomes.executed).sum()), len(outcomes))
    if lost.collisions:
        runs = many(lost.runs, "run")
        yield f"{lost.collisions} of {runs}, which ended with errors or tested nothing"
    if generated.cut:
        yield "what more time would have found: the time ended the search"


def _digests(scenario: Path, generated: Generated, settings: SearchSettings) -> dict[str, str]:
    """Digests of what a search was made of, by subject."""
    recorded = generated.recorded
    chosen = [
        (setting.name, getattr(settings, setting.name))
        for setting in fields(settings)
        if setting.name not in _DECIDE_NOTHING
    ]
    # As JSON has them: a system that is an object would print its address.
    chosen.append(("run", settings.run.as_json()))
    inputs = files(scenario, settings.run, generated.space.pinned)
    # Values and whose they are: the same values of other recordings are another density's test.
    units = recorded.theta.tobytes() + repr(recorded.recordings.tolist()).encode()
    return {
        f"scenario {scenario.name}": inputs["scenario"],
        **inputs["roads and catalogues"],
        f"system {system_name(settings.run.sut)}": system_digest(scenario, settings.run),
        f"{many(len(recorded.theta), 'recorded unit')}": fingerprint(units),
        "settings": fingerprint(repr(chosen).encode()),
        "program": program((*OURS, "recognition", "generation")),
    }
