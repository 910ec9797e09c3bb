"""Summary of a report in sentences: failures, their frequency, their severity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from generation.estimation.estimate import FAILURE, PREVENTABLE, Estimate
from generation.estimation.probability import (
    LEAST_EFFECTIVE,
    PER_DISTANCE,
    PER_HOUR,
    Driving,
    Probability,
    Rate,
)
from generation.pipeline import Generated, evaluator_of
from generation.report.assurance import Assurance
from generation.report.counterexamples import (
    Counterexample,
    Counterexamples,
    FailureParts,
    FailureRegion,
    FailureReplay,
    Measure,
    Region,
    counterexamples,
    limits,
    measured,
    region,
    replays,
    unit_of,
    varying,
    with_parts,
)
from generation.report.regression import Fate, Regression, Shift
from generation.search.gate import Share
from generation.search.outcomes import REFERENCES, RISK_WINDOW, Cases, Outcomes
from generation.search.settings import SearchSettings
from generation.search.variations import Written
from generation.space.density.models import judge
from runner.systems import system_name
from runner.view.page import page, write_page
from schemas.common.array_types import FloatArray
from schemas.common.storage import alone, write_object
from schemas.common.terminal.text import many

_SMALLEST = 1e-4
"""Numbers below this are written with a power of ten"""


def headline(title: str, sut: str, generated: Generated) -> list[str]:
    """Sentences about a search of a scenario with that title."""
    failed, lost, estimate = _failed(title, sut, generated), _lost(generated), generated.estimate
    # Before any figure: a refused density makes every probability below meaningless.
    refusal = generated.gate.refusal
    refused = (
        [] if refusal is None else [f"The density is no judge of what is foreseeable: {refusal}."]
    )
    stated = [_sentence(generated.stated)]
    if generated.bound is not None:
        stated = [_sentence(generated.bound), *stated]
    # Last, since it says what all before rest on.
    stated.append(_sentence(basis(generated)))
    if estimate is None:
        why = (
            ": no run or draw has a verdict."
            if generated.unestimated
            else "; --estimate does that."
        )
        often = f"How often traffic makes it fail was not estimated{why}"
        return [failed, *refused, *lost, *stated, often]
    traffic = "simulated traffic" if generated.recorded.simulated else "traffic"
    made = f"When {traffic} makes the manoeuvre of {title}"
    drawn = (
        made
        if generated.gate.replayed is not None
        else f"Where {title} has values as stated (nothing is recorded)"
    )
    return [failed, *refused, *_often(drawn, sut, generated, estimate), *lost, *stated]


def _sentence(about: object) -> str:
    text = str(about)
    return f"{text[:1].upper()}{text[1:]}."


def basis(generated: Generated) -> str:
    """Name the density, the judges and the test of the density on which bounds,
    intervals and cases rest.
    """
    gate, count = generated.gate, len(generated.recorded.theta)
    recorded = f"density {generated.density} of {many(count, 'recorded manoeuvre')}"
    drawn = "limits and densities as stated" if gate.replayed is None else recorded
    if gate.replayed is None:
        tested = "which no recordings test"
    elif gate.refusal is not None:
        tested = "which its gate refuses"
    else:
        tested = f"whose gate was {'' if gate.testable else 'not '}testable"
    judges = " or ".join(generated.cases.judges)
    return f"bounds and intervals rest on draws of the {drawn}, {tested}; careful is {judges}"


def _failed(title: str, sut: str, generated: Generated) -> str:
    """Sentence on the failures of a search, or that it has none."""
    outcomes = generated.episodes.outcomes
    failures, cases = (
        int((outcomes.executed & outcomes.collision).sum()),
        int(generated.cases.outcomes.collision.sum()),
    )
    ran = int(outcomes.executed.sum())
    if not failures:
        return f"{sut} has no {generated.failure} in {many(ran, 'run')} of {title}."
    judged = (
        f"{cases} failures unlike each other are" if cases > 1 else f"{cases or 'no'} failure is"
    )
    ran_of = f"{failures:,} of {many(ran, 'sought or drawn run')} of {title}"
    inside = f" within the operational domain ({generated.domain})" if generated.domain else ""
    told = (
        f"{sut} {generated.fails} in {ran_of}{_limits(generated)}; {judged} foreseeable{inside} "
        "and prevented by a careful driver"
    )
    if by := generated.cases.prevented_by():
        told += f": {', '.join(f'{count} by {name}' for name, count in by.items())}"
    return f"{told}{''.join(f'; {caveat}' for caveat in _caveats(generated, cases))}."


def _limits(generated: Generated) -> str:
    """Limits that count as failures, in parentheses."""
    return f" (a collision, or {' or '.join(generated.limits)})" if generated.limits else ""


def _caveats(generated: Generated, cases: int) -> Iterator[str]:
    """Limits of what was found: judges that prevent no or few cases, a density that could not be
    tested."""
    repeats = generated.cases.repeats
    if repeats is not None and repeats.lost:
        yield str(repeats)
    gate = generated.gate
    if gate.replayed is None:
        yield "nothing recorded tells how plausible they are"
    elif gate.refusal is None and not gate.testable:
        yield "the density of recordings was not testable"


def _lost(generated: Generated) -> Iterator[str]:
    """Runs that tested something, of all; those with an error or inconclusive count nowhere else on
    the page."""
    outcomes = generated.episodes.outcomes
    tested, runs = int(outcomes.executed.sum()), len(outcomes.status)
    yield f"{tested:,} of {many(runs, 'run')} tested what the file describes."
    errors, untested = (
        outcomes.error[outcomes.status == "error"],
        outcomes.error[outcomes.inconclusive],
    )
    if len(errors):
        yield (
            f"{many(len(errors), 'more run')} failed and count for nothing, the "
            f"first with: {errors[0]}"
        )
    if len(untested):
        verb = "are" if len(untested) > 1 else "is"
        yield (
            f"{many(len(untested), 'more run')} {verb} inconclusive and not counted, the first: "
            f"{untested[0]}"
        )


def _often(drawn: str, sut: str, generated: Generated, estimate: Estimate) -> Iterator[str]:
    failure, rates = estimate.probabilities[FAILURE], estimate.rates(FAILURE)
    # A few heavy weights make such a figure; with no failure at all the limit is sound.
    if not failure.stable and failure.value > 0.0:
        few = f"{failure.counted} are fewer than {LEAST_EFFECTIVE:g}"
        yield (
            f"How often {sut} {generated.fails} is not known well enough for a headline: "
            f"{few}; more runs help."
        )
        return
    yield f"{drawn}, {sut} {generated.fails} with a probability of {chance(failure)}."
    if rates:
        of = (
            "simulated driving"
            if isinstance(estimate.driving, Driving) and estimate.driving.simulated
            else "driving"
        )
        yield (
            f"That is {rate(rates[PER_HOUR])} {generated.failure}s per hour of {of} and "
            f"{rate(rates[PER_DISTANCE])} per 1,000 km."
        )
    yield (
        f"{generated.failure.capitalize()}s that a careful driver prevents have a probability of "
        f"{chance(estimate.probabilities[PREVENTABLE])}."
    )
    # Shares of the impacts: a failure by a limit alone is in no band.
    bands = {
        name: probability.value
        for name, probability in estimate.probabilities.items()
        if name not in (FAILURE, PREVENTABLE)
    }
    if sum(bands.values()) > 0.0:
        shares = (
            (name.removeprefix("impact "), 100.0 * count / sum(bands.values()))
            for name, count in bands.items()
        )
        yield (
            "Impacts of the collisions: "
            f"{', '.join(f'{share:.0f} % {name}' for name, share in shares if share > 0.0)}."
        )


def chance(probability: Probability) -> str:
    """A probability with its interval, in percent."""
    low, high = probability.interval
    if probability.value <= 0.0:
        return f"at most {percent(high)}{probability.unseen}"
    within = f"95\N{NO-BREAK SPACE}% interval {percent(low)} to {percent(high)}"
    return f"{percent(probability.value)} ({within})"


def rate(frequency: Rate) -> str:
    """A rate with its interval."""
    low, high = frequency.interval
    return (
        f"{figure(frequency.value)} ({figure(low)} to {figure(high)})"
        if frequency.value > 0.0
        else f"at most {figure(high)}"
    )


def percent(share: float) -> str:
    """A share in percent, two significant digits."""
    return f"{figure(100.0 * share)}\N{NO-BREAK SPACE}%"


def figure(value: float) -> str:
    """A number with two significant digits."""
    # Zero has no digits to count.
    if value == 0.0:
        return "0"
    if abs(value) >= 10.0:
        return f"{value:,.0f}"
    if abs(value) < _SMALLEST:
        digits, power = f"{value:.1e}".split("e")
        return f"{digits}·10{str(int(power)).translate(_RAISED)}"
    # `#` keeps zeros that are significant, as in 0.50.
    return f"{value:#.2g}".rstrip(".")


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


REPORT = "report.html"
"""Name of the page in a search's folder"""
_FOLDER = Path(__file__).parent / "page"
PARTS_JS, PARTS_CSS = (str(_FOLDER / f"parts.{kind}") for kind in ("js", "css"))
"""Files of counts, links, buttons and tables, which the page of a loop has too"""
_STYLES = "base.css", "report.css", "play/colours.css", PARTS_CSS, str(_FOLDER / "report.css")
_SCRIPTS = (
    "dom.js",
    "axes.js",
    "question.js",
    *(f"play/{part}.js" for part in ("data", "drawing", "pair", "preview")),
    PARTS_JS,
    *(str(_FOLDER / f"{part}.js") for part in ("common", "slices", "tables", "main")),
)
_FILMS = 6
"""Most failures shown as moving pictures, each with a sentence of its own"""
_SHOWN = 800
"""Runs that a slice shows at most"""
_DIGITS = 5
"""Significant digits of numbers"""

