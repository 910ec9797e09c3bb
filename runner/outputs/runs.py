"""All runs of a batch as one Parquet table, a row a run."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.measures.rss import PARAMETERS
from schemas.storage import keep

if TYPE_CHECKING:
    import pyarrow as pa

    from runner.batch.jobs import Outcome

EXTREMES = ("min_ttc", "min_thw", "max_drac", "min_distance", "pet", "max_collision_probability", "max_risk_field")
"""Measures of `runner.measures.criticality.Criticality.summary` that have a value, a time and another participant."""
SHARES = tuple(f"rss_risk_{name.replace('-', '_')}" for name in PARAMETERS)
"""Measures that are a number."""


def write_runs(outcomes: Iterable[Outcome], path: Path) -> None:
    """Write the table, whole or not at all, sorted by name: same runs, same content, whoever did them in whatever order.

    Columns: name, file (that the user named), scenario, parameters (a map of texts), seed (null unless runs were repeated), state
    (`passed`, `failed`, `error`), verdict (null where there was no run), exit_code, status, end_time (s), message, and the
    criticality measures: each extreme with `_time` (s) and `_other`, and the shares of RSS violations; null where they are not
    defined. Units as in `runner.measures.criticality`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [_row(outcome) for outcome in sorted(outcomes, key=lambda outcome: outcome.job.name)]
    content = BytesIO()
    pq.write_table(pa.Table.from_pylist(rows, schema=_schema()), content, compression="zstd")
    keep(content.getvalue(), path)


def _row(outcome: Outcome) -> dict[str, Any]:
    job = outcome.job
    row: dict[str, Any] = {
        "name": job.name,
        "file": _text(job.source),
        "scenario": _text(job.scenario),
        "parameters": [(name, _text(value)) for name, value in sorted(job.parameters.items())],
        "seed": job.seed,
        "state": outcome.state,
        "verdict": outcome.state if outcome.state != "error" else None,
        "exit_code": outcome.exit_code,
        "status": outcome.status or None,
        "end_time": outcome.end_time,
        "message": _text(outcome.message),
        "remarks": [_text(remark) for remark in outcome.remarks],
    }
    for name in EXTREMES:
        extreme = outcome.measures.get(name) or {}
        row |= {name: extreme.get("value"), f"{name}_time": extreme.get("time"), f"{name}_other": extreme.get("other")}
    return row | {name: outcome.measures.get(name) for name in SHARES}


def _text(value: object) -> str:
    """Text that UTF-8 can hold: bytes of file names that are none are written as JSON would."""
    return str(value).encode("utf-8", "backslashreplace").decode()


def _schema() -> pa.Schema:
    import pyarrow as pa

    text, number = pa.string(), pa.float64()
    fields = {
        "name": text,
        "file": text,
        "scenario": text,
        "parameters": pa.map_(text, text),
        "seed": pa.int64(),
        "state": text,
        "verdict": text,
    }
    fields |= {"exit_code": pa.int64(), "status": text, "end_time": number, "message": text, "remarks": pa.list_(text)}
    for name in EXTREMES:
        fields |= {name: number, f"{name}_time": number, f"{name}_other": text}
    return pa.schema(list((fields | dict.fromkeys(SHARES, number)).items()))
