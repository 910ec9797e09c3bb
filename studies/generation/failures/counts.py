"""Counted failures: on SUMO, foreseeable, preventable, and distinct."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import ttest_rel

from generation.outcomes.judges import survivors
from generation.outcomes.outcomes import Evaluator
from generation.search.problem import History
from generation.search.space import distinctive, diverse
from generation.settings import Choice
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import UsageError
from schemas.common.storage import read_object, write_object
from studies.generation.failures.problem import Posed
from studies.generation.methods import METHODS
from studies.recognition.report.tables import Table, spread


@dataclass(frozen=True)
class Counts:
    """Of one search.

    Attributes:
        runs: of the system under test that the search has spent.
        played: points that the twin has played besides, to say which are worth a run.
        collisions: runs with a collision. foreseeable: of these. preventable: of these again.
        confirmed: of the preventable ones, those that are so on SUMO: the system fails, a judge survives.
        distinct: confirmed ones that are apart by all parameters. essential: by those that are no nuisances.
    """

    runs: int
    played: int
    collisions: int
    foreseeable: int
    preventable: int
    confirmed: int
    distinct: int
    essential: int


def counted(history: History, posed: Posed, played: int = 0) -> Counts:
    """Judge a search; runs on SUMO that confirm a search on the twin, and those of reference drivers, are none of its budget."""
    problem, theta = posed.problem, history.theta
    assert problem.prior is not None
    collided = history.outcomes.collision & history.outcomes.executed
    foreseen = collided.copy()
    foreseen[collided] = problem.prior.foreseeable(theta[collided])
    on_sumo = problem.evaluate is posed.sumo
    found = theta[foreseen][survivors(theta[foreseen], posed.sumo if on_sumo or problem.twin is None else problem.twin)]
    confirmed = found if on_sumo else found[_confirmed(found, posed.sumo)]
    unit, least = problem.space.unit(confirmed), Choice().apart
    told = distinctive(problem.space)
    numbers = len(diverse(unit, least)), len(diverse(unit[:, told], least))
    return Counts(len(theta), played, int(collided.sum()), int(foreseen.sum()), len(found), len(confirmed), *numbers)


def _confirmed(theta: FloatArray, sumo: Evaluator) -> BoolArray:
    """The points (n,) of (n, d) that fail on SUMO, and that a judge survives there."""
    outcomes = sumo(theta)
    found = outcomes.collision & outcomes.executed
    found[found] = survivors(theta[found], sumo)
    return found


def path_of(out: Path, scenario: Path, sut: str, method: str, seed: int) -> Path:
    """The file of one search's counts."""
    return out / scenario.stem / sut / f"{method}-{seed}.json"


def save(counts: Counts, path: Path, budget: int) -> None:
    """Write them, with the budget that they are of."""
    write_object({"budget": budget, **asdict(counts)}, path)


def table(out: Path, budget: int) -> Table:
    """All that is in a folder.

    Raises:
        UsageError: it holds results of another budget.
    """
    found: dict[tuple[str, str, str], dict[str, Counts]] = {}
    for path in sorted(out.glob("*/*/*.json")):
        values = read_object(path)
        if values.pop("budget") != budget:
            raise UsageError(f"this is of another budget than {budget}: give the same, or another folder", path=path)
        method, _, seed = path.stem.rpartition("-")
        found.setdefault((path.parent.parent.name, path.parent.name, method), {})[seed] = Counts(**values)
    rows = [
        (*key, str(len(each)), *_cells([*each.values()], budget))
        for key, each in sorted(found.items(), key=lambda item: _order(item[0]))
    ]
    note = (
        "Mean ± standard deviation over seeds; all but runs and played are per 1,000 runs of the budget: a search that ends "
        "earlier finds nothing in the rest. Played: points of the twin that screened proposals. Foreseeable and preventable: of "
        "the collisions. Confirmed: of these, share that fails on SUMO where a judge survives. Distinct: of the confirmed ones, "
        "pairwise further apart than 5 % of the ranges, root mean square over all parameters, and over those that are no "
        "nuisances (start and rest time)." + "".join(_ratios(found))
    )
    return Table("failures", "Distinct foreseeable and preventable failures", note, (*_KEYS, *_FIGURES), rows)


def _ratios(found: Mapping[tuple[str, str, str], Mapping[str, Counts]]) -> Iterator[str]:
    """Yield the ratios of distinct failures without nuisances between the default method and each other one, with a paired t
    test over their common seeds."""
    for (scenario, system, name), each in sorted(found.items(), key=lambda item: _order(item[0])):
        own = found.get((scenario, system, REFERENCE), {})
        seeds = sorted(own.keys() & each.keys())
        if name == REFERENCE or len(seeds) < 2:
            continue
        ours, theirs = ([one[seed].essential for seed in seeds] for one in (own, each))
        ratio = f"{sum(ours) / sum(theirs):.1f} times as many as" if sum(theirs) else "and none by"
        p = ttest_rel(ours, theirs).pvalue
        yield f" {scenario}, {system}: {REFERENCE} finds {ratio} {name} (paired t test, {len(seeds)} seeds, p = {p:.2g})."


_KEYS = ("scenario", "system", "method", "seeds")
_FIGURES = ("runs", "played", "collisions", "foreseeable", "preventable", "confirmed", "distinct", "without nuisances")


def _order(key: tuple[str, str, str]) -> tuple[str, str, int, str]:
    """The reference first, then as methods are listed."""
    names = [REFERENCE, *METHODS]
    name = key[2].removesuffix(EXTRAS)
    return (*key[:2], names.index(name) if name in names else len(names), key[2])


REFERENCE = "quality"
"""Method that the others are compared with; it brings its own screen"""
EXTRAS = "+"
"""After the name of a method that has the extras of quality-diversity search"""


def _cells(each: Sequence[Counts], budget: int) -> list[str]:
    """Means, and figures per 1,000 runs of the budget."""
    runs, played = (np.mean([getattr(one, name) for one in each]) for name in ("runs", "played"))
    preventable, confirmed = (sum(getattr(one, name) for one in each) for name in ("preventable", "confirmed"))
    share = f"{confirmed / preventable:.1%}" if preventable else "–"
    before, after = (
        [spread((1000.0 * getattr(one, name) / budget for one in each), 1) for name in names]
        for names in (("collisions", "foreseeable", "preventable"), ("distinct", "essential"))
    )
    return [f"{runs:.0f}", f"{played:.0f}", *before, share, *after]
