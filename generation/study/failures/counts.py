"""What counts: failures on SUMO that are foreseeable, preventable, and distinct."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from generation.outcomes.cases import Choice
from generation.outcomes.references import survivors
from generation.search.diversity import distinctive, diverse
from generation.search.problem import History
from generation.study.failures.problem import Posed
from generation.study.methods import METHODS
from recognition.study.report.tables import Table, spread
from schemas.errors import UsageError
from schemas.storage import read_object, write_object


@dataclass(frozen=True)
class Counts:
    """Of one search.

    Attributes:
        runs: of the system under test on SUMO.
        collisions: runs with a collision. foreseeable: of these. preventable: of these again.
        distinct: preventable ones that are apart by all parameters. essential: by those that are no nuisances.
    """

    runs: int
    collisions: int
    foreseeable: int
    preventable: int
    distinct: int
    essential: int


def counted(history: History, posed: Posed) -> Counts:
    """Judge a search; the reference drivers' runs are on SUMO, and none of its budget."""
    problem, theta = posed.problem, history.theta
    assert problem.prior is not None
    collided = history.outcomes.collision & history.outcomes.executed
    foreseen = collided.copy()
    foreseen[collided] = problem.prior.foreseeable(theta[collided])
    found = theta[foreseen][survivors(theta[foreseen], posed.sumo)]
    unit, least = problem.space.unit(found), Choice().apart
    told = distinctive(problem.space)
    numbers = len(diverse(unit, least)), len(diverse(unit[:, told], least))
    return Counts(len(theta), int(collided.sum()), int(foreseen.sum()), len(found), *numbers)


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
    found: dict[tuple[str, str, str], list[Counts]] = {}
    for path in sorted(out.glob("*/*/*.json")):
        values = read_object(path)
        if values.pop("budget") != budget:
            raise UsageError(f"this is of another budget than {budget}: give the same, or another folder", path=path)
        method = path.stem.rpartition("-")[0]
        found.setdefault((path.parent.parent.name, path.parent.name, method), []).append(Counts(**values))
    rows = [(*key, str(len(each)), *_cells(each)) for key, each in sorted(found.items(), key=lambda item: _order(item[0]))]
    note = (
        "Mean ± standard deviation over seeds; all but runs are per 1,000 runs of the system under test on SUMO. Foreseeable and "
        "preventable: of the collisions. Distinct: of the preventable ones, pairwise further apart than 5 % of the ranges, root "
        "mean square over all parameters, and over those that are no nuisances (start and rest time)."
    )
    return Table("failures", "Distinct foreseeable and preventable failures", note, (*_KEYS, *_FIGURES), rows)


_KEYS = ("scenario", "system", "method", "seeds", "runs")
_FIGURES = ("collisions", "foreseeable", "preventable", "distinct", "without nuisances")


def _order(key: tuple[str, str, str]) -> tuple[str, str, int]:
    return (*key[:2], list(METHODS).index(key[2]) if key[2] in METHODS else len(METHODS))


def _cells(each: Sequence[Counts]) -> list[str]:
    """Per 1,000 runs."""
    names = ("collisions", "foreseeable", "preventable", "distinct", "essential")
    runs = np.mean([one.runs for one in each])
    return [f"{runs:.0f}", *(spread((1000.0 * getattr(one, name) / max(one.runs, 1) for one in each), 1) for name in names)]
