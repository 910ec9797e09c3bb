"""Copies of scenarios with all that they need: rows of a catalogue's index, or files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from schemas.catalogs import locate
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_bytes, read_object
from schemas.common.terminal.text import csv_text
from xosc.document import load
from xosc.document.road_files import find_roads, logic_file
from xosc.exports.draft import Folder
from xosc.listing.tables import INDEX, Index

if TYPE_CHECKING:
    import pyarrow as pa

    from xosc.listing import Listed

FILES = ("file", "maneuver", "openlabel", "road")
"""Columns of the index that name files of a scenario, relative to the index"""


def copy_scenarios(scenarios: Iterable[Listed], folder: Folder) -> int:
    """Copy scenarios and their variation files with their roads and catalogues; the number of files.

    Files keep their places relative to each other, so that the copies run.

    Raises:
        UsageError: a file is in the way, or can't be written.
        InvalidFile: a road or catalogue is nowhere.
    """
    files = dict.fromkeys(
        Path(os.path.abspath(path)) for each in scenarios for path in _needed(each)
    )
    root = os.path.commonpath([path.parent for path in files])
    for path in files:
        folder.write(path.relative_to(root).as_posix(), read_bytes(path))
    return len(files)


def _needed(listed: Listed) -> Iterator[Path]:
    """Yield the files of a scenario."""
    yield listed.path
    yield from (each.path for each in listed.variations)
    root = load(listed.path).node
    logic = logic_file(root)
    if logic is not None:
        yield find_roads(logic).path
    locations = root.find("CatalogLocations")
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        try:
            yield from map(Path, locate(directory.file("path"), listed.path).files)
        except (OSError, ValueError) as error:
            raise directory.invalid(f"this catalogue can't be read: {error}") from None


def copy_rows(index: Index, table: pa.Table, folder: Folder) -> int:
    """Copy the scenarios of some rows with their roads and catalogues, and an index of them; the number of files.

    Files keep their places relative to the index, so that the copies run and can be asked again.

    Raises:
        UsageError: a file is in the way, or can't be written.
        InvalidFile: a file of the catalogue is missing, or outside of it.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = table.to_pylist()
    chosen = {row["file"] for row in rows}
    about = read_object(index.root / "index.json")
    scenarios = [
        row
        for row in about.get("scenarios", [])
        if isinstance(row, dict) and row.get("file") in chosen
    ]
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
    found = []
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        below = os.path.normpath(PurePosixPath(name).parent / directory.get("path"))
        found += [f"{below}/{file.name}" for file in sorted(_inside(root, below).glob("*.xosc"))]
    return found


def _inside(root: Path, name: str) -> Path:
    """Path of a file of a catalogue.

    Raises:
        InvalidFile: it leads out of the catalogue.
    """
    path = root / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root)):
        raise InvalidFile(f"{name} is outside of the catalogue", path=root)
    return path
