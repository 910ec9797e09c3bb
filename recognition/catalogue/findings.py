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
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

import pyarrow as pa

from recognition.catalogue.detect import ByRules, Recogniser
from recognition.catalogue.pipeline import (
    REFUSALS,
    ChosenScenarios,
    Findings,
    RecordingSearch,
    SelectedScenarios,
    Summary,
    build,
    located,
    opened,
    recognise,
    searched,
    stamp_of,
)
from recognition.catalogue.recordings import CatalogueSettings, naming
from recognition.catalogue.writing.index import COLUMNS, as_parquet
from recognition.catalogue.writing.write import Material, facts_of
from recognition.labels import Rules
from recognition.recordings import Source
from recognition.recordings.source import listed
from runner.batch.pool import Workers, results
from schemas.common.errors import InvalidFile, NotWritten, ToolchainError, UsageError, reason
from schemas.common.packages import version
from schemas.common.policy import limited
from schemas.common.storage import FileSystemPath, digest, parse_object
from xosc.listing.questions import condition
from xosc.listing.tables import FINDINGS, FINDINGS_FILE, findings

if TYPE_CHECKING:
    from schemas.common.terminal.command_line import Bar

_RECORDINGS, _FAILURES = "recordings", "failures.json"
_BLOCK, _SHARE = 50, 4
"""Most recordings of a block: with one each, files of a store would be too small to be read fast;
and blocks for each process, where there are few recordings"""
_FILES = (
    "file",
    "maneuver",
    "no_maneuver",
    "inconclusive",
    "openlabel",
    "road",
    "deviation",
    "most_deviation",
)
"""Columns of the index about files, which are not written yet"""
_PARTITIONS = ("site", "day")
_EPISODE = "episode"
ROWS: dict[str, type] = {"folder": str, "name": str, _EPISODE: str} | {
    name: kind for name, kind in COLUMNS.items() if name not in (*_FILES, *_PARTITIONS)
}
"""Columns of findings; those of partitions are in the names of folders. A scenario is written of
`episode`, JSON that has all digits and what is in no other column."""
_OF_RECORDINGS: dict[str, type] = {
    "recording": str, "data_set": str, "site": str, "day": str, "root": str, "path": str,
    "stamp": str, "quality": float, "vehicles": int, "vehicle_hours": float, "vehicle_km": float,
    "blocked": str, "findings": int, "excluded": int,
}  # fmt: skip
"""Columns of recordings; root: path that was given, below which it lies; excluded: vehicles without
a scene of their own, where scenes are of vehicles"""


class Found(NamedTuple):
    """Outcome of finding: findings by class, vehicles that are no egos, recordings that were read
    now and before, those that could not be read, and files of no known format."""

    classes: Counter[str]
    excluded: int
    read: int
    before: int
    failures: dict[str, ToolchainError]
    skipped: list[Path]


class _Block(NamedTuple):
    """Recordings that are read one after the other, and the name of their tables."""

    name: str
    searches: Sequence[RecordingSearch]


class _Entered(NamedTuple):
    """Outcome of a block."""

    classes: Counter[str]
    excluded: int
    read: int
    failures: dict[str, ToolchainError]