Json = dict[str, Any]


@dataclass(frozen=True, eq=False)
class SearchReport:
    """A search with what a report adds to it.

    Attributes:
        scenario: the file. region: where the system fails, or why there is no boundary.
        regions: groups of failures with rules, the most important first. members: replays of their
            typical and likeliest members, by `_member`. against: the comparison with another
            version of the system; None where there is none. parts: probabilities of regions, of
            the others and of all failures, which add up; None without failures. assured: what the
            search can and cannot say.
    """

    scenario: Path
    settings: SearchSettings
    generated: Generated
    region: Region | str
    regions: Sequence[FailureRegion]
    members: Mapping[str, FailureReplay]
    counterexamples: Counterexamples
    assured: Assurance
    against: Regression | None = None
    parts: FailureParts | None = None


def write_report(
    scenario: Path,
    generated: Generated,
    settings: SearchSettings,
    out: Path,
    against: Regression | None = None,
    assured: Assurance | None = None,
) -> Path:
    """Write the page and its counterexamples into the search's folder; the same search gives the
    same bytes.

    Args:
        assured: of the search, where it is known.

    Raises:
        UsageError: something else is in the way there, or another search.
    """
    with alone(out, "a search"):
        return render(scenario, generated, settings, out, against, assured)


def render(
    scenario: Path,
    generated: Generated,
    settings: SearchSettings,
    out: Path,
    against: Regression | None = None,
    assured: Assurance | None = None,
) -> Path:
    """`write_report` for a caller that has the folder for itself."""
    outcomes = generated.episodes.outcomes
    of, failing = varying(generated), outcomes.collision[outcomes.executed]
    # Of the same measures as the boundary, so that rules and slices have the same axes.
    areas, parts = with_parts(generated, of)
    rows = {
        _member(number, name): row
        for number, area in enumerate(areas, start=1)
        for name, row in _members(area).items()
    }
    with evaluator_of(scenario, generated.space, settings) as drivers:
        examples = counterexamples(scenario, generated, settings, drivers, out)
        members = replays(scenario, generated, settings, drivers, out, rows)
    report = SearchReport(
        scenario,
        settings,
        generated,
        region(of, failing),
        areas,
        members,
        examples,
        assured or Assurance.of(scenario, generated, settings),
        against,
        parts,
    )
    write_object(report.assured.as_json(), out / f"{scenario.stem}_assurance.json")
    regional = {
        "regions": _regions(report, of, out),
        "probabilities": None if parts is None else parts.as_json(),
    }
    write_object(regional, out / f"{scenario.stem}_regions.json")
    title = f"{scenario.stem}: how {system_name(settings.run.sut)} fails"
    write_page(out / REPORT, page(title, _STYLES, _SCRIPTS, _data(report, of, out)))
    # Digests of all files: a later search knows by them which it may replace.
    Written(out, scenario.stem).note()
    return out / REPORT


