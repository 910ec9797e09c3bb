"""Writing catalogues: what the recordings have in common, and the index of all their scenarios."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from recognition.catalogue.episodes import plain
from recognition.catalogue.writing import index
from recognition.catalogue.writing.chapter import CatalogueConfig, Entries, Written, write_catalog
from recognition.catalogue.writing.store import Store
from recognition.datasets import Exclusion, Report, Source
from schemas.storage import digest


class Catalogue:
    """A catalogue being put together in a folder: roads first, then what `Chapter` has written of each recording, in any number.

    Args:
        root: the folder.
        sorted_by: whose labels decide the class of a scenario, and thereby its folder.

    Raises:
        UsageError: it can't be written.
    """

    def __init__(self, root: Path, config: CatalogueConfig, sorted_by: str) -> None:
        self.store = Store(root)
        self.rows: list[dict[str, Any]] = []
        self.exclusions: list[dict[str, Any]] = []
        self._recordings: list[dict[str, Any]] = []
        self._version, self._sorted_by = config.version, sorted_by
        self._entries: Entries = {}
        self._roads: dict[str, str] = {}

    def road(self, path: Path) -> str:
        """Write the road of a site, once for each content; its name in the catalogue."""
        content = path.read_bytes()
        key = digest(content)
        if key not in self._roads:
            name = f"roads/{plain(path.stem)}.xodr"
            self._roads[key] = name if name not in self._roads.values() else f"roads/{plain(path.stem)}-{key}.xodr"
            self.store.write(self._roads[key], content)
        return self._roads[key]

    def register(self, source: Source, report: Report, exclusions: Iterable[Exclusion]) -> None:
        """Enter a recording into the index, with what reading it found, and which vehicles are no egos."""
        found = {"rows": report.rows, "tracks": report.tracks, "missing_rows": report.missing}
        excluded = [exclusion._asdict() for exclusion in report.exclusions]
        recording = {"name": source.name, "data_set": source.format, "site": source.site, **found}
        self._recordings.append({**recording, "excluded_rows": excluded, "remarks": report.remarks})
        self.exclusions += ({"recording": source.name, **exclusion._asdict()} for exclusion in exclusions)

    def take(self, written: Written) -> None:
        """Take in what has been written of a recording."""
        self.rows += written.rows
        self.store.take(written.files, written.edited)
        for place, entries in written.entries.items():
            own = self._entries.setdefault(place, {})
            for name, built in entries.items():
                own.setdefault(name, built)

    def close(self, **more: Any) -> list[str]:
        """Write the OpenSCENARIO catalogues and the index; the files of earlier runs that were removed."""
        for place in sorted(self._entries):
            write_catalog(self.store, place, self._entries.pop(place), self._version)
        rows = sorted(self.rows, key=lambda row: row["file"])
        more = {"sorted_by": self._sorted_by, "recordings": self._recordings, "exclusions": self.exclusions, **more}
        self.store.write(index.FILE, index.as_json(rows, more))
        self.store.write("index.csv", index.as_csv(rows))
        self.store.write("index.parquet", index.as_parquet(rows))
        return self.store.close()
