"""Tables that questions are asked to: catalogues, batches, runs, searches, or several joined;
copies of scenarios."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.catalogs import locate
from schemas.common.errors import InvalidFile, ToolchainError, UsageError, nearest, reason
from schemas.common.storage import FileSystemPath, is_url, read_bytes, read_object, read_parquet
from schemas.common.terminal.text import csv_text
from xosc.document import load
from xosc.document.road_files import find_roads, logic_file
from xosc.exports.draft import Folder

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.dataset as ds

    from xosc.listing import Listed

INDEX = "index.parquet"
"""Typed index in the folder of a catalogue"""
RUNS, EPISODES, SETS = "runs.parquet", "episodes.parquet", "sets.parquet"
"""Tables of a batch, of a search, and of parameter sets that were played in arrays"""
FINDINGS, FINDINGS_FILE = "findings", "findings.json"
"""Folder with the findings of recordings, partitioned by site and day, and file beside it"""
_SHOWN = {
    INDEX: ("file", "class"),
    RUNS: ("name", "state", "end_time"),
    EPISODES: ("part", "status", "collision"),
    SETS: ("name", "verdict"),
    FINDINGS: ("recording", "time", "class"),
}
"""Columns of text besides those that a question names"""
_NOUNS = {
    INDEX: "scenario",
    RUNS: "run",
    EPISODES: "episode",
    SETS: "parameter set",
    FINDINGS: "finding",
}
_MOST_SHOWN = 6
"""Columns of text of a table that no command has written"""
_RESULT, _BATCH, _LABELS = "result.json", "batch.json", "labels.json"
BATCH = "batch"
"""Column with the folder, where several are joined"""


class Index(NamedTuple):
    """Rows to ask, and the folder that they are of.

    Attributes:
        root: folder of the catalogue, batch or search; of the first where several are joined.
        table: their rows.
        name: of the table's file, which says its kind.
        whole: all rows, where the table has only those that meet a condition.
    """

    root: Path
    table: pa.Table
    name: str = INDEX
    whole: ds.Dataset | None = None

    @property
    def noun(self) -> str:
        """Noun for a row."""
        return _NOUNS.get(self.name, "row")

    @property
    def shown(self) -> list[str]:
        """Columns of text besides those that a question names."""
        names = self.table.column_names
        own = _SHOWN.get(self.name) or next(
            (columns for columns in _SHOWN.values() if set(columns) <= set(names)),
            names[:_MOST_SHOWN],
        )
        return [name for name in (BATCH, *own) if name in names]

    def need_catalogue(self, option: str) -> None:
        """Refuse an option that compares scenarios of catalogues.

        Raises:
            UsageError: these are other rows.
        """
        if self.name != INDEX:
            raise UsageError(f"{option} is for catalogues, these are {self.noun}s", path=self.root)


def findings(place: str | os.PathLike[str]) -> ds.Dataset | None:
    """Return the findings in a folder or at a URL, which are read when they are asked; None for
    anything else.

    Raises:
        NotWritten: the URL can't be reached.
        InvalidFile: they are not readable.
    """
    local = not is_url(place)
    # The small file tells it from other folders without opening the partitions.
    if local and not (Path(place) / FINDINGS_FILE).is_file():
        return None
    store = FileSystemPath.of(str(place))
    if not local and store.read(FINDINGS_FILE) is None:
        return None
    return store.dataset(FINDINGS, ("site", "day"))


def table_of(path: str | os.PathLike[str]) -> Path | None:
    """Return the table of a folder, or a table itself; None for anything else. A run's is that of
    its batch."""
    folder = Path(path)
    # Of what may be at a URL only findings are read: they alone are written there.
    if is_url(path) or (folder / FINDINGS_FILE).is_file():
        return folder / FINDINGS
    if folder.suffix == ".parquet" and folder.is_file():
        return folder
    for name in _SHOWN:
        if (folder / name).is_file():
            return folder / name
    # A run's folder has its result, and its row is in the table beside the folders.
    if (folder / _RESULT).is_file() and (folder / ".." / RUNS).is_file():
        return Path(os.path.normpath(folder / ".." / RUNS))
    return None


def read_index(
    path: str | os.PathLike[str],
    condition: Callable[[pa.Schema], pc.Expression | None] = lambda _: None,
) -> Index:
    """Return the rows of a catalogue, batch, run or search, or findings of recordings.

    Args:
        path: its folder, or its table; of findings also a URL.
        condition: given the columns of findings, the condition on rows that are wanted. There may
            be more findings than memory takes; of other tables all rows are returned.

    Raises:
        UsageError: the path has no table.
        InvalidFile: the table is not readable, or an index has no column `file`.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    stored = findings(path)
    if stored is not None:
        wanted = condition(stored.schema)
        rows = _readable(lambda: stored.to_table(filter=wanted), path)
        return Index(Path(path), rows, FINDINGS, stored if wanted is not None else None)
    file = table_of(path) if not is_url(path) else None
    if file is None:
        told = (
            f"questions are to catalogues ({INDEX}), batches and runs ({RUNS}), searches "
            f"({EPISODES}) and findings ({FINDINGS_FILE}); there is none"
        )
        raise UsageError(told, path=path)
    table = _readable(lambda: read_parquet(file), file)
    names = table.column_names
    # Everything that is done with a catalogue's rows needs to find the scenarios.
    if file.name == INDEX and (
        "file" not in names or not pa.types.is_string(table.schema.field("file").type)
    ):
        raise InvalidFile("an index has a column 'file' of texts", path=file)
    # The folder of one run was named: its batch's table has the other runs too.
    if file.name == RUNS and Path(path) not in (file, file.parent) and "name" in names:
        table = table.filter(pc.field("name") == Path(os.path.abspath(path)).name)
    flat = _flat(table)
    return Index(
        file.parent, _described(flat, file.parent) if file.name == RUNS else flat, file.name
    )