def _members(of: FailureRegion) -> dict[str, int]:
    """Rows of a region's members that are shown, by name."""
    return {"typical": of.typical, "likeliest": of.likeliest}


def _member(number: int, name: str) -> str:
    """Name of a member's file, after the scenario's."""
    return f"region_{number}_{name}"


def _data(report: SearchReport, of: Sequence[Measure], out: Path) -> Json:
    """Return the data of the page."""
    generated, scenario, sut = (
        report.generated,
        report.scenario,
        system_name(report.settings.run.sut),
    )
    return {
        "scenario": scenario.stem,
        "sut": sut,
        "headline": headline(scenario.stem, sut, generated),
        "films": _films(report, out),
        "estimate": _estimate(generated.estimate),
        "statement": generated.statement.as_json(),
        "gate": [str(generated.gate), generated.gate.replayed is not None, generated.gate.refusal],
        "measures": [
            {"name": measure.name, "unit": measure.unit, "range": _rounded(limits(measure.values))}
            for measure in of
        ],
        "region": _region(report.region),
        "regions": _regions(report, of, out),
        "parts": parts.as_json() if (parts := report.parts) is not None else None,
        "runs": _runs(generated, of),
        "counterexamples": [
            _example(counterexample, report, of, out)
            for counterexample in report.counterexamples.found
        ],
        "drivers": list(generated.cases.drivers) or list(REFERENCES),
        "judges": list(generated.cases.judges),
        "agreed": generated.cases.agreed,
        "cases": list(_cases(report, of)),
        "file": f"{scenario.stem}_edge_cases.xosc" if len(generated.cases) else None,
        "against": _against(report, out),
        "assured": report.assured.as_json(),
        "settings": _settings(report),
    }


