"""Runs of a loop: edge cases driven again as files, and stages that a folder already holds."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields, is_dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

from generation.loop.findings import (
    LoopStage,
    Measured,
    Ran,
    Recognised,
    Searched,
    ShownRun,
    StageFinding,
)
from recognition.catalogue.detect import ByRules
from recognition.catalogue.pipeline import build
from recognition.catalogue.recordings import CatalogueSettings
from recognition.catalogue.writing.index import rows_of
from recognition.labels.maneuvers.units import Samples, extract_from
from recognition.recordings import Source, cache_roads
from runner.batch.batch import print_line, run_batch
from runner.batch.jobs import Job, Outcome
from runner.batch.pool import Workers
from runner.judging.settings import RunSettings
from runner.view.replay.player import REPLAY, keep_replay
from runner.view.report import report, write_report
from schemas.common.errors import ExitCode, InvalidFile, ToolchainError, UsageError
from schemas.common.storage import (
    LOCK,
    Records,
    check_settings,
    digest,
    read_bytes,
    read_object,
    write_object,
    writing,
)
from schemas.common.terminal.command_line import Bar
from schemas.common.terminal.text import many, one_line
from xosc.distributions import ParameterSpace

MODEL = "model"
"""Folder in the output folder with the model as it is after the recordings: the classes discovered
in them are known to it"""


def catalogue(
    paths: Sequence[Path],
    folder: Path,
    model: Path | None,
    bar: Bar,
    keep: Path | None = None,
    processes: int = 1,
) -> Recognised:
    """Make a catalogue of recordings.

    Args:
        paths: recordings.
        folder: of the catalogue.
        model: folder of the model; None for the rules alone.
        keep: folder for the model as it is afterwards; None to forget it.
        processes: that read, write and play.
    """
    workers = Workers(processes)
    if model is None:
        summary = build(paths, folder, CatalogueSettings(), ByRules, bar, workers)
    else:
        from recognition.catalogue.model import load

        recogniser = load(model, discover=True)
        summary = build(paths, folder, CatalogueSettings(), lambda: recogniser, bar, workers)
        if keep is not None:
            recogniser.keep(
                keep, waiting=False
            )  # so that what runs show is not clustered with the unknown of these recordings
    return Recognised(
        classes=dict(sorted(summary.classes.items())),
        states=dict(sorted(Counter(row["state"] for row in rows_of(folder)).items())),
        failures={name: str(error) for name, error in summary.failures.items()},
        edited=summary.edited,
    )


def units(sources: Sequence[Source], path: Path, bar: Bar) -> Measured:
    """Extract the parameters of the recordings' manoeuvres and write them as a table."""
    parts, failures = [], {}
    with bar("measuring manoeuvres", len(sources)) as advance:
        for source in sources:
            try:
                parts.append(extract_from(source, cache_roads()))
            except ToolchainError as error:
                failures[source.name] = str(error)
            advance(1)
    samples = Samples.joined(parts) if parts else None
    if samples is not None:
        samples.write(path)
    # No table where nothing was read: its absence tells the loop to use the shipped units.
    kinds = Counter(samples.kinds.tolist()) if samples is not None else Counter()
    return Measured(kinds=dict(sorted(kinds.items())), failures=failures)


def run_all(
    jobs: Iterable[Job | Outcome],
    settings: RunSettings,
    folder: Path,
    out: Path,
    processes: int,
    progress: Callable[[int], None],
    named: Callable[[Path], str],
) -> Ran:
    """Run jobs into a folder, with a replay page of each run and a report of all; goes on where it
    was interrupted.

    Args:
        settings: how they are run.
        folder: for the results, below `out`.
        out: output folder of the loop.
        named: what a file is called in the result, no two the same.

    Returns:
        What `runner.view.report` gives for each run.
    """
    keep = partial(keep_replay, out=folder)
    # The loop's own replay page is a result like the others: without it a run counts as not done.
    outcomes = run_batch(
        jobs, settings, out=folder, processes=processes, resume=True, also=[keep], needs=[REPLAY]
    )
    files, crashed = {}, 0
    for outcome in outcomes:
        # The report names runs, not files; a batch that goes on yields the finished ones here too.
        files[outcome.job.name] = outcome.job.source
        crashed += outcome.exit_code == ExitCode.INTERNAL
        progress(1)
    write_report(folder)
    place = folder.relative_to(out).as_posix()
    ran = Ran(crashed=crashed)
    for run in report(folder)["runs"]:
        replay = f"{place}/{run['replay']}#t={run['moment']}" if run["replay"] else None
        copied = {
            name: run[name] for name in ("name", "state", "status", "message", "end", "measures")
        }
        ran.files.setdefault(named(files[run["name"]]), []).append(
            ShownRun(**copied, replay=replay)
        )
    return replace(ran, failures=dict(_failures(ran)))


