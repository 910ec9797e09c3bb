"""The report of a search: one page a manoeuvre and system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from generation.density.model import judge
from generation.density.roles import roles_of
from generation.estimation.estimate import Estimate
from generation.estimation.rates import Rate
from generation.outcomes.cases import Cases
from generation.outcomes.outcomes import RISK_WINDOW, Outcomes
from generation.outcomes.references import JUDGES, REFERENCES
from generation.pages import PARTS_CSS, PARTS_JS
from generation.pipeline import Generated, SearchSettings, evaluator_of
from generation.report.counterexamples import Counterexample, Counterexamples, counterexamples
from generation.report.headline import headline
from generation.report.measures import Measure, measures, unit_of
from generation.report.region import Region, limits, region
from generation.report.regression import Fate, Regression
from generation.variations import Written
from runner.replay.page import page, write_page
from runner.sut import system_name
from schemas.commands.wording import many
from schemas.storage import alone
from xodr.array_types import FloatArray

REPORT = "report.html"
"""Name of the page in a search's folder"""
_FOLDER = Path(__file__).parent / "page"
_STYLES = "base.css", "report.css", PARTS_CSS, str(_FOLDER / "report.css")
_SCRIPTS = "dom.js", "axes.js", PARTS_JS, *(str(_FOLDER / f"{part}.js") for part in ("common", "slices", "tables", "main"))
_SHOWN = 800
"""Runs that a slice shows at most"""
_DIGITS = 5
"""Significant digits of numbers"""

Json = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Report:
    """A search with what a report adds to it.

    Attributes:
        scenario: the file. region: where the system fails, or why there is no boundary. against: the comparison with another
            version of the system; None where there is none.
    """

    scenario: Path
    settings: SearchSettings
    generated: Generated
    region: Region | str
    counterexamples: Counterexamples
    against: Regression | None = None


def write_report(
    scenario: Path, generated: Generated, settings: SearchSettings, out: Path, against: Regression | None = None
) -> Path:
    """Write the page and its counterexamples into the search's folder; the same search gives the same bytes.

    Raises:
        UsageError: something else is in the way there, or another search.
    """
    with alone(out, "a search"):
        return _written(scenario, generated, settings, out, against)


def _written(scenario: Path, generated: Generated, settings: SearchSettings, out: Path, against: Regression | None) -> Path:
    with evaluator_of(scenario, generated.space, settings) as drivers:
        examples = counterexamples(scenario, generated, settings, drivers, out)
    theta, outcomes, _ = generated.episodes
    of, failing = _measures(generated, theta[outcomes.executed]), outcomes.collision[outcomes.executed]
    varying = [each for each in of if np.ptp(each.values) > 0.0] if len(failing) else []
    report = Report(scenario, settings, generated, region(varying, failing), examples, against)
    title = f"{scenario.stem}: how {system_name(settings.run.sut)} fails"
    write_page(out / REPORT, page(title, _STYLES, _SCRIPTS, _data(report, varying, out)))
    Written(out, scenario.stem).note()
    return out / REPORT


def _measures(generated: Generated, theta: FloatArray) -> list[Measure]:
    """What a tester reads off points (n, d)."""
    names = (*generated.space.names, *generated.space.pinned)
    return measures(generated.space, generated.recorded.roles or roles_of(names), theta)


def _data(report: Report, of: Sequence[Measure], out: Path) -> Json:
    """What the page is made from."""
    generated, scenario, sut = report.generated, report.scenario, system_name(report.settings.run.sut)
    return {
        "scenario": scenario.stem,
        "sut": sut,
        "headline": headline(scenario.stem, sut, generated),
        "estimate": _estimate(generated.estimate),
        "gate": [str(generated.gate), generated.gate.replayed is not None, generated.gate.refusal],
        "measures": [{"name": each.name, "unit": each.unit, "range": _rounded(limits(each.values))} for each in of],
        "region": _region(report.region),
        "runs": _runs(generated, of),
        "counterexamples": [_example(each, report, of, out) for each in report.counterexamples.found],
        "drivers": list(REFERENCES),
        "judges": list(JUDGES),
        "agreed": generated.cases.agreed,
        "cases": list(_cases(report, of)),
        "file": f"{scenario.stem}_edge_cases.xosc" if len(generated.cases) else None,
        "against": _against(report, out),
        "settings": _settings(report),
    }


def _estimate(found: Estimate | None) -> Json | None:
    if found is None:
        return None
    events = [
        {
            "name": name,
            "chance": _interval(Rate(each.value, each.interval)),
            "rates": [_interval(rate) for rate in found.rates(name).values()],
            "effective": round(each.effective),
            "stable": each.stable,
        }
        for name, each in found.probabilities.items()
    ]
    return {
        "events": events,
        "runs": found.runs,
        "failed": found.failed,
        "known": found.known,
        "driving": str(found.driving),
    }


def _interval(found: Rate) -> list[float]:
    return _rounded([found.value, *found.interval])


