"""Target `parquet`: tables of a run: trajectories (as by `xosc-run --out`), criticality measures, and the scenario's tags."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from runner.outputs.tables import write_criticality, write_parquet
from xosc.tags import tags_of

if TYPE_CHECKING:
    from pathlib import Path

    from runner.interpreter.result import RunResult
    from xosc.exports.draft import Folder
    from xosc.tags import Tag


TARGETS = {"parquet": "Parquet tables of trajectories, criticality and tags"}


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the tables of a run.

    Raises:
        UsageError: a file is in the way.
        InvalidFile: the scenario's tags are not readable.
    """
    folder.write_by(f"{name}.parquet", partial(write_parquet, result))
    folder.write_by(f"{name}.criticality.parquet", partial(write_criticality, result))
    folder.write_by(f"{name}.tags.parquet", partial(_write_tags, tags_of(result.scenario)))
    return []


def _write_tags(tags: list[Tag], path: Path) -> None:
    """One row a tag: type, value (numbers and lists as text; null where the type says all), ontology."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    values = [None if tag.value is None else str(tag.value) for tag in tags]
    columns = {"type": [tag.type for tag in tags], "value": values, "ontology": [tag.ontology for tag in tags]}
    pq.write_table(pa.table({name: pa.array(column, pa.string()) for name, column in columns.items()}), path)
