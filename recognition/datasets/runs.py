"""Results of this project's own runs: folders with `trajectories.parquet` and `result.json`, as `xosc-run --out` writes them.

The road network is the file that the run was on, where it is still there.
"""

from __future__ import annotations

import json
import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recognition.datasets.participants import Participant
from recognition.datasets.rows import Clock, in_order
from recognition.datasets.source import Report, Source
from recognition.datasets.tables import read_table
from recognition.datasets.tracks import cut
from recognition.datasets.values import GREATEST, Kind
from runner.entities import BoundingBox
from runner.recording import COLUMNS, Recording
from schemas.errors import InvalidFile
from xodr.network import RoadNetwork
from xodr.reader import load

FORMAT = "run"
_TRAJECTORIES, _RESULT = "trajectories.parquet", "result.json"
_KINDS: dict[str, Kind] = {"entity": "text", **dict.fromkeys(COLUMNS, "number"), "road_id": "label", "lane_id": "integer"}
_PER_SECOND = 1e6
"""Times are compared in µs."""


def claims(path: Path) -> bool:
    """Whether a file is the trajectories of a run."""
    return path.name == _TRAJECTORIES and path.with_name(_RESULT).is_file()


def sources(path: Path, roads: Path) -> list[Source]:
    """The run that a trajectory file belongs to; runs of one scenario have one site."""
    return [Source(path.parent.name, path.parent.name.partition("~")[0], FORMAT, path, partial(_read, path))]


def road(path: Path) -> Path:
    """The OpenDRIVE file of the run that a trajectory file belongs to.

    Raises:
        InvalidFile: the run had none, or it is not there any more.
    """
    return _file(path, "road")


def scenario(path: Path) -> Path:
    """The scenario that a trajectory file is the run of.

    Raises:
        InvalidFile: it is not there any more.
    """
    return _file(path, "scenario")


def ego(path: Path) -> str | None:
    """Name of the ego of the run that a trajectory file belongs to; None where it has none."""
    name = _result(path.with_name(_RESULT)).get("ego")
    return name if isinstance(name, str) else None


def _file(path: Path, what: str) -> Path:
    file = path.with_name(_RESULT)
    name = _entry(_result(file), file, "files").get(what)
    if not isinstance(name, str) or not os.path.isfile(name):  # unlike Path.is_file it takes names of any length
        raise InvalidFile(f"the {what} of this run, {name!r}, is not there", path=file)
    return Path(name)


def _read(path: Path) -> tuple[Recording, Report]:
    file = path.with_name(_RESULT)
    result = _result(file)
    step = _finite(_entry(result, file, "settings"), file, "timestep")
    if step <= 0.0:
        raise InvalidFile(f"the timestep is {step:g}", path=file)
    entities = _entry(result, file, "entities")
    table = read_table(path, _KINDS)
    names = list(dict.fromkeys(table["entity"]))
    number = {name: index for index, name in enumerate(names)}
    track = np.fromiter((number[name] for name in table["entity"]), np.int64, len(table))
    clock = Clock("time", np.round(table["time"] * _PER_SECOND).astype(np.int64), _PER_SECOND, step)
    rows = in_order(table, track, clock)
    who = [_participant(_entry(entities, file, name), file, name) for name in names]
    columns = {name: table[name][rows.order] for name in COLUMNS}
    report = rows.report(names)
    return Recording(cut(rows, who, columns), step, _network(_entry(result, file, "files"), file, report)), report


def _network(files: dict[str, Any], file: Path, report: Report) -> RoadNetwork | None:
    road = files.get("road")
    if road is None:
        return None
    if not isinstance(road, str):
        raise InvalidFile(f"road is {road!r}, the path of a file is expected", path=file)
    if os.path.isfile(road):
        return load(Path(road))
    report.remarks.append(f"the road network {road} is not there any more")
    return None


def _result(path: Path) -> dict[str, Any]:
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidFile(f"not readable as JSON: {error}", path=path) from None
    if not isinstance(result, dict):
        raise InvalidFile("this is no JSON object", path=path)
    return result


def _entry(parent: dict[str, Any], path: Path, name: str) -> dict[str, Any]:
    found = parent.get(name)
    if not isinstance(found, dict):
        raise InvalidFile(f"there is no object {name!r}", path=path)
    return found


def _participant(entity: dict[str, Any], path: Path, name: str) -> Participant:
    box = _entry(entity, path, "box")
    kind, category = entity.get("kind"), entity.get("category")
    if not isinstance(kind, str) or not isinstance(category, str):
        raise InvalidFile(f"kind or category of {name!r} is missing", path=path)
    return Participant(name, kind, category, BoundingBox(*(_finite(box, path, field) for field in BoundingBox._fields)))


def _finite(values: dict[str, Any], path: Path, name: str) -> float:
    value = values.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= GREATEST:
        raise InvalidFile(f"{name} is {value!r}, a number is expected", path=path)
    return float(value)