def _films(report: SearchReport, out: Path) -> list[Json]:
    """Moving pictures of failures, first one of each region, then the counterexamples, then other
    members of regions."""
    named = [
        (f"Region {number}, {name} member", one.page, one.reproduced, one.film)
        for name in ("likeliest", "typical")
        for number in range(1, len(report.regions) + 1)
        if (one := report.members.get(_member(number, name))) is not None
    ]
    chosen = [
        (
            f"The {' and '.join(counterexample.names).replace('_', ' ')}",
            counterexample.replay,
            counterexample.reproduced,
            counterexample.film,
        )
        for counterexample in report.counterexamples.found
    ]
    regions = len(report.regions)
    films: dict[str, Json] = {}
    for title, page_path, reproduced, film in (*named[:regions], *chosen, *named[regions:]):
        # A picture of a run that ends otherwise than the search said would show no failure.
        if film is not None and reproduced:
            play = page_path.relative_to(out).as_posix()
            # Failures with the same account look the same: the first one stands for them.
            films.setdefault(film["told"], {"title": title, "play": play, "preview": film})
    return list(films.values())[:_FILMS]


def _estimate(estimate: Estimate | None) -> Json | None:
    if estimate is None:
        return None
    events = [
        {
            "name": name,
            "chance": _interval(Rate(probability.value, probability.interval)),
            "rates": [_interval(rate) for rate in estimate.rates(name).values()],
            "effective": round(probability.effective),
            "stable": probability.stable,
        }
        for name, probability in estimate.probabilities.items()
    ]
    return {
        "events": events,
        "runs": estimate.runs,
        "failed": estimate.failed,
        "known": estimate.known,
        "driving": str(estimate.driving),
    }


def _interval(of: Rate) -> list[float]:
    return _rounded([of.value, *of.interval])


