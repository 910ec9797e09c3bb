"""Tables that questions are asked to: catalogues, batches, their single runs, searches, or several of one kind joined."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.common.errors import InvalidFile, UsageError, nearest, reason
from schemas.common.storage import read_parquet

if TYPE_CHECKING:
    import pyarrow as pa

INDEX = "index.parquet"
"""Typed index in the folder of a catalogue"""
RUNS, EPISODES, SETS = "runs.parquet", "episodes.parquet", "sets.parquet"
"""Tables of a batch, of a search, and of parameter sets that were played in arrays"""
_SHOWN = {
    INDEX: ("file", "class"),
    RUNS: ("name", "state", "end_time"),
    EPISODES: ("part", "status", "collision"),
    SETS: ("name", "verdict"),
}
"""Columns of text besides those that a question names"""
_NOUNS = {INDEX: "scenario", RUNS: "run", EPISODES: "episode", SETS: "parameter set"}
_MOST_SHOWN = 6
"""Columns of text of a table that no command has written"""
_RESULT = "result.json"
BATCH = "batch"
"""Column with the folder, where several are joined"""


class Index(NamedTuple):
    """Rows to ask, and the folder that they are of.

    Attributes:
        root: folder of the catalogue, batch or search; of the first where several are joined.
        table: their rows.
        name: of the table's file, which says its kind.
    """

    root: Path
    table: pa.Table
    name: str = INDEX

    @property
    def noun(self) -> str:
        """Noun for a row."""
        return _NOUNS.get(self.name, "row")

    @property
    def shown(self) -> list[str]:
        """Columns of text besides those that a question names."""
        names = self.table.column_names
        own = _SHOWN.get(self.name) or next(
            (each for each in _SHOWN.values() if set(each) <= set(names)), names[:_MOST_SHOWN]
        )
        return [each for each in (BATCH, *own) if each in names]

    def need_catalogue(self, option: str) -> None:
        """Refuse an option that compares scenarios of catalogues.

        Raises:
            UsageError: these are other rows.
        """
        if self.name != INDEX:
            raise UsageError(f"{option} is for catalogues, these are {self.noun}s", path=self.root)


def table_of(path: str | os.PathLike[str]) -> Path | None:
    """Return the table of a folder, or a table itself; None for anything else. A run's is that of its batch."""
    folder = Path(path)
    if folder.suffix == ".parquet" and folder.is_file():
        return folder
    for name in _SHOWN:
        if (folder / name).is_file():
            return folder / name
    if (folder / _RESULT).is_file() and (folder / ".." / RUNS).is_file():
        return Path(os.path.normpath(folder / ".." / RUNS))
    return None


def read_index(path: str | os.PathLike[str]) -> Index:
    """Return the rows of a catalogue, batch, run or search.

    Args:
        path: its folder, or its table.

    Raises:
        UsageError: the path has no table.
        InvalidFile: the table is not readable, or an index has no column `file`.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    file = table_of(path)
    if file is None:
        told = f"questions are to catalogues ({INDEX}), batches and runs ({RUNS}) and searches ({EPISODES}); there is none"
        raise UsageError(told, path=path)
    try:
        table = read_parquet(file)
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InvalidFile(f"not readable as Parquet: {reason(error)}", path=file) from None
    names = table.column_names
    if file.name == INDEX and ("file" not in names or not pa.types.is_string(table.schema.field("file").type)):  # fmt: skip
        raise InvalidFile("an index has a column 'file' of texts", path=file)
    if file.name == RUNS and Path(path) not in (file, file.parent) and "name" in names:
        table = table.filter(pc.field("name") == Path(os.path.abspath(path)).name)
    return Index(file.parent, _flat(table), file.name)


def read_all(paths: Sequence[str]) -> Index:
    """Return the rows of several folders, each with its folder in the column `batch`; errors as of `read_index`.

    Raises:
        UsageError: they are of different kinds.
    """
    import pyarrow as pa

    found = [read_index(path) for path in paths]
    first, *others = found
    if not others:
        return first
    for path, each in zip(paths, found, strict=True):
        if each.name != first.name:
            told = (
                f"these are {each.noun}s, and those of {paths[0]} are {first.noun}s: ask one kind"
            )
            raise UsageError(told, path=path)
    tables = [
        each.table.add_column(0, BATCH, pa.array([path] * each.table.num_rows, pa.string()))
        for path, each in zip(paths, found, strict=True)
    ]
    return first._replace(table=pa.concat_tables(_alike(tables), promote_options="default"))


def _alike(tables: Sequence[pa.Table]) -> list[pa.Table]:
    """Tables whose columns of one name have one type: numbers, or texts where that is different."""
    import pyarrow as pa

    types: dict[str, set[pa.DataType]] = {}
    for table in tables:
        for field in table.schema:
            if not pa.types.is_null(field.type):
                types.setdefault(field.name, set()).add(field.type)
    common = {
        name: pa.float64() if all(map(_is_number, found)) else pa.string()
        for name, found in types.items()
        if len(found) > 1
    }
    return [
        table.cast(
            pa.schema([(each.name, common.get(each.name, each.type)) for each in table.schema])
        )
        for table in tables
    ]


def _is_number(kind: pa.DataType) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _flat(table: pa.Table) -> pa.Table:
    """A table whose cells are single values: a column for each name of a map, lists as texts."""
    import pyarrow as pa

    columns: dict[str, Any] = {}
    for name in table.column_names:
        kind = table.schema.field(name).type
        if pa.types.is_map(kind):
            prefix = "" if name == "parameters" else f"{name}_"
            for key, values in _by_name(table[name].to_pylist()).items():
                if f"{prefix}{key}" not in table.column_names:
                    columns[f"{prefix}{key}"] = pa.array(values)
        elif pa.types.is_list(kind):
            texts = ["; ".join(map(str, each or ())) for each in table[name].to_pylist()]
            columns[name] = pa.array(texts, pa.string())
        else:
            columns[name] = table[name]
    return pa.table(columns)


def _by_name(maps: Iterable[Sequence[tuple[str, Any]] | None]) -> dict[str, list[Any]]:
    """Values of maps by name, as numbers where all are; None where a map lacks one."""
    rows = [dict(each or ()) for each in maps]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _numbers([row.get(name) for row in rows]) for name in names}


def _numbers(values: list[Any]) -> list[Any]:
    try:
        return [None if each is None else float(each) for each in values]
    except ValueError:
        return values


def chosen(names: Sequence[str], table: pa.Table) -> list[str]:
    """Return the columns that `--columns` names.

    Raises:
        UsageError: there is no such column.
    """
    found = [name.strip() for text in names for name in text.split(",") if name.strip()]
    for name in found:
        if name not in table.column_names:
            told = f"--columns: there is no column {name!r}; {nearest(name, table.column_names)}"
            raise UsageError(told)
    return list(dict.fromkeys(found))