def _described(table: pa.Table, batch: Path) -> pa.Table:
    """Runs with the system of their batch, and the classes that `xosc-recognize label` gave."""
    import pyarrow as pa

    # Facts of the batch as a whole, not of its rows: damaged or absent files leave the column out.
    system = _json(batch / _BATCH).get("sut")
    if isinstance(system, str) and "sut" not in table.column_names:
        table = table.append_column("sut", pa.array([system] * table.num_rows, pa.string()))
    runs = _json(batch / _LABELS).get("runs")
    # A table that has the column already keeps its own.
    if isinstance(runs, dict) and {"name"} <= set(table.column_names) - {"class"}:
        classes = [
            "; ".join(dict.fromkeys(str(row.get("class")) for row in runs.get(name, ()))) or None
            for name in table["name"].to_pylist()
        ]
        table = table.append_column("class", pa.array(classes, pa.string()))
    return table


def _json(path: Path) -> dict[str, Any]:
    """A JSON object in a file; an empty one where there is none."""
    try:
        content = json.loads(read_bytes(path))
    except (ToolchainError, OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _readable(read: Callable[[], pa.Table], path: str | os.PathLike[str]) -> pa.Table:
    """A table that is read.

    Raises:
        InvalidFile: it is not readable.
    """
    import pyarrow as pa

    try:
        return read()
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InvalidFile(f"not readable as Parquet: {reason(error)}", path=path) from None


def read_all(
    paths: Sequence[str], condition: Callable[[pa.Schema], pc.Expression | None] = lambda _: None
) -> Index:
    """Return the rows of several folders, each with its folder in the column `batch`; condition and
    errors as of `read_index`.

    Raises:
        UsageError: they are of different kinds.
    """
    import pyarrow as pa

    if len(paths) == 1:
        return read_index(paths[0], condition)
    parts = [read_index(path) for path in paths]
    first, *_ = parts
    for path, part in zip(paths, parts, strict=True):
        if part.name != first.name:
            told = (
                f"these are {part.noun}s, and those of {paths[0]} are {first.noun}s: ask one kind"
            )
            raise UsageError(told, path=path)
    tables = [
        part.table.add_column(0, BATCH, pa.array([path] * part.table.num_rows, pa.string()))
        for path, part in zip(paths, parts, strict=True)
    ]
    return first._replace(table=pa.concat_tables(_alike(tables), promote_options="default"))


def _alike(tables: Sequence[pa.Table]) -> list[pa.Table]:
    """Cast tables to one type for columns of one name: numbers, or texts where types differ."""
    import pyarrow as pa

    types: dict[str, set[pa.DataType]] = {}
    for table in tables:
        for field in table.schema:
            # A column of absent values fits any type: it may not turn numbers of others into texts.
            if not pa.types.is_null(field.type):
                types.setdefault(field.name, set()).add(field.type)
    common = {
        name: pa.float64() if all(map(_is_number, kinds)) else pa.string()
        for name, kinds in types.items()
        if len(kinds) > 1
    }
    return [
        table.cast(
            pa.schema([(field.name, common.get(field.name, field.type)) for field in table.schema])
        )
        for table in tables
    ]


def _is_number(kind: pa.DataType) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _flat(table: pa.Table) -> pa.Table:
    """A table of single values: a column for each name of a map, lists as texts."""
    import pyarrow as pa

    columns: dict[str, Any] = {}
    for name in table.column_names:
        kind = table.schema.field(name).type
        if pa.types.is_map(kind):
            for key, values in _by_name(table[name].to_pylist()).items():
                # Parameters by their own names, as scenarios have them; one that is called as a
                # column of the table would be lost.
                column = key if name == "parameters" else f"{name}_{key}"
                taken = column in table.column_names
                columns[f"{name}_{column}" if taken else column] = pa.array(values)
        elif pa.types.is_list(kind) or pa.types.is_large_list(kind):
            texts = ["; ".join(map(str, cell or ())) for cell in table[name].to_pylist()]
            columns[name] = pa.array(texts, pa.string())
        else:
            columns[name] = _plain(table[name])
    return pa.table(columns)


def _plain(column: pa.ChunkedArray) -> pa.ChunkedArray | pa.Array:
    """A column of truths, numbers or texts, which questions compare: other programs write large
    and coded texts, decimals, times."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_boolean(kind) or pa.types.is_null(kind) or _is_number(kind):
        return column
    if pa.types.is_decimal(kind):
        return column.cast(pa.float64())
    try:
        return column.cast(pa.string())
    except pa.ArrowException:  # bytes that are no text, and values of several parts
        texts = [None if value is None else str(value) for value in column.to_pylist()]
        return pa.array(texts, pa.string())


def _by_name(maps: Iterable[Sequence[tuple[str, Any]] | None]) -> dict[str, list[Any]]:
    """Values of maps by name, as numbers where all are; None where a map lacks one."""
    # Batches of other scenarios have other parameters: a row without one has None.
    rows = [dict(cell or ()) for cell in maps]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _numbers([row.get(name) for row in rows]) for name in names}


def _numbers(values: list[Any]) -> list[Any]:
    try:
        return [None if value is None else float(value) for value in values]
    except ValueError:
        return values


_SYNONYMS = {
    "ego": "vehicle", "other": "partner", "speed": "ego_speed", "ttc": "min_ttc", "thw": "min_thw",
    "drac": "max_drac", "label": "class", "date": "day", "road": "road_kind", "outcome": "verdict",
}  # fmt: skip
"""Columns by other words for them"""


def column_hint(name: str, names: Sequence[str]) -> str:
    """Return the hint for an unknown column: what it is called here, else as `nearest`."""
    called = _SYNONYMS.get(name.casefold(), "")
    return f"did you mean {called!r}?" if called in names else nearest(name, names)


def chosen(names: Sequence[str], table: pa.Table) -> list[str]:
    """Return the columns that `--columns` names.

    Raises:
        UsageError: there is no such column.
    """
    columns = [name.strip() for text in names for name in text.split(",") if name.strip()]
    for name in columns:
        if name not in table.column_names:
            told = (
                f"--columns: there is no column {name!r}; {column_hint(name, table.column_names)}"
            )
            raise UsageError(told)
    # Once each: a table may not have two columns of one name.
    return list(dict.fromkeys(columns))


# copies of scenarios with all that they need ----------------------------------------------------

FILES = ("file", "maneuver", "openlabel", "road")
"""Columns of the index that name files of a scenario, relative to the index"""


def copy_scenarios(scenarios: Iterable[Listed], folder: Folder) -> int:
    """Copy scenarios and their variation files with their roads and catalogues; the number of
    files.

    Files keep their places relative to each other, so that the copies run.

    Raises:
        UsageError: a file is in the way, or can't be written.
        InvalidFile: a road or catalogue is nowhere.
    """
    files = dict.fromkeys(
        Path(os.path.abspath(path)) for scenario in scenarios for path in _needed(scenario)
    )
    # The common folder, so that `../roads/a.xodr` of a scenario leads to the copy.
    root = os.path.commonpath([path.parent for path in files])
    for path in files:
        folder.write(path.relative_to(root).as_posix(), read_bytes(path))
    return len(files)


def _needed(listed: Listed) -> Iterator[Path]:
    """Yield the files of a scenario."""
    yield listed.path
    yield from (variation.path for variation in listed.variations)
    root = load(listed.path).node
    logic = logic_file(root)
    if logic is not None:
        yield find_roads(logic).path
    locations = root.find("CatalogLocations")
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        try:
            # All files of a catalogue location: which of them an entry is in is only known once all
            # are read.
            yield from map(Path, locate(directory.file("path"), listed.path).files)
        except (OSError, ValueError) as error:
            raise directory.invalid(f"this catalogue can't be read: {error}") from None


def copy_rows(index: Index, table: pa.Table, folder: Folder) -> int:
    """Copy the scenarios of some rows with their roads and catalogues, and an index of them; the
    number of files.

    Files keep their places relative to the index, so that the copies run and can be asked again.

    Raises:
        UsageError: a file is in the way, or can't be written.
        InvalidFile: a file of the catalogue is missing, or outside of it.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = table.to_pylist()
    chosen = {row["file"] for row in rows}
    # It has what the table has not, as origins and remarks; only that of the copied rows goes
    # along.
    about = read_object(index.root / "index.json")
    scenarios = [
        row
        for row in about.get("scenarios", [])
        if isinstance(row, dict) and row.get("file") in chosen
    ]
    # Without columns of the question, as `distance` and `duplicates`: they would be stale in the
    # copy.
    held = table.select([name for name in table.column_names if name in index.table.column_names])
    written = pa.BufferOutputStream()
    pq.write_table(held, written, compression="zstd")
    cells = csv_text([held.column_names, *(list(row.values()) for row in held.to_pylist())])
    contents = {INDEX: written.getvalue().to_pybytes(), "index.csv": cells.encode()}
    facts = {name: about[name] for name in ("sorted_by", "recordings") if name in about} | {
        "scenarios": scenarios
    }
    contents["index.json"] = (json.dumps(facts, indent=1, ensure_ascii=False) + "\n").encode()
    names = dict.fromkeys(str(row[name]) for row in rows for name in FILES if row.get(name))
    for name in list(names):
        if name.endswith(".xosc"):
            names |= dict.fromkeys(_catalogs(index.root, name))
    for name, content in contents.items():
        folder.write(name, content)
    for name in names:
        folder.write(name, read_bytes(_inside(index.root, name)))
    return len(names) + len(contents)


def _catalogs(root: Path, name: str) -> list[str]:
    """Names of the catalogue files that a scenario refers to, relative to the root."""
    locations = load(_inside(root, name)).node.find("CatalogLocations")
    catalogs = []
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        below = os.path.normpath(PurePosixPath(name).parent / directory.get("path"))
        catalogs += [f"{below}/{file.name}" for file in sorted(_inside(root, below).glob("*.xosc"))]
    return catalogs


def _inside(root: Path, name: str) -> Path:
    """Path of a file of a catalogue.

    Raises:
        InvalidFile: it leads out of the catalogue.
    """
    path = root / name
    # Links too: an index comes from elsewhere, and a copy may not carry off other files.
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root)):
        raise InvalidFile(f"{name} is outside of the catalogue", path=root)
    return path
