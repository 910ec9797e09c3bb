"""A batch as a page: verdicts, distributions of criticality measures, how they depend on parameters, links to replays."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner import journal
from runner.outputs.report import finite
from runner.replay.page import page, write_page
from runner.replay.player import REPLAY

if TYPE_CHECKING:
    from runner.jobs import Outcome

REPORT = "report.html"
"""Name of the page in the output folder of a batch"""
_MEASURES = {
    "min_ttc": ("Least time to collision", "s", 10.0),
    "min_thw": ("Least time headway", "s", 10.0),
    "min_distance": ("Least distance", "m", 100.0),
    "max_drac": ("Greatest deceleration to avoid a crash", "m/s²", 20.0),
    "pet": ("Post-encroachment time", "s", 10.0),
    "rss_risk_ad_rss": ("Share of time in violation of RSS", "", 1.0),
}
"""Label and unit of each measure, and the value from which on it matters no more how much it is"""
_LEAD_IN = 2.0
"""How long before the most critical moment replays begin, s"""
_DIGITS = 6
"""Significant digits of numbers"""


def write_report(out: Path) -> Path:
    """Write the page of a batch into its output folder; the same batch gives the same bytes.

    Raises:
        UsageError: the folder is not that of a batch.
    """
    path = out / REPORT
    write_page(path, page(f"{out.resolve().name} – report", ("base.css", "report.css"), ("dom.js", "report.js"), report(out)))
    return path


def report(out: Path) -> dict[str, Any]:
    """What the page is made from: one row a run, in the order of their names."""
    outcomes = sorted(journal.finished(out).values(), key=lambda outcome: outcome.job.name)
    return {
        "title": out.resolve().name,
        "settings": {name: str(value) for name, value in journal.settings(out).items()},
        "measures": {name: {"label": label, "unit": unit, "most": most} for name, (label, unit, most) in _MEASURES.items()},
        "parameters": varied(outcome.job.parameters for outcome in outcomes),
        "runs": [_row(outcome, out) for outcome in outcomes],
    }


def varied(sets: Iterable[dict[str, str]]) -> list[str]:
    """Names of the parameters whose values are not the same in all sets, in the order of their first appearance."""
    found: dict[str, set[str | None]] = {}
    count = 0
    for count, parameters in enumerate(sets, 1):
        for name, value in parameters.items():
            found.setdefault(name, set() if count == 1 else {None}).add(value)
        for name in found.keys() - parameters.keys():
            found[name].add(None)
    return [name for name, values in found.items() if len(values) > 1]


def _row(outcome: Outcome, out: Path) -> dict[str, Any]:
    job, measures = outcome.job, outcome.measures
    replay = out / job.name / REPLAY
    return finite(
        {
            "name": job.name,
            "source": job.source.name,
            "state": outcome.state,
            "status": outcome.status,
            "message": outcome.message,
            "end": outcome.end_time,
            "parameters": {name: _number(value) for name, value in job.parameters.items()},
            "measures": {name: _value(measures.get(name)) for name in _MEASURES},
            "replay": f"{job.name}/{REPLAY}" if replay.is_file() else None,
            "moment": _moment(measures),
        }
    )


def _value(measure: Any) -> float | None:
    """A measure's value; None where it is not defined."""
    value = measure.get("value") if isinstance(measure, dict) else measure
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, int | float) else None


def _moment(measures: dict[str, Any]) -> float:
    """Where a replay begins to be interesting, s."""
    worst = measures.get("min_ttc") or measures.get("min_distance") or {}
    return round(max(0.0, float(worst.get("time") or 0.0) - _LEAD_IN), 2)


def _number(value: str) -> float | str:
    """A parameter's value as a number, where it is one."""
    try:
        number = float(value)
        json.dumps(number, allow_nan=False)
    except ValueError:
        return value
    return number