def find(
    paths: Sequence[Path],
    out: str,
    settings: CatalogueSettings,
    bar: Bar,
    workers: Workers,
    recogniser: Callable[[], Recogniser] = ByRules,
) -> Found:
    """Add the findings of the recordings in files and folders to a store.

    Recordings that are in it already are not read again.

    Args:
        out: folder or URL of the store.
        recogniser: recogniser factory, the rules by default. A model looks at the new recordings
            alone.

    Raises:
        InvalidFile: there is no recording of a known format in a path.
        UsageError: the store can't be written, or has findings by other settings, or a recording
            has changed since its findings were added.
    """
    store = FileSystemPath.of(out)
    paths = tuple(path.absolute() for path in paths)
    sources = opened(paths, settings)
    # As they were given: from there `write` opens the recordings again, by the same names.
    roots = {
        source.name: data_set.path
        for data_set in listed(paths, settings.columns)
        for source in data_set.sources
    }
    made = recogniser()
    _check(store, _settings(settings, made))
    known = _known(store)
    _refuse_renamed(sources, known)
    new = [source for source in sources if _is_new(source, known)]
    # Classes get numbers as they are discovered: `discovered 01` of two calls would be two classes.
    if made.discovers and known and new:
        told = (
            "classes that are discovered in further recordings would have the names of those in "
            "this store: find in all of them together, in a new store"
        )
        raise UsageError(told, path=out)
    failures: dict[str, ToolchainError] = {}
    classes, read, excluded = Counter[str](), 0, 0
    # Rules find in a recording what they find while it is read. A model looks at it in another
    # process, and finds after the last one: until then copies wait, as those of a catalogue.
    with nullcontext() if made.by_rules else TemporaryDirectory() as copies:
        folder = Path(copies) if copies is not None else None
        unread = [RecordingSearch(located(paths, settings, source, folder)) for source in new]
        searches = recognise(made, settings, unread, failures, bar, workers)
        size = min(max(len(searches) // (_SHARE * workers.jobs), 1), _BLOCK)
        blocks = list(_blocks(searches, size))
        work = partial(_enter, settings, made.sorted_by, out, roots)
        count = max(len(searches), 1)
        with bar("finding", count) as advance, results(work, blocks, workers) as entered:
            for block, one in zip(blocks, entered, strict=True):
                classes.update(one.classes)
                failures |= one.failures
                read, excluded = read + one.read, excluded + one.excluded
                advance(len(block.searches))
    # Of this call alone: what can be read by now is no failure any more.
    store.write(_FAILURES, _json({name: str(error) for name, error in failures.items()}))
    skipped = [file for one in listed(paths, settings.columns) for file in one.skipped]
    return Found(classes, excluded, read, len(sources) - len(new), failures, skipped)


def _json(values: Any) -> bytes:
    return (json.dumps(values, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode(
        errors="backslashreplace"
    )


def _settings(settings: CatalogueSettings, recogniser: Recogniser) -> dict[str, Any]:
    """All that decides what is found."""
    road, columns = (
        str(path.absolute()) if path is not None else None
        for path in (settings.road, settings.columns)
    )
    return {
        "version": version(),
        "labels": recogniser.name,
        "sorted_by": recogniser.sorted_by,
        "scenes": settings.scenes,
        "signalised": settings.rules.signalised,
        "road": road,
        "columns": columns,
    }


def _check(store: FileSystemPath, mine: dict[str, Any]) -> None:
    """Refuse a store with findings by other settings; a new one gets these."""
    before = _read_settings(store)
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


def _refuse_renamed(sources: Sequence[Source], known: dict[str, str]) -> None:
    """Refuse recordings that are in the store by other names: their findings would count twice.

    Recordings of one name are led by their folders, so that new ones may rename others.
    """
    # By the stamp: a name may change with what else lies in the folder, the file does not.
    names, stamps = {source.name for source in sources}, {stamp_of(one): one for one in sources}
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
    if before is not None and before != stamp_of(source):
        told = (
            f"recording {source.name!r} is another one, or has changed, "
            "since its findings were added: give another store"
        )
        raise UsageError(told, path=source.path)
    return before is None


def _blocks(searches: Sequence[RecordingSearch], size: int) -> Iterator[_Block]:
    """Yield the searches in blocks."""
    for start in range(0, len(searches), size):
        part = searches[start : start + size]
        stamps = "\n".join(stamp_of(search.location.source) for search in part)
        yield _Block(digest(stamps.encode(errors="surrogateescape")), part)


def _enter(
    settings: CatalogueSettings, sorted_by: str, out: str, roots: dict[str, Path], block: _Block
) -> _Entered:
    """Find the scenarios of recordings and write rows of them."""
    store, failures = FileSystemPath.of(out), dict[str, ToolchainError]()
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    entries: list[dict[str, Any]] = []
    excluded = 0
    for search in block.searches:
        source = search.location.source
        try:
            with limited():
                found, day, listed_rows = _rows(settings, sorted_by, search)
        except NotWritten:
            raise  # the other recordings can't be written either
        except REFUSALS as error:
            failures[source.name] = naming(source, error)
            continue
        rows.setdefault((source.site, day), []).extend(listed_rows)
        entries.append(_entry(source, found, day, roots[source.name]))
        excluded += len(found.exclusions)
    for (site, day), listed_rows in rows.items():
        if listed_rows:
            folder = f"{FINDINGS}/site={quote(site, safe='')}/day={quote(day, safe='')}"
            store.write(f"{folder}/{block.name}.parquet", as_parquet(listed_rows, ROWS))
    if entries:
        # Last: a block counts by this table, so that rows of an interrupted one are found again.
        content = as_parquet(entries, _OF_RECORDINGS)
        store.write(f"{_RECORDINGS}/{block.name}.parquet", content)
    counts = Counter(row["class"] for part in rows.values() for row in part)
    return _Entered(counts, excluded, len(entries), failures)


def _rows(
    settings: CatalogueSettings, sorted_by: str, search: RecordingSearch
) -> tuple[Findings, str, list[dict[str, Any]]]:
    """Findings of a recording, its day, and their rows."""
    read, found = searched(settings, search)
    scope, quality = settings.config.scope, read.report.quality
    material = Material(search.location.source, read.recording, read.site, scope, quality)
    return found, material.conditions.day, facts_of(material, found.episodes, sorted_by)


def _entry(source: Source, found: Findings, day: str, root: Path) -> dict[str, Any]:
    seen = found.exposure
    return {
        "recording": source.name,
        "data_set": source.format,
        "site": source.site,
        "day": day,
        "root": str(root),
        "path": str(source.path.absolute()),
        "stamp": stamp_of(source),
        "quality": seen.quality,
        "vehicles": seen.vehicles,
        "vehicle_hours": seen.time / 3600.0,
        "vehicle_km": seen.distance / 1000.0,
        "blocked": "; ".join(sorted(seen.blocked)),
        "findings": len(found.episodes),
        "excluded": len(found.exclusions),
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

    The recordings are read again from where they were; others are not looked at. One that is gone
    or has changed is a failure of the summary.

    Args:
        place: folder or URL of the store.
        where: the condition (`xosc.listing.questions.condition`); None for all findings.
        settings: how scenarios are written; what decides about findings is that of the store.

    Raises:
        InvalidFile: there is no store, or a folder of its recordings is not there any more.
        UsageError: no such condition, or no finding meets it; or the folder can't be written.
    """
    store = FileSystemPath.of(place)
    rows, before = findings(place), _read_settings(store)
    if rows is None or before is None:
        raise InvalidFile("findings of 'xosc-recognize find' are expected here", path=place)
    if _EPISODE not in rows.schema.names or "sorted_by" not in before:
        told = "these findings are of an earlier version: find them again, in a new store"
        raise InvalidFile(told, path=place)
    question = condition(where, rows.schema) if where is not None else None
    chosen: dict[str, list[str]] = {}
    expression = question.expression if question is not None else None
    try:
        # In batches: the rows that do not meet the condition never are in memory together.
        for batch in rows.to_batches(columns=["recording", _EPISODE], filter=expression):
            for row in batch.to_pylist():
                chosen.setdefault(row["recording"], []).append(row[_EPISODE])
    except (OSError, pa.ArrowException) as error:
        raise InvalidFile(f"not readable as Parquet: {reason(error)}", path=place) from None
    if not chosen:
        hint = question.missing(rows.to_table(columns=question.columns)) if question else ""
        told = "no finding meets the condition" if question else "there are no findings"
        raise UsageError("; ".join(filter(None, (told, hint))), path=place)
    roots, stamps = set[Path](), dict[str, str]()
    for entries in _recordings(store, ["recording", "root", "stamp"]):
        for entry in entries:
            if entry["recording"] in chosen:
                roots.add(Path(entry["root"]))
                stamps[entry["recording"]] = entry["stamp"]
    selected = {name: ChosenScenarios(stamps[name], episodes) for name, episodes in chosen.items()}
    return build(
        sorted(roots),
        out,
        _as_found(settings, before),
        bar=bar,
        workers=workers,
        selection=SelectedScenarios(before["sorted_by"], selected),
    )


def _as_found(settings: CatalogueSettings, before: dict[str, Any]) -> CatalogueSettings:
    """Settings with those by which a store was made."""
    road, columns = (
        Path(before[name]) if before.get(name) is not None else None for name in ("road", "columns")
    )
    rules = Rules(signalised=bool(before.get("signalised")))
    return replace(settings, road=road, columns=columns, rules=rules)
