"""Batches as pages: verdicts, distributions of measures, dependence on parameters, links to
replays; versions side by side.

The page of several versions has a row a run and a column a version, without a server.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from runner.batch import journal
from runner.batch.batch import Identity, counterparts_of, identity
from runner.batch.outputs.folder import RESULT, load_run
from runner.batch.outputs.tables import CONTACT, schema, write_runs
from runner.batch.outputs.work import work_of
from runner.judging.measures.contacts import sentence
from runner.judging.measures.measure import measures
from runner.view.page import page, write_page
from runner.view.replay.player import PAIR, REPLAY, REPORT, TO_REPORT, write_replay
from schemas.common.errors import InvalidFile, UsageError, reason
from schemas.common.storage import read_object, read_parquet
from schemas.common.terminal.text import finite_number

if TYPE_CHECKING:
    import pyarrow as pa


RUNS = "runs.parquet"
"""Name of the table of runs in that folder"""


_MOMENTS = ("min_ttc", "min_distance")
"""Measures at whose extremes replays begin"""
_OTHERS = ("name", "file", "seed", "state", "status", "message", "end_time", "parameters")
"""Columns of the table of runs that the page shows besides measures"""
_NEVER_ABSENT = ("name", "file", "state", "parameters")
_DETAILS = (*CONTACT, "impact_speed_other")
"""Columns that describe a contact"""
_STYLES = ("base.css", "report.css")
_PARTS = ("model", "verdicts", "groups", "distributions", "scatter", "table", "report")
_SCRIPTS = ("dom.js", "axes.js", "question.js", *(f"report/{part}.js" for part in _PARTS))
_LEAD_IN = 2.0
"""Lead-in (s) of replays before the most critical moment"""
_PAIRS = 30
"""Runs of each kind of change that are played beside what they were before"""
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

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> from runner.batch.batch import run_batch
        >>> from runner.batch.jobs import jobs_of
        >>> jobs = jobs_of([Path("xosc/library/simple_cut_in.xosc")], {}, enforce_constraints=True)
        >>> settings = xt.RunSettings(world="kinematic", max_time=1.0)
        >>> [outcome.state for outcome in run_batch(jobs, settings, out=Path("batch"))]
        ['inconclusive']
        >>> xt.report(Path("batch")).name
        'report.html'
    """
    path = out / REPORT
    values = report(out) if against is None else _with_earlier(report(out), out, against)
    if against is not None:
        _write_pairs(values["runs"], out, against)
    write_page(path, page(f"{out.resolve().name} – report", _STYLES, _SCRIPTS, values))
    return path


def report(out: Path) -> dict[str, Any]:
    """Return the data of the page: one row per run, sorted by name, files that failed to load
    included."""
    settings = journal.settings(out)
    runs = runs_of(out)
    return {
        "title": out.resolve().name,
        "settings": {name: str(value) for name, value in settings.items()},
        "measures": _measures(),
        "parameters": varied(dict(run["parameters"]) for run in runs),
        "runs": [_row(run, out) for run in runs],
        "evidence": _evidence(runs, settings),
        "work": work_of(out),
    }


