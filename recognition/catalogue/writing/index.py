"""Index of a catalogue as JSON, CSV and Parquet, and the report of exclusions."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from recognition.catalogue import exposure
from recognition.catalogue.detect import plain
from recognition.catalogue.exposure import Mileage, rates
from recognition.catalogue.recordings import loaded
from recognition.catalogue.writing.page import Film, catalogue_page, lanes
from recognition.catalogue.writing.played import Played
from recognition.catalogue.writing.store import Store
from recognition.catalogue.writing.write import (
    CatalogFile,
    CatalogueConfig,
    Entries,
    PendingCatalog,
    write_catalog,
)
from recognition.recordings import Exclusion, Report, Source
from runner.judging.measures.measure import measures
from schemas.common.errors import InvalidFile
from schemas.common.storage import digest, read_object
from schemas.common.terminal.text import csv_text

FILE = "index.json"
"""Its place in the folder of a catalogue."""
COLUMNS: dict[str, type] = {
    "file": str,
    "maneuver": str,
    "no_maneuver": str,
    "inconclusive": str,
    "openlabel": str,
    "road": str,
    "class": str,
    "state": str,
    "sorted_by": str,
    "confidence": float,
    "rule_class": str,
    "model_class": str,
    "nearest_class": str,
    "labels_agree": bool,
    "trust": str,
    "why": str,
    "severity": float,
    "critical": str,
    "others": str,
    "partial": bool,
    "road_kind": str,
    "limit": float,
    "light": str,
    "weather": str,
    "daylight": str,
    "surface": str,
    "day": str,
    "ego_speed": float,
    "partner_speed": float,
    "closing_speed": float,
    "gap": float,
    "pair_thw": float,
    "pair_ttc": float,
    "pair_drac": float,
    "pair_touches": bool,
    "passage": str,
    "data_set": str,
    "site": str,
    "recording": str,
    "vehicle": str,
    "partner": str,
    "quality": float,
    "time": float,
    "start": float,
    "end": float,
    "participants": int,
    "deviation": float,
    "most_deviation": float,
    **dict.fromkeys(measures(), float),
    "collision_time": float,
}
"""Columns of a row; absent values are None.

Files relative to the index: the scenario that replays the recording, that with the manoeuvre (or
why it has none), tags, road. inconclusive: why the replay has no verdict when it is played as
recorded, such as a pedestrian that is lost before the ego reaches it.
The class, and whose labels sort; the model's confidence in the known
class nearest to what it saw; both labels, and whether they agree; trust: `agree`, `differ`, `rules
alone`, `model alone` or `measures`. severity: of the critical moment, from 0 to 1, with its
measures (critical) and other participants (others). why: conditions with values, lanes before and
after. partial: recorded in part. road_kind, limit (m/s): of the ego's lane at the event's time.
light: recorded state then of the traffic light that the ego passes, in the words of the data set.
weather, daylight, surface, day: of the recording, `unknown` where nothing states them
(`recognition.recordings.conditions`).
Speeds and closing speed (m/s) and gap along the road (m) of ego and partner at that time. Least THW
and TTC (s) and greatest DRAC (m/s²) of the pair within the event's time, blank where their boxes
touch (pair_touches), DRAC also above 20 m/s². Where from, with the quality of the recording from 0
to 1, and times in s. deviation,
most_deviation: median and maximum over the participants of the greatest distance (m) of the played
replay from the raw places. Measures of the ego against all others of the scene."""

Row = Mapping[str, Any]


def rows_of(root: Path) -> list[dict[str, Any]]:
    """The rows of the index of a catalogue.

    Raises:
        InvalidFile: it is missing, or not readable.
    """
    return _listed(root / FILE, "scenarios")


def recordings_of(root: Path) -> list[str]:
    """Return the names of the recordings in the index of a catalogue; none without an index.

    Raises:
        InvalidFile: it is not readable.
    """
    path = root / FILE
    return (
        [str(entry.get("name")) for entry in _listed(path, "recordings")] if path.is_file() else []
    )


def _listed(path: Path, name: str) -> list[dict[str, Any]]:
    found = read_object(path).get(name)
    if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
        raise InvalidFile(f"the index of a catalogue has a list of objects {name!r}", path=path)
    return found


def as_json(rows: Sequence[Row], more: Mapping[str, Any]) -> bytes:
    """The rows under "scenarios", after other facts."""
    listed = [
        {name: row.get(name) for name in COLUMNS} | {"tags": row.get("tags", {})} for row in rows
    ]
    return (
        json.dumps({**more, "scenarios": listed}, indent=1, ensure_ascii=False, allow_nan=False)
        + "\n"
    ).encode()


def as_csv(rows: Sequence[Row], columns: Mapping[str, type] = COLUMNS) -> bytes:
    """A header and a line a row; absent values are blank."""
    return csv_text([[*columns], *([row.get(name) for name in columns] for row in rows)]).encode()


def as_parquet(rows: Sequence[Row], columns: Mapping[str, type] = COLUMNS) -> bytes:
    """The same as a Parquet table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    # Types are declared: a column that is empty in one catalogue would be of another type there,
    # and tables of several could not be read as one.
    types = {str: pa.string(), float: pa.float64(), int: pa.int64(), bool: pa.bool_()}
    table = pa.table(
        {
            name: pa.array([row.get(name) for row in rows], types[kind])
            for name, kind in columns.items()
        }
    )
    target = pa.BufferOutputStream()
    pq.write_table(table, target, compression="zstd")
    return target.getvalue().to_pybytes()