def _failures(ran: Ran) -> Iterator[tuple[str, str]]:
    """The files with runs that ended with an error, and what the first of these says."""
    for name, runs in ran.files.items():
        messages = [run.message for run in runs if run.state == "error"]
        if messages:
            more = (
                f" (and {many(len(messages) - 1, 'more run')} with errors)"
                if len(messages) > 1
                else ""
            )
            yield name, messages[0] + more


def sampled(paths: Iterable[Path], most: int, named: Callable[[Path], str]) -> dict[str, int]:
    """Return the number of parameter sets of variation files that have more than `most`; unreadable
    files have none.

    Args:
        named: what a file is called in the result, as for `run_all`.
    """
    sizes = {}
    for path in paths:
        # The batch itself reports a file that can't be read; here it only has no size.
        with suppress(ToolchainError):
            sizes[named(path)] = ParameterSpace(path).size
    return {name: size for name, size in sizes.items() if size > most}


T = TypeVar("T")


_FOLDER = "stages"
_SETTINGS = "loop.json"
_KEYS = {"of", "found", "files"}
_REMEDY = "remove it to have it done again"

F = TypeVar("F", bound=StageFinding)

Report = Callable[[LoopStage, StageFinding, float | None], None]
"""Called with each finished stage, what it found, and the time (s) that was waited for it; None
where it was finished before."""


class FinishedStages:
    """The stages of one loop.

    A stage that is finished leaves a record (see `schemas.common.storage.Records`) with the digests
    of the files that it made. Where a record or a file is damaged or missing, the stage is done
    again.

    Args:
        out: the output folder; made where it does not exist.
        settings: all that decides what the stages find.
        report: called with each stage as it is finished.
        tell: called with a line about a finished stage that is done again.

    Raises:
        UsageError: the folder holds a loop with other settings, or something else, or can't be
            made.
    """

    def __init__(
        self,
        out: Path,
        settings: Mapping[str, Any],
        report: Report,
        tell: Callable[[str], None] = print_line,
    ) -> None:
        self._out, self._folder, self._report, self._tell = out, out / _FOLDER, report, tell
        path = out / _SETTINGS
        check_settings(path, settings, "a loop")
        # The lock is there before the loop begins.
        # Nothing of the user's is ever mixed with results, which are removed when inputs change.
        if not path.exists() and out.is_dir() and any(path.name != LOCK for path in out.iterdir()):
            raise UsageError(
                "there is something else in this folder: a loop needs one of its own", path=out
            )
        write_object(settings, path)

    def has(self, stage: LoopStage, of: str = "") -> bool:
        """Whether a stage has been finished, of the same content, and what it made is whole."""
        record, fault = self._left(stage, of)
        return not fault and _is_done(record, of)

    def once(
        self,
        stage: LoopStage,
        kind: type[F],
        work: Callable[[], F],
        of: str = "",
        made: Sequence[Path] = (),
        editable: bool = False,
    ) -> F:
        """Return a stage's finding of that kind; its work is done only if it was not finished
        before.

        Args:
            work: what it does; it goes on with what an interruption has left of it.
            of: the content of its inputs. Where it has changed, what was made of the old one is
                removed, and the work done again.
            made: files and folders that it writes.
            editable: what it made may be edited; only a file that is missing has the stage done
                again.

        Raises:
            UsageError: what it has left can't be removed.
        """
        before, fault = self._left(stage, of, kind, editable)
        if fault:
            self._tell(one_line(f"{fault}: {stage.name} is done again"))
        elif _is_done(before, of):
            finding = from_json(kind, before["found"])
            self._report(stage, finding, None)
            return finding
        # Also of a stage that was only begun: what an interruption left is of the old inputs.
        elif before["of"] != of:
            _remove(made)
        path = self._path(stage)
        # Begun: after an interruption this tells what the leftovers are made of.
        _write(path, of, None, {})
        begun = time.monotonic()
        finding = work()
        _write(path, of, asdict(finding), self._files(made))
        self._report(stage, finding, time.monotonic() - begun)
        return finding

    def _left(
        self,
        stage: LoopStage,
        of: str,
        kind: type[StageFinding] | None = None,
        editable: bool = False,
    ) -> tuple[dict[str, Any], str]:
        """Return the results that a stage has left, and why they are stale; empty if they are valid
        or absent."""
        path = self._path(stage)
        if not path.is_file():
            return _unfinished(of), ""
        try:
            record = _read(path)
            if _is_done(record, of) and kind is not None:
                _finding(path, kind, record)
        except InvalidFile as error:
            return _unfinished(of), f"{error.path}: damaged"
        # Files of an unfinished stage have no digests yet: the work itself goes on with them.
        names = self._changed(record["files"], editable) if _is_done(record, of) else []
        more = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
        return (
            record,
            f"{self._out / names[0]}{more}: {'missing' if editable else 'changed or missing'}"
            if names
            else "",
        )

    def _changed(self, files: Mapping[str, str], editable: bool) -> list[str]:
        """Names of changed or missing files."""
        now = ((name, file_digest(self._out / name)) for name in files)
        return [
            name for name, digest in now if (digest is None if editable else digest != files[name])
        ]

    def _files(self, made: Sequence[Path]) -> dict[str, str | None]:
        """Digests of the files of a stage, by name below the output folder; hidden files are left
        out."""
        paths = sorted(
            path
            for output in made
            for path in ([output] if output.is_file() else output.rglob("*"))
            if path.is_file()
        )
        # Hidden files are caches and locks of other parts, which come and go without any meaning.
        names = {path: path.relative_to(self._out) for path in paths}
        return {
            name.as_posix(): file_digest(path)
            for path, name in names.items()
            if not any(part[0] == "." for part in name.parts)
        }

    def _path(self, stage: LoopStage) -> Path:
        return self._folder / f"{stage.name}.json"


