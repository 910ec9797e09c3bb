"""Target `parquet`: tables of a run: trajectories (as by `xosc-run --out`), participants, events,
criticality, tags.

The road file is beside them, whole; the table of participants names it, with its projection and the
offset of its header, in the metadata of its schema.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from runner.batch.outputs.tables import write_criticality, write_parquet
from schemas.common.fates import kept
from xosc.writing.tags import tags_of

if TYPE_CHECKING:
    from pathlib import Path

    from runner.judging.result import RunResult
    from runner.recording import LogEntry
    from xosc.exports.draft import Folder
    from xosc.writing.tags import Tag


FATES = {
    **dict.fromkeys(
        ("name", "kind", "category", "role", "length and width", "height of the box",
            "box about the reference point",
         "front axle", "mass", "ego"), kept("participants")),
    **dict.fromkeys(
        ("time", "position", "height", "heading", "pitch", "roll", "speed", "acceleration",
            "place on the road"),
        kept("trajectories")),
    "lights": kept("events"), "events": kept("events"), "verdict": kept("metadata"),
    "criticality": kept("criticality"),
    "tags": kept("tags"), "projection": kept("metadata"), "offset": kept("metadata"),
    **dict.fromkeys(
        ("lane borders", "road heights", "lane heights", "lane types", "speed limits", "road marks",
            "lane links", "neighbours",
         "junctions", "signs", "traffic lights"), kept("road file")),
    "light states": kept("events"), "objects": kept("road file"),
}  # fmt: skip
"""Fates of `runner.exchange.exports.RUN_FIELDS`; values of tags are texts"""

_TEXTS = ("name", "kind", "category", "role")
_SIZES = ("x", "y", "z", "length", "width", "height")

TARGETS = {"parquet": "Parquet tables of trajectories, participants, events, criticality and tags"}


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write the tables of a run.

    Raises:
        UsageError: a file is in the way.
        InvalidFile: the scenario's tags are not readable.
    """
    folder.write_by(f"{name}.parquet", partial(write_parquet, result))
    folder.write_by(f"{name}.criticality.parquet", partial(write_criticality, result))
    folder.write_by(f"{name}.participants.parquet", partial(_write_participants, result))
    folder.write_by(f"{name}.events.parquet", partial(_write_events, result.events))
    if (network := result.recording.network) is not None:
        folder.copy(network.path, network.path.name)
    folder.write_by(f"{name}.tags.parquet", partial(_write_tags, tags_of(result.scenario)))
    return []


def _write_participants(result: RunResult, path: Path) -> None:
    """One row a participant: box about the reference point and front axle in m, mass in kg."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tracks = list(result.recording.tracks.values())
    texts = {
        name: pa.array([getattr(track, name) for track in tracks], pa.string()) for name in _TEXTS
    }
    sizes = {
        name: pa.array([getattr(track.box, name) for track in tracks], pa.float64())
        for name in _SIZES
    }
    numbers = {
        name: pa.array([getattr(track, name) for track in tracks], pa.float64())
        for name in ("front_axle", "mass")
    }
    ego = {"ego": pa.array([track.name == result.ego for track in tracks], pa.bool_())}
    table = pa.table(
        {**texts, **{f"box_{name}": column for name, column in sizes.items()}, **numbers, **ego}
    )
    metadata = {"status": result.status, "verdict": str(result.verdict), "sut": result.sut}
    if (network := result.recording.network) is not None:
        metadata |= {"road_file": network.path.name, "geo_reference": network.geo_reference or ""}
        metadata["geo_offset"] = json.dumps(list(network.header.offset))
    pq.write_table(table.replace_schema_metadata(metadata), path)


def _write_events(events: Sequence[LogEntry], path: Path) -> None:
    """One row an entry of the event log: time (s), kind, subject, text."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = list(zip(*events, strict=True)) or [(), (), (), ()]
    kinds = {"time": pa.float64(), "kind": pa.string(), "subject": pa.string(), "text": pa.string()}
    arrays = {
        name: pa.array(values, kind)
        for (name, kind), values in zip(kinds.items(), columns, strict=True)
    }
    pq.write_table(pa.table(arrays), path)


def _write_tags(tags: list[Tag], path: Path) -> None:
    """One row a tag: type, value (numbers and lists as text; null where the type says all),
    ontology."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    values = [None if tag.value is None else str(tag.value) for tag in tags]
    columns = {
        "type": [tag.type for tag in tags],
        "value": values,
        "ontology": [tag.ontology for tag in tags],
    }
    pq.write_table(
        pa.table({name: pa.array(column, pa.string()) for name, column in columns.items()}), path
    )
