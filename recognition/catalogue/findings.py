"""Findings of any number of recordings as Parquet, partitioned by site and day, on any file system
that pyarrow reaches; and the scenarios of some of them, written when they are asked for.

A store is a folder, or a URL such as `s3://bucket/findings`::

    findings.json                               settings; written first
    findings/site=S/day=D/BLOCK.parquet         a row for each finding, with columns of the index
    recordings/BLOCK.parquet                    a row for each recording; written last
    failures.json                               recordings that could not be read the last time

A block is some recordings that one process reads one after the other, so memory does not grow with
their number. A block counts once its table of recordings is there. Questions to the rows are those
of `xosc-list --where` (`xosc.listing.questions`).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import pyarrow as pa

from recognition.catalogue.pipeline import Summary, build, refuse_twins
from recognition.catalogue.recordings import (
    CatalogueSettings,
    Findings,
    RecordingLocation,
    forget,
    found_in,
    listed,
    opened,
)
from recognition.catalogue.writing.index import COLUMNS, as_parquet
from recognition.labels import Rules
from recognition.recordings import Source
from runner.batch.pool import Workers, results
from schemas.common.errors import InvalidFile, NotWritten, ToolchainError, UsageError, reason
from schemas.common.packages import version
from schemas.common.storage import FileSystemPath, digest, parse_object, stamp
from xosc.listing.questions import condition
from xosc.listing.tables import FINDINGS, FINDINGS_FILE, findings

if TYPE_CHECKING:
    from schemas.common.terminal.command_line import Bar

_RECORDINGS, _FAILURES = "recordings", "failures.json"
_BLOCK, _SHARE = 50, 4
"""Most recordings of a block: with one each, files of a store would be too small to be read fast;
and blocks for each process, where there are few recordings"""
_FILES = ("file", "maneuver", "no_maneuver", "openlabel", "road", "deviation", "most_deviation")
"""Columns of the index about files, which are not written yet"""
_PARTITIONS = ("site", "day")
ROWS: dict[str, type] = {"folder": str, "name": str} | {
    name: kind for name, kind in COLUMNS.items() if name not in (*_FILES, *_PARTITIONS)
}
"""Columns of findings; those of partitions are in the names of folders"""
_OF_RECORDINGS: dict[str, type] = {
    "recording": str, "data_set": str, "site": str, "day": str, "root": str, "path": str,
    "stamp": str, "quality": float, "vehicles": int, "vehicle_hours": float, "vehicle_km": float,
    "blocked": str, "findings": int,
}  # fmt: skip
"""Columns of recordings; root: path that was given, below which it lies"""


class Found(NamedTuple):
    """Outcome of finding: findings by class, recordings that were read now and before, those that
    could not be read, and files of no known format."""

    classes: Counter[str]
    read: int
    before: int
    failures: dict[str, ToolchainError]
    skipped: list[Path]


class _Block(NamedTuple):
    """Recordings that are read one after the other, and the name of their tables."""

    name: str
    locations: tuple[RecordingLocation, ...]


class _Entered(NamedTuple):
    """Outcome of a block."""

    classes: Counter[str]
    read: int
    failures: dict[str, ToolchainError]


def find(
    paths: Sequence[Path],
    out: str,
    settings: CatalogueSettings,
    bar: Bar,
    workers: Workers,
) -> Found:
    """Add the findings of the recordings in files and folders to a store.

    Recordings that are in it already are not read again.

    Args:
        out: folder or URL of the store.

    Raises:
        InvalidFile: there is no recording of a known format in a path.
        UsageError: the store can't be written, or has findings by other settings, or a recording
            has changed since its findings were added.
    """
    forget()
    store = FileSystemPath.of(out)
    paths = tuple(path.absolute() for path in paths)
    roots = {
        source.name: data_set.path
        for data_set in listed(paths, settings.columns)
        for source in data_set.sources
    }
    sources = opened(paths, settings.road, settings.columns)
    refuse_twins(sources)
    _check(store, settings)
    known = _known(store)
    _refuse_renamed(sources, known)
    new = [source for source in sources if _is_new(source, known)]
    size = min(max(len(new) // (_SHARE * workers.jobs), 1), _BLOCK)
    blocks = list(_blocks(new, size, paths, settings))
    done = _Entered(Counter(), 0, {})
    work = partial(_enter, settings, out, roots)
    with bar("finding", max(len(new), 1)) as advance, results(work, blocks, workers) as entered:
        for block, one in zip(blocks, entered, strict=True):
            done.classes.update(one.classes)
            done.failures.update(one.failures)
            done = done._replace(read=done.read + one.read)
            advance(len(block.locations))
    failures = {name: str(error) for name, error in done.failures.items()}
    store.write(_FAILURES, _json(failures))
    skipped = [file for one in listed(paths, settings.columns) for file in one.skipped]
    return Found(done.classes, done.read, len(sources) - len(new), done.failures, skipped)


def _json(values: Any) -> bytes:
    return (json.dumps(values, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode(
        errors="backslashreplace"
    )


def _settings(settings: CatalogueSettings) -> dict[str, Any]:
    """All that decides what is found."""
    road, columns = (
        str(path.absolute()) if path is not None else None
        for path in (settings.road, settings.columns)
    )
    return {
        "version": version(),
        "signalised": settings.rules.signalised,
        "road": road,
        "columns": columns,
    }


def _check(store: FileSystemPath, settings: CatalogueSettings) -> None:
    """Refuse a store with findings by other settings; a new one gets these."""
    mine, before = _settings(settings), _read_settings(store)
    if before is None:
        store.write(FINDINGS_FILE, _json(mine))
        return
    changed = [name for name, value in mine.items() if before.get(name) != value]
    if changed:
        told = (
            f"this store has findings by other settings ({', '.join(changed)}): "
            "give the same, or another store"
        )
        raise UsageError(told, path=store.place)


def _read_settings(store: FileSystemPath) -> dict[str, Any] | None:
    content = store.read(FINDINGS_FILE)
    if content is None:
        return None
    return parse_object(content, Path(f"{store.place}/{FINDINGS_FILE}"))


def _known(store: FileSystemPath) -> dict[str, str]:
    """Stamps of the recordings in a store by name; rows that an interruption left of others are
    removed."""
    counted = [file for file in store.files(_RECORDINGS) if file.endswith(".parquet")]
    blocks = {Path(file).stem for file in counted}
    # Rows of a block without a table of recordings would count twice once it is read again.
    for file in store.files(FINDINGS):
        if Path(file).stem not in blocks:
            store.remove(file)
    known: dict[str, str] = {}
    for rows in _recordings(store, ["recording", "stamp"], bool(counted)):
        known |= {row["recording"]: row["stamp"] for row in rows}
    return known


def _recordings(
    store: FileSystemPath, columns: list[str], there: bool = True
) -> Iterator[list[dict[str, Any]]]:
    """Yield rows of recordings in parts."""
    if there:
        table = store.dataset(_RECORDINGS)
        for batch in table.to_batches(columns=columns):
            yield batch.to_pylist()


def _stamp_of(source: Source) -> str:
    return f"{source.path.absolute()} {stamp(source.path)}"


def _refuse_renamed(sources: Sequence[Source], known: dict[str, str]) -> None:
    """Refuse recordings that are in the store by other names: their findings would count twice.

    Recordings of one name are led by their folders, so that new ones may rename others.
    """
    names, stamps = {source.name for source in sources}, {_stamp_of(one): one for one in sources}
    for name, before in known.items():
        if name not in names and (source := stamps.get(before)) is not None:
            told = (
                f"recording {source.name!r} is in this store as {name!r}: "
                "give the same paths, or another store"
            )
            raise UsageError(told, path=source.path)


def _is_new(source: Source, known: dict[str, str]) -> bool:
    """Whether a recording is not in the store.

    Raises:
        UsageError: another one of this name is.
    """
    before = known.get(source.name)
    if before is not None and before != _stamp_of(source):
        told = (
            f"recording {source.name!r} is another one, or has changed, "
            "since its findings were added: give another store"
        )
        raise UsageError(told, path=source.path)
    return before is None


def _blocks(
    sources: Sequence[Source], size: int, paths: tuple[Path, ...], settings: CatalogueSettings
) -> Iterator[_Block]:
    """Yield the recordings in blocks."""
    for start in range(0, len(sources), size):
        part = sources[start : start + size]
        name = digest("\n".join(map(_stamp_of, part)).encode(errors="surrogateescape"))
        locations = (
            RecordingLocation(paths, source.name, Path(), settings.road, settings.columns)
            for source in part
        )
        yield _Block(name, tuple(locations))


def _enter(
    settings: CatalogueSettings, out: str, roots: dict[str, Path], block: _Block
) -> _Entered:
    """Read recordings and write their findings."""
    store, failures = FileSystemPath.of(out), dict[str, ToolchainError]()
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    entries: list[dict[str, Any]] = []
    for location in block.locations:
        found = found_in(settings, location)
        if isinstance(found, NotWritten):
            raise found  # the other recordings can't be written either
        if isinstance(found, ToolchainError):
            failures[location.name] = found
            continue
        rows.setdefault((found.source.site, found.day), []).extend(found.rows)
        entries.append(_entry(found, roots[location.name]))
    for (site, day), listed_rows in rows.items():
        if listed_rows:
            folder = f"{FINDINGS}/site={quote(site, safe='')}/day={quote(day, safe='')}"
            store.write(f"{folder}/{block.name}.parquet", as_parquet(listed_rows, ROWS))
    if entries:
        content = as_parquet(entries, _OF_RECORDINGS)
        store.write(f"{_RECORDINGS}/{block.name}.parquet", content)
    counts = Counter(row["class"] for part in rows.values() for row in part)
    return _Entered(counts, len(entries), failures)


def _entry(found: Findings, root: Path) -> dict[str, Any]:
    source, seen = found.source, found.exposure
    return {
        "recording": source.name,
        "data_set": source.format,
        "site": source.site,
        "day": found.day,
        "root": str(root),
        "path": str(source.path.absolute()),
        "stamp": _stamp_of(source),
        "quality": seen.quality,
        "vehicles": seen.vehicles,
        "vehicle_hours": seen.time / 3600.0,
        "vehicle_km": seen.distance / 1000.0,
        "blocked": "; ".join(sorted(seen.blocked)),
        "findings": len(found.rows),
    }


def write(
    place: str,
    out: Path,
    where: str | None,
    settings: CatalogueSettings,
    bar: Bar,
    workers: Workers,
) -> Summary:
    """Write the scenarios of the findings in a store that meet a condition, as a catalogue.

    The recordings are read again from where they were; others are not looked at.

    Args:
        place: folder or URL of the store.
        where: the condition (`xosc.listing.questions.condition`); None for all findings.
        settings: how scenarios are written; what decides about findings is that of the store.

    Raises:
        InvalidFile: there is no store, or a recording is not there any more.
        UsageError: no such condition, or no finding meets it; or the folder can't be written.
    """
    store = FileSystemPath.of(place)
    rows, before = findings(place), _read_settings(store)
    if rows is None or before is None:
        raise InvalidFile("findings of 'xosc-recognize find' are expected here", path=place)
    question = condition(where, rows.schema) if where is not None else None
    chosen: dict[str, set[tuple[str, str]]] = {}
    expression = question.expression if question is not None else None
    try:
        for batch in rows.to_batches(columns=["recording", "folder", "name"], filter=expression):
            for row in batch.to_pylist():
                chosen.setdefault(row["recording"], set()).add((row["folder"], row["name"]))
    except (OSError, pa.ArrowException) as error:
        raise InvalidFile(f"not readable as Parquet: {reason(error)}", path=place) from None
    if not chosen:
        hint = question.missing(rows.to_table(columns=question.columns)) if question else ""
        told = "no finding meets the condition" if question else "there are no findings"
        raise UsageError("; ".join(filter(None, (told, hint))), path=place)
    return build(
        _roots(store, chosen),
        out,
        _as_found(settings, before),
        bar=bar,
        workers=workers,
        selection={name: frozenset(wanted) for name, wanted in chosen.items()},
    )


def _roots(store: FileSystemPath, chosen: Iterable[str]) -> list[Path]:
    """Folders and files with the recordings, as they were given."""
    wanted = set(chosen)
    roots = dict[str, None]()
    for rows in _recordings(store, ["recording", "root"]):
        roots |= {row["root"]: None for row in rows if row["recording"] in wanted}
    return [Path(root) for root in sorted(roots)]


def _as_found(settings: CatalogueSettings, before: dict[str, Any]) -> CatalogueSettings:
    """Settings with those by which a store was made."""
    road, columns = (
        Path(before[name]) if before.get(name) is not None else None for name in ("road", "columns")
    )
    rules = Rules(signalised=bool(before.get("signalised")))
    return CatalogueSettings(road=road, columns=columns, rules=rules, config=settings.config)