def _evidence(
    runs: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Evidence of all runs, a row a kind: number of runs, least value, and number of runs below the
    required value."""
    from runner.judging.evidence.least import least_values  # they need the engine
    from runner.judging.evidence.rows import ROWS

    chosen = least_values(map(str, settings.get("least") or ()))
    counted: dict[str, list[float]] = {}
    for run in runs:
        for name, value in run.get("evidence") or ():
            counted.setdefault(name, []).append(value)
    evidence = []
    for row in (row for row in ROWS.values() if row.name in counted):
        values, least = counted[row.name], chosen.get(row.name, row.least)
        evidence.append(
            {
                "name": row.name,
                "runs": len(values),
                "worst": rounded(min(values)),
                "least": least,
                "unit": row.unit,
                "below": sum(value < least for value in values),
                "meaning": row.meaning,
            }
        )
    return evidence


def _measures() -> dict[str, dict[str, Any]]:
    """The measures of reports: label, unit, end of the axis, and the word for values beyond."""
    return {
        name: {
            "label": measure.label,
            "unit": measure.unit,
            "most": measure.most,
            "beyond": measure.beyond,
        }
        for name, measure in measures().items()
        if measure.most is not None
    }


def _with_earlier(values: dict[str, Any], out: Path, against: Path) -> dict[str, Any]:
    """Add states and measures of an earlier batch to each run, and the runs that are gone.

    A run is that of before when its file is, see `counterparts_of`, with the same parameters and
    seed.
    """
    journal.settings(against)
    runs, before = runs_of(out), runs_of(against)
    same = counterparts_of([run["file"] for run in runs], [run["file"] for run in before])
    earlier = {_identity(run): run for run in before}
    now = [_identity(run, same) for run in runs]
    address = quote(Path(os.path.relpath(against / REPORT, out)).as_posix())
    return values | {
        "runs": [
            row | {"before": _before(earlier.get(own), run)}
            for row, run, own in zip(values["runs"], runs, now, strict=True)
        ],
        "against": {
            "title": against.resolve().name,
            "report": address if (against / REPORT).is_file() else None,
            "gone": [run["name"] for identity, run in earlier.items() if identity not in set(now)],
        },
    }


def _identity(run: dict[str, Any], same: Mapping[str, str] = MappingProxyType({})) -> Identity:
    return identity(run["file"], run["parameters"], run["seed"], same)


def _before(run: dict[str, Any] | None, now: dict[str, Any]) -> dict[str, Any] | None:
    """The run of an earlier batch that corresponds to one of this; None without one."""
    if run is None:
        return None
    changed = run.get("content") != now.get("content")
    state = {"name": run["name"], "state": run["state"], "changed": changed}
    return state | {"measures": _values(run)}


def _write_pairs(runs: list[dict[str, Any]], out: Path, against: Path) -> None:
    """Write pages that play runs beside their earlier versions, for the first runs of each kind of
    change.

    Runs without a replay have none, nor have those whose results before are gone.
    """
    listed: Counter[tuple[bool, bool]] = Counter()
    for run in sorted(runs, key=lambda run: run["name"]):
        before = run["before"]
        kind = (run["state"] == "passed", before is not None and before["state"] == "passed")
        if (
            before is None
            or run["replay"] is None
            or kind == (True, True)
            or listed[kind] >= _PAIRS
        ):
            continue
        try:
            results = [load_run(against / before["name"]), load_run(out / run["name"])]
        except InvalidFile:
            continue
        listed[kind] += 1
        # Names of runs are the same in both batches: the page tells them apart.
        results[0].name, results[1].name = f"before: {results[0].name}", f"now: {results[1].name}"
        write_replay(results, out / run["name"] / PAIR, TO_REPORT)
        run["pair"] = f"{run['name']}/{PAIR}"


def runs_of(out: Path) -> list[dict[str, Any]]:
    """The batch's table of runs; made from its journal where it was interrupted before there was
    one."""
    import pyarrow as pa

    path = out / RUNS
    if not path.is_file():
        outcomes = journal.finished(out).outcomes
        write_runs((outcomes[name] for name in sorted(outcomes)), path)
    try:
        table = read_parquet(path)
        wrong = _unusable(table)
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InvalidFile(f"the table of runs can't be read: {reason(error)}", path=path) from None
    # Names become paths and links: an edited one could lead out of the folder.
    if not wrong and not all(map(journal.is_folder_name, table["name"].to_pylist())):
        wrong = "a name of a run names no folder"
    if wrong:
        raise InvalidFile(f"this is not the table of runs of a batch: {wrong}", path=path)
    runs: list[dict[str, Any]] = table.to_pylist()
    return runs


def _unusable(table: pa.Table) -> str:
    """Return the fault of a table of runs; empty if the page can be made of it.

    Raises:
        ValueError, pyarrow.ArrowException: its values are none of their types.
    """
    table.validate(full=True)
    expected = schema()
    for name in (*_OTHERS, *_measures(), *_DETAILS, *(f"{name}_time" for name in _MOMENTS)):
        if name not in table.column_names:
            if name in _OTHERS or name in _MOMENTS:
                return f"there is no column {name}"
            continue  # a measure that an earlier version did not have
        if table.schema.field(name).type != expected.field(name).type:
            return (
                f"the column {name} is of the type {table.schema.field(name).type}, not "
                f"{expected.field(name).type}"
            )
        if name in _NEVER_ABSENT and table[name].null_count:
            return f"the column {name} has rows without a value"
    return ""


def varied(sets: Iterable[dict[str, str]]) -> list[str]:
    """Names of the parameters whose values are not the same in all sets, in the order of their
    first appearance."""
    found: dict[str, set[str | None]] = {}
    count = 0
    for count, parameters in enumerate(sets, 1):
        for name, value in parameters.items():
            # A parameter that some sets lack varies as well.
            found.setdefault(name, set() if count == 1 else {None}).add(value)
        for name in found.keys() - parameters.keys():
            found[name].add(None)
    return [name for name, values in found.items() if len(values) > 1]


def _row(run: dict[str, Any], out: Path) -> dict[str, Any]:
    name = run["name"]
    return {
        "name": name,
        "group": Path(run["file"]).stem,
        "scenario": run.get("scenario"),
        "state": run["state"],
        "verdict": run.get("verdict"),
        "status": run["status"],
        "message": run["message"],
        "causes": run.get("causes") or [],
        "end": run["end_time"],
        "parameters": {key: number(value) for key, value in run["parameters"]},
        "measures": _values(run),
        "impact": _impact(run),
        "replay": f"{name}/{REPLAY}" if (out / name / REPLAY).is_file() else None,
        "moment": _moment(run),
    }


def _values(run: dict[str, Any]) -> dict[str, float | None]:
    return {name: rounded(run.get(name)) for name in _measures()}


def _impact(run: dict[str, Any]) -> str | None:
    """Describe the contact of a failed run: entities, and the side of the ego; None without a
    contact."""
    if run.get("impact_side") is None or run.get("impact_speed_other") is None:
        return None
    ahead, left = run["impact_ahead"], run["impact_left"]
    along, across = "ahead" if ahead >= 0.0 else "behind", "left" if left >= 0.0 else "right"
    point = f"{abs(ahead):.1f} m {along} and {abs(left):.1f} m {across} of its middle"
    impact = sentence("the ego", run["impact_speed_other"], run["impact_side"], run["ego_strikes"])
    return f"{impact}, {point}"


def rounded(value: float | None) -> float | None:
    """A measure with the digits of reports; None where it is not finite."""
    return float(f"{value:.{_DIGITS}g}") if value is not None and math.isfinite(value) else None


def _moment(run: dict[str, Any]) -> float:
    """Return the time (s) at which a replay starts."""
    # The time to collision tells more than the distance: it comes first.
    times = [run.get(f"{measure}_time") for measure in _MOMENTS]
    worst = next((time for time in times if time is not None), 0.0)
    return round(max(0.0, worst - _LEAD_IN), 2)


def number(value: str) -> float | str:
    """A parameter's value as a number, where it is one."""
    found = finite_number(value)
    return value if found is None else found


HISTORY = "history.html"
"""Name of the page, in the output folder of the last batch"""
_HISTORY_STYLES = ("base.css", "report.css")
_HISTORY_SCRIPTS = ("dom.js", "axes.js", "history.js")
_MEASURES = ("impact_speed", "min_distance", "min_ttc")
"""Measures that a cell tells, where the run has them"""


def write_history(batches: Sequence[Path], path: Path | None = None) -> Path:
    """Write the page of several batches, the oldest first; the same batches give the same bytes.

    Args:
        batches: their output folders, two or more.
        path: the page; by default `HISTORY` in the last of them.

    Raises:
        UsageError: a folder is not that of a batch, or one is given twice.
        InvalidFile: a table of runs is damaged.
    """
    if len({batch.resolve() for batch in batches}) < len(batches):
        raise UsageError(
            "a history needs different batches, and one is given twice", path=batches[-1]
        )
    target = path or batches[-1] / HISTORY
    write_page(
        target,
        page(
            f"{batches[-1].resolve().name} – history",
            _HISTORY_STYLES,
            _HISTORY_SCRIPTS,
            history(batches, target.parent),
        ),
    )
    return target


def history(batches: Sequence[Path], folder: Path) -> dict[str, Any]:
    """Data of the page: versions, and each run with its state in every one of them; None where a
    batch lacks it.

    Args:
        batches: their output folders, the oldest first.
        folder: that of the page, from which links lead.
    """
    versions, rows = [], dict[Identity, dict[str, Any]]()
    titles = _titles(batches)
    latest = [run["file"] for run in runs_of(batches[-1])]
    for column, batch in enumerate(batches):
        runs = runs_of(batch)
        same = counterparts_of([run["file"] for run in runs], latest)
        counts = Counter(run["state"] for run in runs)
        versions.append(
            _version(batch, titles[column], folder) | {"counts": dict(sorted(counts.items()))}
        )
        for run in runs:
            known = _identity(run, same)
            row = rows.setdefault(known, {"cells": [None] * len(batches)})
            # The last batch counts: its names are those that the reader knows.
            row |= {
                "name": run["name"],
                "group": Path(run["file"]).stem,
                "parameters": dict(run["parameters"]),
            }
            row["cells"][column] = _cell(run, batch, folder)
    parameters = varied(row["parameters"] for row in rows.values())
    shown = [
        row | {"parameters": [number(row["parameters"].get(name, "")) for name in parameters]}
        for row in rows.values()
    ]
    return {
        "title": batches[-1].resolve().name,
        "versions": versions,
        "parameters": parameters,
        "rows": shown,
    }


def _titles(batches: Sequence[Path]) -> list[str]:
    """Names of the folders, with the folders above if names are alike."""
    names = [batch.resolve().name for batch in batches]
    return [
        name
        if names.count(name) == 1
        else batch.resolve().relative_to(batch.resolve().parents[1]).as_posix()
        for name, batch in zip(names, batches, strict=True)
    ]


def _version(batch: Path, title: str, folder: Path) -> dict[str, Any]:
    """Title, system under test, version of the toolchain, and link to the report of a batch."""
    settings = journal.settings(batch)
    results = (folder / RESULT for folder in sorted(batch.iterdir()) if (folder / RESULT).is_file())
    try:
        tool = str(read_object(next(results)).get("version", ""))
    except (StopIteration, InvalidFile):
        tool = ""
    report = batch / REPORT
    link = _link(report, folder) if report.is_file() else None
    return {"title": title, "system": str(settings.get("sut")), "tool": tool, "report": link}


def _cell(run: dict[str, Any], batch: Path, folder: Path) -> dict[str, Any]:
    measured = next(((name, run[name]) for name in _MEASURES if run.get(name) is not None), None)
    replay = batch / run["name"] / REPLAY
    return {
        "state": run["state"],
        "content": run.get("content"),
        "message": run["message"],
        "measure": None if measured is None else [measured[0], rounded(measured[1])],
        "replay": _link(replay, folder) if replay.is_file() else None,
    }


def _link(path: Path, folder: Path) -> str:
    return quote(Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix())