def _region(fitted: Region | str) -> Json:
    if isinstance(fitted, str):
        return {"reason": fitted}
    slices = [
        {
            "across": section.across,
            "up": section.up,
            "held": _rounded(section.held),
            "boundary": [[_rounded(point) for point in line.tolist()] for line in section.boundary],
        }
        for section in fitted.slices
    ]
    scores = {
        "accuracy": fitted.accuracy,
        "spread": fitted.spread,
        "area": fitted.area,
        "drawn": fitted.drawn,
        "alone": fitted.alone,
    }
    return {
        **scores,
        "weights": [[index, round(weight, 3)] for index, weight in fitted.weights.items()],
        "slices": slices,
    }


def _regions(report: SearchReport, of: Sequence[Measure], out: Path) -> list[Json]:
    """Regions with the measures and replays of two members, and rates of the driving that an
    estimate knows."""
    estimate = report.generated.estimate
    driving = estimate.driving if estimate is not None else ""
    per = driving.per if isinstance(driving, Driving) else {}
    listed = []
    for number, area in enumerate(report.regions, start=1):
        members = {
            name: _rounded([measure.values[row] for measure in of])
            for name, row in _members(area).items()
        }
        played = {name: report.members[_member(number, name)] for name in members}
        files = {
            name: {
                "file": one.scenario.relative_to(out).as_posix(),
                "play": one.page.relative_to(out).as_posix(),
                "reproduced": one.reproduced,
            }
            for name, one in played.items()
        }
        chance = [area.chance.value, *area.chance.interval]
        rates = (
            {name: _rounded([scale * share for share in chance]) for name, scale in per.items()}
            if area.chance.draws
            else {}
        )
        listed.append(
            {
                **area.as_json(of, members),
                "rates": rates,
                "files": files,
                "name": f"region {number}",
            }
        )
    return listed


def _runs(generated: Generated, of: Sequence[Measure]) -> Json:
    """Evenly chosen runs: values of all measures, and whether they fail."""
    outcomes = generated.episodes.outcomes
    failing = outcomes.collision[outcomes.executed]
    # Evenly in the order of the search: its phases have each their share.
    rows = np.linspace(0, len(failing) - 1, min(len(failing), _SHOWN)).astype(int)
    spread = [float(measure.values.std()) for measure in of]
    values = [[_rounded([measure.values[row]])[0] for measure in of] for row in rows]
    return {
        "values": values,
        "fails": [bool(failing[row]) for row in rows],
        "total": len(failing),
        "spread": _rounded(spread),
    }


def _example(
    example: Counterexample, report: SearchReport, of: Sequence[Measure], out: Path
) -> Json:
    examples, space = report.counterexamples, report.generated.space
    theta, unit = examples.cases.theta[example.row], example.recorded
    recorded = (
        None if unit is None else {"recording": unit.recording, "distance": round(unit.distance, 3)}
    )
    values = [
        {
            "name": name,
            "unit": unit_of(name),
            "value": value,
            "recorded": None if unit is None else _rounded([unit.values[name]])[0],
        }
        for name, value in zip(space.names, _rounded(theta), strict=True)
        if not space.categories(name)
    ]
    # A code says nothing to a reader: the values that it stands for are shown in its place.
    coded = {
        name
        for parameter in space.names
        for row in space.categories(parameter).values()
        for name in row
    }
    values += [
        {"name": name, "unit": unit_of(name), "value": text, "recorded": None}
        for name, text in space.values(theta).items()
        if name in coded
    ]
    return {
        "names": list(example.names),
        **_case(report, examples.cases, example.row, of),
        "values": values,
        "pinned": dict(space.pinned),
        "foreseeable": bool(examples.foreseeable[example.row]),
        "preventable": bool(examples.preventable[example.row]),
        "reproduced": example.reproduced,
        "recorded": recorded,
        "file": example.scenario.relative_to(out).as_posix(),
        "play": example.replay.relative_to(out).as_posix(),
    }


def _cases(report: SearchReport, of: Sequence[Measure]) -> Iterator[Json]:
    cases, against = report.generated.cases, report.against
    for row in range(len(cases)):
        fate = None if against is None else against.found[row]
        yield {"number": row, "fate": fate, **_case(report, cases, row, of)}


