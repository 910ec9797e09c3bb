"""The results of a run as a folder of files: written, and read back."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner.batch.outputs import report, tables
from runner.engine.participants.declaration import BoundingBox
from runner.judging.criteria.criterion import CriterionResult
from runner.judging.result import FAILED, Cause, RunEvidence, RunResult, Verdict
from runner.recording import COLUMNS, LogEntry, Recording, Track, arrow_type
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import current
from schemas.common.storage import (
    DRAFT,
    fingerprint,
    parse_object,
    read_bytes,
    read_object,
    read_parquet,
)

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

    from xodr.graph.network import RoadNetwork


RESULT, PICTURE = "result.json", "picture.png"
RUN_FILES = {
    RESULT,
    "trajectories.parquet",
    "trajectories.csv",
    "criticality.parquet",
    "events.jsonl",
    PICTURE,
    "replay.html",
    "before-and-after.html",
}
"""Names of the files of a run"""


def write_run(result: RunResult, folder: Path, plot: bool = False) -> dict[str, Any]:
    """Write a run's files into its folder, whole or not at all; return its criticality measures.

    Args:
        plot: add a picture.

    Raises:
        UsageError: something else is in the way.
    """
    # Beside its place, so that the rename stays on one file system and is one step.
    draft = folder.parent / f"{DRAFT}{secrets.token_hex(4)}"
    draft.mkdir()
    try:
        values = report.summary(result)
        tables.write_parquet(result, draft / "trajectories.parquet")
        tables.write_csv(result, draft / "trajectories.csv")
        tables.write_criticality(result, draft / "criticality.parquet")
        report.write_events(result.events, draft / "events.jsonl")
        report.write_json(values, draft / RESULT)
        if plot:
            from runner.batch.outputs.picture import write_picture

            write_picture(result, draft / PICTURE)
        _replace(folder, draft)
    finally:
        # After the rename there is none: only what was interrupted is removed.
        shutil.rmtree(draft, ignore_errors=True)
    return values["criticality"] or {}


def _replace(folder: Path, draft: Path) -> None:
    """Put a folder in the place of one that an earlier run left, whole or not,
    and of nothing else.
    """
    if folder.is_symlink() or folder.exists():
        is_run = folder.is_dir() and not folder.is_symlink()
        # Only what a run wrote is removed: a folder of the user's may have the same name.
        if not is_run or not (
            (folder / RESULT).is_file() or {path.name for path in folder.iterdir()} <= RUN_FILES
        ):
            raise UsageError(
                "this is in the way of a run's results, and is not of a run", path=folder
            )
        shutil.rmtree(folder)
    draft.rename(folder)


def digests(folder: Path) -> dict[str, str]:
    """Digests of the files in the folder of a run's results, by name; none where it is not there or
    can't be read."""
    try:
        return {
            path.name: fingerprint(path.read_bytes())
            for path in sorted(folder.iterdir())
            if path.is_file()
        }
    except OSError:
        return {}


TRAJECTORIES, EVENTS = "trajectories.parquet", "events.jsonl"
_GREATEST = 1e9
"""No run has a value beyond this, in whatever unit"""
_SHORTEST, _LONGEST = 0.001, 1e6
"""Limits of steps and runs, s"""


class EntityRecord(NamedTuple):
    """A participant of a run; the mass is 0 where it is not known."""

    kind: str
    category: str
    box: BoundingBox
    mass: float


class Setup(NamedTuple):
    """Scenario, parameters and settings of a run.

    Attributes:
        scenario, road: its files, which may be gone; None where it was on no road.
        timestep: s.
        ego: its name; None where there was none.
        entities: each participant by name.
    """

    scenario: Path
    road: Path | None
    timestep: float
    ego: str | None
    entities: dict[str, EntityRecord]


def read_setup(path: Path) -> Setup:
    """Read scenario, parameters and settings of the run with this `RESULT`.

    Raises:
        InvalidFile: the file is missing or damaged.
    """
    values = read_object(path)
    with _result_of_a_run(path):
        return _setup(values)


def load_run(folder: Path, road: Path | None = None) -> RunResult:
    """Load the run of a folder of results.

    Args:
        road: the OpenDRIVE file, where it is not any more where the run had it.

    Raises:
        InvalidFile: a file of the run is missing or damaged, or the road network is not there any
            more.
    """
    path = folder / RESULT
    values = read_object(path)
    with _result_of_a_run(path):
        setup = _setup(values)
        tracks = _tracks(folder / TRAJECTORIES, setup)
        return RunResult(
            scenario=setup.scenario,
            parameters={str(name): str(value) for name, value in values["parameters"].items()},
            status=str(values["status"]),
            end_time=_number(values, "end_time", 0.0, _LONGEST),
            verdict=_verdict(values),
            remarks=tuple(map(str, values["remarks"])),
            ego=setup.ego,
            sut=str(values["sut"]),
            settings=dict(values["settings"]),
            events=_events(folder / EVENTS),
            recording=Recording(tracks, setup.timestep, _network(setup.road, road, path)),
            name=folder.resolve().name,
            sut_parameters=dict(values.get("sut_parameters", {})),
            actors=_actors(values.get("actors", {})),
        )


@contextmanager
def _result_of_a_run(path: Path) -> Iterator[None]:
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InvalidFile(
            f"this is not the result of a run: {type(error).__name__}: {error}", path=path
        ) from None


def _setup(values: Mapping[str, Any]) -> Setup:
    files, ego = values["files"], values["ego"]
    return Setup(
        Path(files["scenario"]),
        None if files["road"] is None else Path(files["road"]),
        _number(values["settings"], "timestep", _SHORTEST),
        None if ego is None else str(ego),
        {name: _entity(who) for name, who in values["entities"].items()},
    )


