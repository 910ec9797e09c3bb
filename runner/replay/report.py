"""A batch as a page: verdicts, distributions of criticality measures, how they depend on parameters, links to replays."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from runner.batch import journal
from runner.measures.braking import GREATEST
from runner.outputs.runs import write_runs
from runner.replay.names import REPLAY, REPORT
from runner.replay.page import page, write_page
from schemas.errors import InvalidFile

RUNS = "runs.parquet"
"""Name of the table of runs in that folder"""


class _Measure(NamedTuple):
    """Label and unit of a measure, the value from which on it matters no more how much it is, and what it is called then."""

    label: str
    unit: str
    most: float
    beyond: str = ""


_MEASURES = {
    "min_ttc": _Measure("Least time to collision", "s", 10.0),
    "min_thw": _Measure("Least time headway", "s", 10.0),
    "min_distance": _Measure("Least distance", "m", 100.0),
    "max_drac": _Measure("Greatest deceleration to avoid a crash", "m/s²", GREATEST, "unavoidable"),
    "pet": _Measure("Post-encroachment time", "s", 10.0),
    "rss_risk_ad_rss": _Measure("Share of time in violation of RSS", "", 1.0),
}
_STYLES = ("base.css", "report.css")
_PARTS = ("model", "verdicts", "groups", "distributions", "scatter", "table", "report")
_SCRIPTS = ("dom.js", "axes.js", *(f"report/{part}.js" for part in _PARTS))
_LEAD_IN = 2.0
"""How long before the most critical moment replays begin, s"""
_DIGITS = 6
"""Significant digits of numbers"""


def write_report(out: Path, against: Path | None = None) -> Path:
    """Write the page of a batch into its output folder; the same batch gives the same bytes.

    Args:
        out: the output folder.
        against: that of an earlier batch, which the page compares with.

    Raises:
        UsageError: a folder is not that of a batch.
        InvalidFile: a table of runs is damaged.
    """
    path = out / REPORT
    values = report(out) if against is None else _with_earlier(report(out), out, against)
    write_page(path, page(f"{out.resolve().name} – report", _STYLES, _SCRIPTS, values))
    return path


def report(out: Path) -> dict[str, Any]:
    """What the page is made from: one row a run, in the order of their names; files that could not be run are among them."""
    settings = journal.settings(out)
    runs = _table(out)
    return {
        "title": out.resolve().name,
        "settings": {name: str(value) for name, value in settings.items()},
        "measures": {name: measure._asdict() for name, measure in _MEASURES.items()},
        "parameters": varied(dict(run["parameters"]) for run in runs),
        "runs": [_row(run, out) for run in runs],
    }


def _with_earlier(values: dict[str, Any], out: Path, against: Path) -> dict[str, Any]:
    """The same with what an earlier batch had: each run's state and measures there, and the runs that are gone.

    A run is that of before when its file has the same name, and it the same parameters and seed.
    """
    journal.settings(against)
    earlier = {_identity(run): run for run in _table(against)}
    now = [_identity(run) for run in _table(out)]
    address = quote(Path(os.path.relpath(against / REPORT, out)).as_posix())
    return values | {
        "runs": [run | {"before": _before(earlier.get(own))} for run, own in zip(values["runs"], now, strict=True)],
        "against": {
            "title": against.resolve().name,
            "report": address if (against / REPORT).is_file() else None,
            "gone": [run["name"] for identity, run in earlier.items() if identity not in set(now)],
        },
    }


def _identity(run: dict[str, Any]) -> tuple[str, tuple[tuple[str, str], ...], int | None]:
    return Path(run["file"]).stem, tuple(sorted(map(tuple, run["parameters"]))), run["seed"]


def _before(run: dict[str, Any] | None) -> dict[str, Any] | None:
    return None if run is None else {"state": run["state"], "measures": _measures(run)}


def _table(out: Path) -> list[dict[str, Any]]:
    """The batch's table of runs; made from its journal where it was interrupted before there was one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = out / RUNS
    if not path.is_file():
        write_runs(journal.finished(out).values(), path)
    try:
        return pq.read_table(path).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise InvalidFile(f"the table of runs can't be read: {str(error).splitlines()[0]}", path=path) from None


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


def _row(run: dict[str, Any], out: Path) -> dict[str, Any]:
    name = run["name"]
    return {
        "name": name,
        "group": Path(run["file"]).stem,
        "state": run["state"],
        "status": run["status"],
        "message": run["message"],
        "end": run["end_time"],
        "parameters": {key: _number(value) for key, value in run["parameters"]},
        "measures": _measures(run),
        "replay": f"{name}/{REPLAY}" if (out / name / REPLAY).is_file() else None,
        "moment": _moment(run),
    }


def _measures(run: dict[str, Any]) -> dict[str, float | None]:
    return {key: _rounded(run[key]) for key in _MEASURES}


def _rounded(value: float | None) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if value is not None and math.isfinite(value) else None


def _moment(run: dict[str, Any]) -> float:
    """Where a replay begins to be interesting, s."""
    times = [run[f"{measure}_time"] for measure in ("min_ttc", "min_distance")]
    worst = next((time for time in times if time is not None), 0.0)
    return round(max(0.0, worst - _LEAD_IN), 2)


def _number(value: str) -> float | str:
    """A parameter's value as a number, where it is one."""
    try:
        number = float(value)
    except ValueError:
        return value
    return number if math.isfinite(number) else value