def _case(report: SearchReport, cases: Cases, row: int, of: Sequence[Measure]) -> Json:
    """Measures, outcome and drivers of a case."""
    outcomes = cases.outcomes
    by_name = {
        measure.name: float(measure.values[0])
        for measure in measured(report.generated, cases.theta[row : row + 1])
    }
    return {
        "measures": _rounded([by_name[measure.name] for measure in of]),
        "collision": bool(outcomes.collision[row]),
        "impact": _rounded([outcomes.impact_speed[row]])[0],
        "side": str(outcomes.side[row]),
        "striking": bool(outcomes.striking[row]),
        "risk": round(float(outcomes.risk[row]), 3),
        "likelihood": round(float(cases.log_likelihood[row]), 2),
        "drivers": [_end(driven, row) for driven in cases.drivers.values()],
        **_again(cases, row),
    }


def _again(cases: Cases, row: int) -> Json:
    """Whether a failure fails again, and how often with other seeds, with its interval."""
    repeats = cases.repeats
    # Only failures were run again.
    if repeats is None or not cases.outcomes.collision[row]:
        return {"again": None, "repeated": None}
    share = Share(int(repeats.failing[row]), int(repeats.runs[row]))
    repeated = [share.collisions / share.runs, *share.interval] if share.runs else None
    return {
        "again": bool(repeats.again[row]),
        "repeated": None if repeated is None else _rounded(repeated),
    }


def _end(outcomes: Outcomes, row: int) -> str:
    # A driver that can't play a scenario neither survives nor collides.
    if not outcomes.executed[row]:
        return "unknown"
    return "collides" if outcomes.collision[row] else "survives"


def _against(report: SearchReport, out: Path) -> Json | None:
    compared = report.against
    if compared is None:
        return None
    before = compared.before
    # The other search may have been made without --estimate.
    chance = (before.estimate or {}).get("probabilities", {}).get(FAILURE)
    failures = [
        {
            "number": number,
            "fate": fate,
            "values": dict(values),
            "impact": _rounded([compared.replayed.impact_speed[number]])[0],
        }
        for number, (fate, values) in enumerate(zip(compared.fates, before.values, strict=True))
    ]
    return {
        "sut": before.sut,
        "folder": before.folder.name,
        "counts": {fate: compared.counts[fate] for fate in Fate},
        "regions": {shift: compared.regions[shift] for shift in Shift},
        "chance": None if chance is None else _rounded([chance["value"], *chance["interval"]]),
        "failures": failures,
        "names": list(report.generated.space.names),
    }


def _settings(report: SearchReport) -> dict[str, str]:
    settings, generated = report.settings, report.generated
    name = judge(settings.density, generated.recorded.pairs is not None)
    units = f"{name}, {len(generated.recorded.theta)} units within the limits"
    pinned = ", ".join(f"{name} = {value}" for name, value in generated.space.pinned.items())
    return {
        "scenario": report.scenario.name,
        "system under test": system_name(settings.run.sut),
        "search": f"{settings.method}, {_spent(generated)}, seed {settings.seed}",
        "density": units
        if generated.gate.replayed is not None
        else "as stated, in whole or in part",
        "searched": ", ".join(generated.space.names),
        "pinned": pinned or "nothing",
        "operational domain": str(generated.domain),
        "world": f"{settings.run.world}, time step {settings.run.timestep:g} s",
        "risk": (
            f"share of the {RISK_WINDOW:g} s up to the conflict in which RSS distances "
            f"({settings.rss}) are violated"
        ),
    }


def _spent(generated: Generated) -> str:
    """Runs of a search by kind."""
    sought, drawn = (
        many(len(generated.history.outcomes), "sought run"),
        many(generated.statement.draws, "unguided draw"),
    )
    cut = ", ended by its time" if generated.cut else ""
    return f"{sought}, {drawn}, {many(generated.plays, 'play')} in arrays{cut}"


def _rounded(values: FloatArray | Sequence[float]) -> list[float]:
    """Values with so many significant digits as can be seen."""
    return [float(f"{float(value):.{_DIGITS}g}") for value in values]