def _verdict(values: Mapping[str, Any]) -> Verdict:
    """Verdict of a run; runs of earlier versions have no causes, and without evidence none has
    passed."""
    failures = tuple(map(str, values["reasons"])) if values["verdict"] == FAILED else ()
    causes = tuple(
        Cause(str(cause["name"]), str(cause["text"])) for cause in values.get("causes", ())
    )
    verdict = Verdict(failures, causes, _criteria(values), _evidence(values))
    # Results may be edited: a pass has to follow from reasons and evidence.
    if verdict.outcome != values["verdict"] and "evidence" in values:
        raise ValueError(f"the verdict {values['verdict']!r} does not follow from its reasons")
    return verdict


def _evidence(values: Mapping[str, Any]) -> tuple[RunEvidence, ...]:
    """Evidence of the run."""
    return tuple(
        RunEvidence(
            str(row["name"]),
            _number(row, "value"),
            None if row["planned"] is None else int(_number(row, "planned", 0.0)),
            str(row["unit"]),
            _number(row, "least", 0.0),
            tuple(map(str, row["texts"])),
        )
        for row in values.get("evidence", ())
    )


def _criteria(values: Mapping[str, Any]) -> tuple[CriterionResult, ...]:
    """Results of criteria; runs of earlier versions have none."""
    states = {"passed": True, "failed": False, "not judged": None}
    return tuple(
        CriterionResult(
            str(criterion["name"]),
            str(criterion["entity"]),
            states[criterion["result"]],
            None if criterion["value"] is None else _number(criterion, "value"),
            str(criterion["unit"]),
            str(criterion["reason"]),
        )
        for criterion in values.get("criteria", ())
    )


def _actors(groups: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the actors of each maneuver group; runs of earlier versions lack them."""
    return {str(path): tuple(map(str, names)) for path, names in groups.items()}


def _number(
    values: Mapping[str, Any], name: str, least: float = -_GREATEST, most: float = _GREATEST
) -> float:
    value = values[name]
    # Booleans are numbers in Python.
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ValueError(f"{name} is {value!r}")
    return float(value)


def _events(path: Path) -> list[LogEntry]:
    events = []
    for number, line in enumerate(read_bytes(path).split(b"\n"), 1):
        if line:
            entry = parse_object(line, path, number)
            try:
                events.append(
                    LogEntry(
                        _number(entry, "time"),
                        *(str(entry[name]) for name in ("kind", "subject", "text")),
                    )
                )
            except (KeyError, TypeError, ValueError):
                raise InvalidFile(
                    "this line is not of an event log", path=path, line=number
                ) from None
    return events


def _network(recorded: Path | None, given: Path | None, path: Path) -> RoadNetwork | None:
    file = given or recorded
    if file is None:
        return None
    from xodr.reader import load

    current().admit(file)
    if given is None and not os.path.isfile(
        file
    ):  # unlike Path.is_file it takes names of any length
        raise InvalidFile(
            f"the road network {recorded} of this run no longer exists; give it by --road",
            path=path,
        )
    return load(file)


def _tracks(path: Path, setup: Setup) -> list[Track]:
    """One track for each participant, in the order of the setup; columns are read when they are
    asked for."""
    import numpy as np

    table = _table(path)
    # Rows by entity in one pass: a filter for each would read the table again and again.
    encoded = table["entity"].combine_chunks().dictionary_encode()
    names, codes = encoded.dictionary.to_pylist(), encoded.indices.to_numpy()
    absent = set(names) - setup.entities.keys()
    if absent:
        raise InvalidFile(f"{min(absent)!r} is not among the entities of {RESULT}", path=path)
    ends = np.cumsum(np.bincount(codes, minlength=len(names)))
    rows = (
        dict(zip(names, np.split(np.argsort(codes, kind="stable"), ends[:-1]), strict=True))
        if names
        else {}
    )
    none = np.zeros(0, np.int64)
    return [
        Track(
            name,
            who.kind,
            who.category,
            who.box,
            partial(_columns, table, rows.get(name, none), path),
            who.mass,
        )
        for name, who in setup.entities.items()
    ]


def _entity(values: Mapping[str, Any]) -> EntityRecord:
    """A participant; runs of earlier versions have no masses."""
    mass = _number(values, "mass") if "mass" in values else 0.0
    return EntityRecord(str(values["kind"]), str(values["category"]), _box(values["box"]), mass)


def _box(values: Mapping[str, Any]) -> BoundingBox:
    return BoundingBox(*(_number(values, name) for name in BoundingBox._fields))


def _table(path: Path) -> pa.Table:
    import pyarrow as pa

    current().admit(path)
    # Named columns alone, in their types: a file may hold any others.
    schema = pa.schema({name: arrow_type(name) for name in ("entity", *COLUMNS)})
    try:
        return read_parquet(path, schema.names).select(schema.names).cast(schema)
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InvalidFile(f"the results of a run can't be read: {reason}", path=path) from None


def _columns(table: pa.Table, rows: np.ndarray, path: Path) -> dict[str, np.ndarray]:
    import numpy as np

    mine = table.take(rows)
    columns = {name: mine[name].to_numpy(zero_copy_only=False).copy() for name in COLUMNS}
    for name, values in columns.items():
        # NaN fails the comparison, too.
        if name != "road_id" and not (np.abs(values) <= _GREATEST).all():
            raise InvalidFile(f"the column {name} has values that no run has", path=path)
    if (np.diff(columns["time"]) <= 0.0).any():
        raise InvalidFile(f"the times of {mine['entity'][0]} do not ascend", path=path)
    return columns
