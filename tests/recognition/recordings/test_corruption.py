"""Damaged recordings of every format: one clear error, or every row accounted for."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile, Unsupported
from tests.recognition.traffic import (
    Car,
    commonroad,
    ind_rows,
    interaction_rows,
    metric_rows,
    ngsim_rows,
    obstacle,
    total_rows,
    write_archive,
    write_csv,
    write_highd,
    write_ind,
    write_parquet,
)

PEDESTRIAN = {"agent_type": "pedestrian/bicycle", "psi_rad": None, "length": None, "width": None}


def csv_rows(data: bytes) -> int:
    """Rows below the header of a CSV file."""
    return (
        sum(1 for row in csv.reader(io.StringIO(data.decode("utf-8-sig"), newline="")) if row) - 1
    )


def parquet_rows(data: bytes) -> int:
    """Rows of a Parquet file."""
    return pq.read_metadata(io.BytesIO(data)).num_rows


def states(data: bytes) -> int:
    """States of all obstacles in a CommonRoad file."""
    return sum(1 for _ in etree.fromstring(data).iter("initialState", "state"))


def nothing(data: bytes) -> int:
    """For files that hold no rows of tracks."""
    return 0


class Example(NamedTuple):
    """A small good recording.

    write: puts it into a folder. rows: how to count the rows of tracks in a file, by the ending of
    its name.
    """

    write: Callable[[Path], object]
    rows: dict[str, Callable[[bytes], int]]


def _highd(folder: Path) -> None:
    write_highd(
        folder, [Car(1, 100.0, 21.0, 30.0), Car(2, 300.0, 13.0, -25.0, kind="Truck", first=3)]
    )


def _ind(folder: Path) -> None:
    write_ind(
        folder,
        ind_rows(1, 0.0, 0.0, 5.0, 0.0, n=5) + ind_rows(2, 0.0, 9.0, 0.0, 1.5, first=3, n=5),
        {2: "pedestrian"},
    )


def _interaction(folder: Path) -> None:
    write_csv(
        folder / "s" / "vehicle_tracks_000.csv",
        [row for k in (1, 2) for row in interaction_rows(k, 0, 9 * k, 5, 0, 0, n=5)],
    )
    write_csv(
        folder / "s" / "pedestrian_tracks_000.csv",
        interaction_rows("P1", 0, 0, 0, 1.5, 0, n=5, **PEDESTRIAN),
    )
    write_csv(folder / "s" / "meta_data.csv", [{"id": "000", "originLat": 49.0, "originLon": 8.4}])


def _cases(folder: Path) -> None:
    rows = [
        {"case_id": case, **row}
        for case in (1, 2)
        for row in interaction_rows(1, 0.0, 9.0 * case, 5.0, 0.0, 0.0, n=5)
    ]
    write_csv(folder / "site_train.csv", rows)


def _scenario() -> str:
    return commonroad(
        obstacle(1, 0.0, 0.0, 0.0, 5.0, steps=4), obstacle(2, 0.0, 9.0, 1.0, 5.0, steps=4)
    )


EXAMPLES = {
    "highD": Example(_highd, {"_tracks.csv": csv_rows, "Meta.csv": nothing}),
    "inD": Example(_ind, {"_tracks.csv": csv_rows, "Meta.csv": nothing}),
    "INTERACTION": Example(_interaction, {"tracks_000.csv": csv_rows, "meta_data.csv": nothing}),
    "cases": Example(_cases, {".csv": csv_rows}),
    "CommonRoad": Example(
        lambda folder: (folder / "A_B-1_1_T-1.xml").write_text(_scenario()), {".xml": states}
    ),
    "archive": Example(
        lambda folder: write_archive(
            folder / "a.tar.xz", {f"A_B-1_{k}_T-1.xml": _scenario() for k in (1, 2)}
        ),
        {".tar.xz": lambda data: 16},
    ),
    "NGSIM": Example(
        lambda folder: write_csv(
            folder / "t.csv", ngsim_rows(1, 0, 0, 50, n=5) + ngsim_rows(2, 0, 9, 40, n=5)
        ),
        {".csv": csv_rows},
    ),
    "metric": Example(
        lambda folder: write_csv(folder / "t.csv", metric_rows(1, 0, 0, 0, 8, n=8)),
        {".csv": csv_rows},
    ),
    "Parquet": Example(
        lambda folder: write_parquet(folder / "t.parquet", metric_rows(1, 0, 0, 0, 8, n=8)),
        {".parquet": parquet_rows},
    ),
}
NASTY = [
    b"", b"nan", b"inf", b"-inf", b"-1", b"0", b"1e400", b"1e18", b"9" * 30, b"99999999", b"1.0",
    b"1_0", b"0x1F", b"1,5",
    b"true", "１".encode(), b"\xe9", b"\xef\xbb\xbf", b'"', b",", b";", b" ", b"\n", b"\r", b"\r\n",
    b"\0",
    b"&", b"<", b"</state>", b"<!DOCTYPE a>", b"]]>",
]  # fmt: skip


class Damage(NamedTuple):
    """What happens to a file; places are shares of its length or number of its parts."""

    kind: str
    place: float
    length: float
    what: bytes

    def done_to(self, data: bytes) -> bytes:
        """The damaged content."""
        at = round(self.place * len(data))
        end = min(len(data), at + round(20 * self.length))
        if self.kind == "cut":
            return data[:at]
        if self.kind == "overwrite":
            return data[:at] + self.what + data[end:]
        separator = b"\n" if self.kind.endswith("line") else b","
        parts = data.split(separator)
        k = min(len(parts) - 1, round(self.place * len(parts)))
        if self.kind in ("drop line", "drop value"):
            del parts[k]
        elif self.kind in ("repeat line", "repeat value"):
            parts.insert(k, parts[round(self.length * (len(parts) - 1))])
        else:
            parts[k] = self.what
        return separator.join(parts)


KINDS = [
    "cut",
    "overwrite",
    "drop line",
    "repeat line",
    "other line",
    "drop value",
    "repeat value",
    "other value",
]
DAMAGE = st.builds(
    Damage, st.sampled_from(KINDS), st.floats(0, 1), st.floats(0, 1), st.sampled_from(NASTY)
)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), damages=st.lists(DAMAGE, min_size=1, max_size=3))
def test_damaged_recording_is_refused_or_read_without_losing_a_row(
    tmp_path: Path, name: str, data: st.DataObject, damages: list[Damage]
) -> None:
    example, folder = EXAMPLES[name], tmp_path / "recording"
    folder.mkdir(exist_ok=True)
    example.write(folder)
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    for damage in damages:
        file = data.draw(st.sampled_from(files))
        file.write_bytes(damage.done_to(file.read_bytes()))
    rows = 0
    try:
        for source in datasets.open(folder, roads=tmp_path / "roads").sources:
            recording = source.load()
            assert source.report is not None
            assert source.report.rows == total_rows(recording)
            assert source.report.tracks == len(recording.tracks)
            rows += source.report.rows + source.report.excluded
    except (InvalidFile, Unsupported) as error:
        assert error.path is not None
        assert error.path.startswith(str(folder))
        assert "\n" not in str(error)
        return
    there = {
        file: count
        for file in files
        for ending, count in example.rows.items()
        if file.name.endswith(ending)
    }
    assert len(there) == len(files)
    assert rows == sum(count(file.read_bytes()) for file, count in there.items())
