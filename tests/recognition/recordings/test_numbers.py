"""A number that is none is refused with file, line and column, in any row and
column that is read; changing sizes are told.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from recognition import recordings as datasets
from recognition.recordings.formats import highd, ind, interaction, ngsim
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import (
    RECTANGLE,
    Car,
    commonroad,
    ind_rows,
    interaction_rows,
    metric_rows,
    ngsim_rows,
    obstacle,
    read,
    write_csv,
    write_highd,
    write_ind,
)

PEDESTRIAN = {"agent_type": "pedestrian/bicycle", "length": None, "width": None}


class Example(NamedTuple):
    """A good recording. write: its files in a folder. file: the one whose values
    are changed. read, sizes: its columns.
    """

    write: Callable[[Path], object]
    file: str
    read: tuple[str, ...]
    sizes: tuple[str, ...] = ()


def _highd(folder: Path) -> None:
    write_highd(
        folder, [Car(1, 100.0, 21.0, 30.0), Car(2, 300.0, 13.0, -25.0, kind="Truck", first=3)]
    )


def _ind(folder: Path) -> None:
    write_ind(folder, ind_rows(1, 0, 0, 5, 0) + ind_rows(2, 0, 9, 5, 0, first=3))


def _public(folder: Path) -> None:
    rows = ngsim_rows(1, 0, 0, 50, n=9) + ngsim_rows(2, 0, 9, 40, n=9)
    write_csv(
        folder / "t.csv", [{key.lower(): value for key, value in row.items()} for row in rows]
    )


PUBLIC = tuple(name for name in (*ngsim._PUBLIC, *ngsim._PUBLIC_MORE) if name != "location")
EXAMPLES = {
    "highD": Example(_highd, "01_tracks.csv", tuple(highd._TRACKS), ("width", "height")),
    "highD, vehicles": Example(_highd, "01_tracksMeta.csv", tuple(highd._VEHICLES),
        ("width", "height")),
    "highD, recording": Example(_highd, "01_recordingMeta.csv", ("frameRate", *highd._RECORDING),
        ("frameRate",)),
    "inD": Example(_ind, "00_tracks.csv",
        tuple(name for name in ind._TRACKS if name not in ind._SIZES)),
    "inD, participants": Example(_ind, "00_tracksMeta.csv", tuple(ind._PARTICIPANTS),
        ("width", "length")),
    "inD, recording": Example(_ind, "00_recordingMeta.csv", ("frameRate", *ind._PLACE),
        ("frameRate",)),
    "INTERACTION": Example(
        lambda folder: write_csv(folder / "s_train.csv",
            interaction_rows(1, 0, 9, 5, 0, 0) + interaction_rows(2, 0, 0, 5, 0, 0)),
        "s_train.csv",
        (*interaction._COLUMNS, *interaction._BOX),
        ("length", "width"),
    ),
    "NGSIM": Example(_public, "t.csv", PUBLIC, ("v_length", "v_width")),
    "metric": Example(
        lambda folder: write_csv(folder / "t.csv",
            metric_rows(1, 0, 0, 0, 8) + metric_rows(2, 0, 9, 0, 8)),
        "t.csv",
        tuple(ngsim._METRIC),
        ("length", "width"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXAMPLES)
def test_number_that_is_none_is_refused_wherever_it_stands(tmp_path: Path, name: str) -> None:
    example = EXAMPLES[name]
    example.write(tmp_path)
    file = tmp_path / example.file
    header, *lines = file.read_text().splitlines()
    names = header.split(",")
    bad = [
        (column, value)
        for column in example.read
        if column not in ("track_id", "case_id")
        for value in ("nan", "inf", "-inf", "1e12")
    ]
    bad += [(column, value) for column in example.sizes for value in ("0", "-1", "0.0", "-0.0")]
    for column, value in bad:
        for row in {0, len(lines) // 2, len(lines) - 1}:
            values = lines[row].split(",")
            values[names.index(column)] = value
            file.write_text(
                "\n".join([header, *lines[:row], ",".join(values), *lines[row + 1 :], ""])
            )
            with pytest.raises(InvalidFile) as raised:
                read(tmp_path)
            error = raised.value
            assert (error.path, error.line, error.element) == (
                str(file),
                row + 2,
                f"column {column}",
            ), (column, value, error)


def test_size_that_changes_is_told_and_the_first_one_counts(tmp_path: Path) -> None:
    rows = interaction_rows(1, 0, 9, 5, 0, 0) + interaction_rows(2, 0, 0, 5, 0, 0)
    rows[7] |= {"length": 9.0}
    recording, report = read(write_csv(tmp_path / "s_train.csv", rows))
    assert recording.tracks["1"].box.length == 4.0
    assert "length changes within tracks (1): that of the first row counts" in report.remarks


def test_pedestrian_without_a_size_in_some_rows_is_told(tmp_path: Path) -> None:
    rows = interaction_rows(1, 0, 9, 5, 0, 0) + interaction_rows(2, 0, 0, 0, 1, 0, **PEDESTRIAN)
    rows[-1] |= {"length": 0.6, "width": 0.5}
    assert (
        sum(
            "changes within tracks (2)" in remark
            for remark in read(write_csv(tmp_path / "s_train.csv", rows))[1].remarks
        )
        == 2
    )


def test_kind_that_is_not_known_is_refused_in_any_row(tmp_path: Path) -> None:
    rows = interaction_rows(1, 0, 9, 5, 0, 0)
    rows[7] |= {"agent_type": "boat"}
    with pytest.raises(InvalidFile, match="'boat' is none of car") as raised:
        read(write_csv(tmp_path / "s_train.csv", rows))
    assert raised.value.line == 9


def test_highd_sizes_that_differ_between_files_are_told(tmp_path: Path) -> None:
    _highd(tmp_path)
    file = tmp_path / "01_tracksMeta.csv"
    file.write_text(file.read_text().replace("2,4.0,2.0", "2,12.0,2.5"))
    recording, report = read(tmp_path)
    assert recording.tracks["2"].box.length == 12.0
    assert (
        "1 tracks (2 first) have another size in 01_tracksMeta.csv: that one counts"
        in report.remarks
    )


@pytest.mark.parametrize(
    ("rate", "limit", "element"), [(0.0, -1.0, "frameRate"), (25.0, 0.0, "speedLimit")]
)
def test_highd_recording_without_a_rate_or_limit_is_refused(
    tmp_path: Path, rate: float, limit: float, element: str
) -> None:
    cars = [Car(1, 100.0, 21.0, 30.0)]
    write_highd(tmp_path, cars, rate=25.0, speed_limit=limit)
    file = tmp_path / "01_recordingMeta.csv"
    file.write_text(file.read_text().replace(",25.0,", f",{rate},"))
    with pytest.raises(InvalidFile, match=element):
        read(tmp_path)


@pytest.mark.parametrize(
    "shape",
    [
        RECTANGLE.replace("4.0", "-4.0"),
        RECTANGLE.replace("2.0", "0"),
        "<circle><radius>-1</radius></circle>",
    ],
)
def test_commonroad_shape_of_no_size_is_refused(tmp_path: Path, shape: str) -> None:
    path = tmp_path / "A_B-1_1_T-1.xml"
    path.write_text(commonroad(obstacle(1, 0.0, 0.0, 0.0, 5.0, shape=shape)))
    with pytest.raises(InvalidFile, match="is no size") as raised:
        read(path)
    assert raised.value.line == 3


def test_header_with_an_open_quote_is_refused(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "t.csv", ngsim_rows(1, 0, 0, 50))
    path.write_text(path.read_text().replace("Lane_ID", '"Lane_ID', 1))
    (source,) = datasets.open(path).sources
    with pytest.raises(InvalidFile, match="this is no CSV"):
        source.load()