def searches(out: Path) -> tuple[str, list[Searched]]:
    """The system under test of a loop that is in a folder, and its searches, round after round.

    Raises:
        UsageError: no loop is there. InvalidFile: what it has left is not readable.
    """
    path = out / _SETTINGS
    if not path.is_file():
        raise UsageError("no loop is in this folder", path=out)
    left = ((file, _read(file)) for file in sorted((out / _FOLDER).glob("round_*_search_*.json")))
    stages = [
        _finding(path, Searched, record) for path, record in left if record["found"] is not None
    ]
    # By number: among file names, round 10 comes before round 2.
    return str(read_object(path).get("sut", "")), sorted(stages, key=lambda pair: pair.round)


def _unfinished(of: str) -> dict[str, Any]:
    return {"of": of, "found": None, "files": {}}


def _write(
    path: Path, of: str, finding: dict[str, Any] | None, files: Mapping[str, str | None]
) -> None:
    with writing("this", path):
        Records(path).replace([{"of": of, "found": finding, "files": dict(files)}])


def file_digest(path: Path) -> str | None:
    """The digest of a file; None where it can't be read."""
    try:
        return digest(read_bytes(path))
    except InvalidFile:
        return None


def _read(path: Path) -> dict[str, Any]:
    """The record that a stage has left.

    Raises:
        InvalidFile: it is damaged.
    """
    # A file that can't be read and one that is cut off end alike: without a record.
    records: list[dict[str, Any]] = []
    with suppress(OSError):
        records = Records(path).read().records
    if len(records) != 1 or set(records[0]) != _KEYS or not isinstance(records[0]["files"], dict):
        raise InvalidFile(f"this is damaged, or not what a stage leaves; {_REMEDY}", path=path)
    return records[0]


def _is_done(record: Mapping[str, Any], of: str) -> bool:
    return record["of"] == of and record["found"] is not None


def _finding(path: Path, kind: type[F], record: Mapping[str, Any]) -> F:
    try:
        # A record of another version of the program may lack a name or have one more.
        return from_json(kind, record["found"])
    except (TypeError, ValueError) as error:
        raise InvalidFile(
            f"this is not what the stage finds: {error}; {_REMEDY}", path=path
        ) from None


def _remove(made: Sequence[Path]) -> None:
    for path in made:
        with writing("the folder", path):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)


def from_json(kind: type[T], value: Any) -> T:
    """The value of a type, from what JSON has of it.

    Args:
        kind: a dataclass, an enumeration of texts, `list[…]`, `dict[str, …]`, a union with None, or
            a type of JSON.

    Raises:
        TypeError, ValueError: the value is none of that type.
    """
    return cast(T, _value(kind, value))


def _value(kind: Any, value: Any) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return (
            None
            if value is None
            else _value(
                next(argument for argument in arguments if argument is not type(None)), value
            )
        )
    if is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        given = _expect(dict, value)
        known = {field.name for field in fields(kind)}
        # Unknown names are passed on, so that the class refuses them.
        return kind(
            **{
                name: _value(hints[name], item) if name in known else item
                for name, item in given.items()
            }
        )
    if origin is list:
        return [_value(arguments[0], item) for item in _expect(list, value)]
    if origin is dict:
        return {name: _value(arguments[1], item) for name, item in _expect(dict, value).items()}
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    return float(_expect(int | float, value)) if kind is float else _expect(kind, value)


def _expect(kind: Any, value: Any) -> Any:
    # A bool is an int to Python, and no number in JSON.
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"{getattr(kind, '__name__', kind)} is expected, not {value!r}")
    return value
