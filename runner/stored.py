"""Runs read back from the folders that `xosc-run --out` writes."""

from __future__ import annotations

import json
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.entities import BoundingBox
from runner.recording import COLUMNS, Recording, Track
from runner.result import RunResult, Verdict
from runner.simulation import LogEntry
from schemas.errors import InvalidFile

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from xodr.network import RoadNetwork

RESULT, TRAJECTORIES, EVENTS = "result.json", "trajectories.parquet", "events.jsonl"


def load_run(folder: Path, road: Path | None = None) -> RunResult:
    """The run whose results lie in a folder.

    Args:
        road: the OpenDRIVE file, where it is not any more where the run had it.

    Raises:
        InvalidFile: a file of the run is missing or damaged, or the road network is not there any more.
    """
    path = folder / RESULT
    values = _object(path, _text(path))
    try:
        settings = dict(values["settings"])
        recording = Recording(
            _tracks(folder / TRAJECTORIES, values["entities"]),
            float(settings["timestep"]),
            _network(values["files"]["road"], road, path),
        )
        return RunResult(
            scenario=Path(values["files"]["scenario"]),
            parameters={str(name): str(value) for name, value in values["parameters"].items()},
            status=str(values["status"]),
            end_time=float(values["end_time"]),
            verdict=Verdict(values["verdict"] == "passed", tuple(map(str, values["reasons"]))),
            remarks=tuple(map(str, values["remarks"])),
            ego=values["ego"],
            sut=str(values["sut"]),
            settings=settings,
            events=_events(folder / EVENTS),
            recording=recording,
            name=folder.resolve().name,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InvalidFile(f"this is not the result of a run: {type(error).__name__}: {error}", path=path) from None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidFile(f"the results of a run can't be read: {reason}", path=path) from None


def _object(path: Path, text: str, line: int | None = None) -> dict[str, Any]:
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidFile(f"not readable as JSON: {error}", path=path, line=line) from None
    if not isinstance(values, dict):
        raise InvalidFile("a JSON object is expected", path=path, line=line)
    return values


def _events(path: Path) -> list[LogEntry]:
    events = []
    for number, line in enumerate(_text(path).split("\n"), 1):
        if line:
            entry = _object(path, line, number)
            try:
                events.append(LogEntry(float(entry["time"]), *(str(entry[name]) for name in ("kind", "subject", "text"))))
            except (KeyError, TypeError, ValueError):
                raise InvalidFile("this line is not of an event log", path=path, line=number) from None
    return events


def _network(recorded: str | None, given: Path | None, path: Path) -> RoadNetwork | None:
    if given is None and recorded is None:
        return None
    from xodr.reader import load

    if given is None and recorded is not None and not os.path.isfile(recorded):  # unlike Path.is_file it takes any length
        raise InvalidFile(f"the road network {recorded} of this run is not there any more; name it by --road", path=path)
    return load(given or str(recorded))


def _tracks(path: Path, entities: dict[str, Any]) -> list[Track]:
    """One track for each participant, in the order of the result's entities; columns are read when they are asked for."""
    import numpy as np

    table = _table(path)
    encoded = table["entity"].combine_chunks().dictionary_encode()
    names, codes = encoded.dictionary.to_pylist(), encoded.indices.to_numpy()
    absent = set(names) - entities.keys()
    if absent:
        raise InvalidFile(f"{min(absent)!r} is not among the entities of {RESULT}", path=path)
    ends = np.cumsum(np.bincount(codes, minlength=len(names)))
    rows = dict(zip(names, np.split(np.argsort(codes, kind="stable"), ends[:-1]), strict=True)) if names else {}
    none = np.zeros(0, np.int64)
    return [
        Track(name, who["kind"], who["category"], BoundingBox(**who["box"]), partial(_columns, table, rows.get(name, none)))
        for name, who in entities.items()
    ]


def _table(path: Path) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(path, columns=["entity", *COLUMNS])
    except (OSError, pa.ArrowException) as error:
        raise InvalidFile(f"the trajectories can't be read: {str(error).splitlines()[0]}", path=path) from None


def _columns(table: pa.Table, rows: np.ndarray) -> dict[str, np.ndarray]:
    mine = table.take(rows)
    return {name: mine[name].to_numpy(zero_copy_only=False).copy() for name in COLUMNS}
