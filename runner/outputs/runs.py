"""All runs of a batch as one Parquet table, a row a run."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.measures.measure import measures
from schemas.common.storage import keep

if TYPE_CHECKING:
    import pyarrow as pa

    from runner.batch.jobs import Outcome

CONTACT = ("impact_side", "impact_ahead", "impact_left", "ego_strikes")
"""Columns of a contact: side of the ego, its point (m ahead and left of the middle of the box), whether the ego hit the other"""


def write_runs(outcomes: Iterable[Outcome], path: Path) -> None:
    """Write the table, whole or not at all, sorted by name: the same runs give the same content, in whatever order they ended.

    Columns: name, file (that the user named), scenario, parameters (a map of texts), seed (null unless runs were repeated), state
    (`passed`, `failed`, `inconclusive`, `error`), verdict (null where there was no run), exit_code, status, end_time (s),
    message, remarks, causes (names; why a run is inconclusive), `CONTACT` of a failed run in which the ego touches another
    participant, and the criticality measures: each extreme with `_time` (s) and `_other`,
    and the shares of RSS violations; null where they are not defined. Units as in `runner.measures.criticality`.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = [_row(outcome) for outcome in sorted(outcomes, key=lambda outcome: outcome.job.name)]
    content = BytesIO()
    pq.write_table(pa.Table.from_pylist(rows, schema=schema()), content, compression="zstd")
    keep(content.getvalue(), path, durable=True)


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
        "causes": outcome.causes,
        **_contact(outcome.impact),
    }
    for name, each in measures().items():
        found = outcome.measures.get(name)
        if each.is_extreme:
            extreme = found or {}
            row |= {name: extreme.get("value"), f"{name}_time": extreme.get("time"), f"{name}_other": extreme.get("other")}
        else:
            row[name] = found
    return row


def _contact(impact: dict[str, Any] | None) -> dict[str, Any]:
    """Columns of a contact."""
    if impact is None:
        return dict.fromkeys(CONTACT)
    ahead, left = impact["point"]
    return dict(zip(CONTACT, (impact["side"], ahead, left, impact["strikes"]), strict=True))


def _text(value: object) -> str:
    """Text that UTF-8 can hold: bytes of file names that are none are written as JSON would."""
    return str(value).encode("utf-8", "backslashreplace").decode()


def schema() -> pa.Schema:
    """Columns of the table, and their types."""
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
    fields["causes"] = pa.list_(text)
    fields |= dict(zip(CONTACT, (text, number, number, pa.bool_()), strict=True))
    for name, each in measures().items():
        fields |= {name: number, f"{name}_time": number, f"{name}_other": text} if each.is_extreme else {name: number}
    return pa.schema(list(fields.items()))