def _region(found: Region | str) -> Json:
    if isinstance(found, str):
        return {"reason": found}
    slices = [
        {
            "across": each.across,
            "up": each.up,
            "held": _rounded(each.held),
            "boundary": [[_rounded(point) for point in line.tolist()] for line in each.boundary],
        }
        for each in found.slices
    ]
    scores = {"accuracy": found.accuracy, "spread": found.spread, "area": found.area, "drawn": found.drawn, "alone": found.alone}
    return {**scores, "weights": [[index, round(weight, 3)] for index, weight in found.weights.items()], "slices": slices}


def _runs(generated: Generated, of: Sequence[Measure]) -> Json:
    """Evenly chosen runs: values of all measures, and whether they fail."""
    outcomes = generated.episodes.outcomes
    failing = outcomes.collision[outcomes.executed]
    rows = np.linspace(0, len(failing) - 1, min(len(failing), _SHOWN)).astype(int)
    spread = [float(each.values.std()) for each in of]
    values = [[_rounded([each.values[row]])[0] for each in of] for row in rows]
    return {"values": values, "fails": [bool(failing[row]) for row in rows], "total": len(failing), "spread": _rounded(spread)}


def _example(each: Counterexample, report: Report, of: Sequence[Measure], out: Path) -> Json:
    found, space = report.counterexamples, report.generated.space
    theta, unit = found.cases.theta[each.row], each.recorded
    recorded = None if unit is None else {"recording": unit.recording, "distance": round(unit.distance, 3)}
    values = [
        {
            "name": name,
            "unit": unit_of(name),
            "value": value,
            "recorded": None if unit is None else _rounded([unit.values[name]])[0],
        }
        for name, value in zip(space.names, _rounded(theta), strict=True)
    ]
    return {
        "names": list(each.names),
        **_case(report, found.cases, each.row, of),
        "values": values,
        "pinned": dict(space.pinned),
        "foreseeable": bool(found.foreseeable[each.row]),
        "preventable": bool(found.preventable[each.row]),
        "reproduced": each.reproduced,
        "recorded": recorded,
        "file": each.scenario.relative_to(out).as_posix(),
        "play": each.replay.relative_to(out).as_posix(),
    }


def _cases(report: Report, of: Sequence[Measure]) -> Iterator[Json]:
    cases, against = report.generated.cases, report.against
    for row in range(len(cases)):
        new = None if against is None else bool(against.new[row])
        yield {"number": row, "new": new, **_case(report, cases, row, of)}


def _case(report: Report, cases: Cases, row: int, of: Sequence[Measure]) -> Json:
    """Measures, outcome and drivers of a case."""
    outcomes = cases.outcomes
    by_name = {each.name: float(each.values[0]) for each in _measures(report.generated, cases.theta[row : row + 1])}
    return {
        "measures": _rounded([by_name[each.name] for each in of]),
        "collision": bool(outcomes.collision[row]),
        "impact": _rounded([outcomes.impact_speed[row]])[0],
        "side": str(outcomes.side[row]),
        "striking": bool(outcomes.striking[row]),
        "risk": round(float(outcomes.risk[row]), 3),
        "likelihood": round(float(cases.log_likelihood[row]), 2),
        "drivers": [_end(found, row) for found in cases.drivers.values()],
    }


def _end(outcomes: Outcomes, row: int) -> str:
    if not outcomes.executed[row]:
        return "unknown"
    return "collides" if outcomes.collision[row] else "survives"


def _against(report: Report, out: Path) -> Json | None:
    found = report.against
    if found is None:
        return None
    before = found.before
    chance = (before.estimate or {}).get("probabilities", {}).get("collision")
    failures = [
        {"number": number, "fate": fate, "values": dict(values), "impact": _rounded([found.replayed.impact_speed[number]])[0]}
        for number, (fate, values) in enumerate(zip(found.fates, before.values, strict=True))
    ]
    return {
        "sut": before.sut,
        "folder": before.folder.name,
        "counts": {fate: found.counts[fate] for fate in Fate},
        "chance": None if chance is None else _rounded([chance["value"], *chance["interval"]]),
        "failures": failures,
        "names": list(report.generated.space.names),
    }


def _settings(report: Report) -> dict[str, str]:
    settings, generated = report.settings, report.generated
    name = judge(settings.density, generated.recorded.pairs is not None)
    units = f"{name}, {len(generated.recorded.theta)} units within the limits"
    pinned = ", ".join(f"{name} = {value}" for name, value in generated.space.pinned.items())
    return {
        "scenario": report.scenario.name,
        "system under test": system_name(settings.run.sut),
        "search": f"{settings.method}, {many(len(generated.history.outcomes), 'run')}, seed {settings.seed}",
        "density": units if generated.gate.replayed is not None else "as stated, in whole or in part",
        "searched": ", ".join(generated.space.names),
        "pinned": pinned or "nothing",
        "world": f"{settings.run.world}, time step {settings.run.timestep:g} s",
        "risk": f"share of the {RISK_WINDOW:g} s up to the conflict in which RSS distances ({settings.rss}) are violated",
    }


def _rounded(values: FloatArray | Sequence[float]) -> list[float]:
    """Values with so many significant digits as can be seen."""
    return [float(f"{float(value):.{_DIGITS}g}") for value in values]