class Catalogue:
    """A catalogue in a folder: roads first, then what `CatalogWriter` wrote of each recording, in
    any number.

    Args and errors are those of `CatalogWriter`; selected: whether it has some findings only, and
    so no exposure.
    """

    def __init__(
        self, root: Path, config: CatalogueConfig, sorted_by: str, selected: bool = False
    ) -> None:
        self._selected = selected
        self.store = Store(root)
        self.rows: list[dict[str, Any]] = []
        self.exclusions: list[dict[str, Any]] = []
        self.unplayable: dict[str, str] = {}
        self._recordings: list[dict[str, Any]] = []
        self._version, self._sorted_by = config.version, sorted_by
        self._entries: Entries = {}
        self._roads: dict[str, str] = {}
        self._films: dict[str, Film] = {}
        self._lanes: dict[str, list[list[int]]] = {}
        self._exposures: list[tuple[str, Mileage]] = []

    def road(self, path: Path) -> str:
        """Write the road of a site, once for each content; its name in the catalogue."""
        # By content: two sites may have one map, and maps of two sites one name.
        content = path.read_bytes()
        key = digest(content)
        if key not in self._roads:
            name = f"roads/{plain(path.stem)}.xodr"
            self._roads[key] = (
                name if name not in self._roads.values() else f"roads/{plain(path.stem)}-{key}.xodr"
            )
            self.store.write(self._roads[key], content)
            self._lanes[self._roads[key]] = lanes(loaded(path))
        return self._roads[key]

    def register(
        self, source: Source, report: Report, seen: Mileage, exclusions: Iterable[Exclusion]
    ) -> None:
        """Enter a recording into the index, with its exposure, what reading it found, and which
        vehicles are no egos."""
        self._exposures.append((source.site, seen._replace(quality=report.quality)))
        found: dict[str, float] = {
            "rows": report.rows,
            "tracks": report.tracks,
            "missing_rows": report.missing,
        }
        found |= {
            "vehicle_hours": round(seen.time / 3600.0, 4),
            "vehicle_km": round(seen.distance / 1000.0, 3),
        }
        found |= {"quality": report.quality}
        excluded = [exclusion._asdict() for exclusion in report.exclusions]
        recording = {"name": source.name, "data_set": source.format, "site": source.site, **found}
        self._recordings.append(
            {
                **recording,
                "verdict": report.verdict,
                "excluded_rows": excluded,
                "remarks": report.remarks,
            }
        )
        self.exclusions += (
            {"recording": source.name, **exclusion._asdict()} for exclusion in exclusions
        )

    def remarked(self, remark: str) -> int:
        """Return the number of recordings that have a remark."""
        return sum(remark in recording["remarks"] for recording in self._recordings)

    def take(self, written: PendingCatalog) -> None:
        """Take in what has been written of a recording."""
        self.rows += written.rows
        self._films |= written.films
        self.store.take(written.files, written.edited)
        for place, entries in written.entries.items():
            # Names of entries hold what sets them apart: of one name the first stands for all.
            own = self._entries.setdefault(place, {})
            for name, built in entries.items():
                own.setdefault(name, built)

    def write_catalogs(self) -> None:
        """Write the OpenSCENARIO catalogues, from which on all scenarios can be played."""
        for place in sorted(self._entries):
            write_catalog(self.store, place, self._entries.pop(place), self._version)

    def judge(self, played: Iterable[Played]) -> None:
        """Take in which scenarios play: others are not listed, and manoeuvres that do not have a
        reason in `no_maneuver`."""
        rows = {row["file"]: row for row in self.rows}
        for outcome in played:
            row = rows[outcome.file]
            row |= {"deviation": outcome.deviation, "most_deviation": outcome.most_deviation}
            row["inconclusive"] = outcome.inconclusive
            maneuver = row["maneuver"]
            if outcome.fault is not None:
                del rows[outcome.file]
                self.unplayable[outcome.file] = outcome.fault
                # Whatever belongs to the scenario alone goes with it: nothing in the folder may be
                # unlisted.
                for name in (outcome.file, maneuver, row["openlabel"], *self._trajectories(row)):
                    self.store.discard(name or "")
            elif outcome.maneuver_fault is not None:
                self.store.discard(maneuver)
                row |= {"maneuver": None, "no_maneuver": outcome.maneuver_fault}
        self.rows = list(rows.values())

    def _trajectories(self, row: Row) -> list[str]:
        """The trajectory catalogue of a scenario alone."""
        folder, name = row["file"].removesuffix(".xosc").split("/")
        below = CatalogFile(folder, "Trajectory", name).directory
        return [file for file in self.store.written if file.startswith(f"{folder}/{below}/")]

    def close(self, **more: Any) -> list[str]:
        """Write the index; the files of earlier runs that were removed."""
        rows = sorted(self.rows, key=lambda row: row["file"])
        more = {
            "sorted_by": self._sorted_by,
            "recordings": self._recordings,
            "exclusions": self.exclusions,
            "unplayable": dict(sorted(self.unplayable.items())),
            **more,
        }
        self.store.write(FILE, as_json(rows, more))
        self.store.write("index.csv", as_csv(rows))
        self.store.write("index.parquet", as_parquet(rows))
        # Some of the events in all of the time would give rates of nothing.
        found = [] if self._selected else rates(rows, self._exposures)
        if not self._selected:
            self.store.write("exposure.csv", as_csv(found, exposure.COLUMNS))
            self.store.write("exposure.parquet", as_parquet(found, exposure.COLUMNS))
        self.store.write(
            "index.html", catalogue_page(rows, self._films, self._lanes, found).encode()
        )
        return self.store.close()
