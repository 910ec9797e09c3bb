"""Which recordings are found in folders of all kinds of files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from recognition import recordings as datasets
from schemas.common.errors import InvalidFile
from tests.recognition.traffic import (
    Car,
    commonroad,
    interaction_rows,
    metric_rows,
    ngsim_rows,
    obstacle,
    write_archive,
    write_csv,
    write_highd,
    write_parquet,
)

CAR = interaction_rows(1, 0.0, 0.0, 5.0, 0.0, 0.0)


def mixed(folder: Path) -> None:
    """A recording of each format but a run, and other files."""
    write_highd(folder / "highD", [Car(1, 100.0, 21.0, 30.0)])
    write_csv(folder / "interaction" / "site" / "vehicle_tracks_000.csv", CAR)
    write_csv(folder / "cases_val.csv", [{"case_id": 1, **row} for row in CAR])
    (folder / "A_B-1_1_T-1.xml").write_text(commonroad(obstacle(1, 0.0, 0.0, 0.0, 5.0)))
    write_archive(folder / "more.tar.xz", {"C_D-1_1_T-1.xml": commonroad()})
    write_csv(folder / "us101.csv", ngsim_rows(1, 0.0, 0.0, 50.0))
    write_parquet(folder / "i80.parquet", metric_rows(1, 0.0, 0.0, 0.0, 8.0))
    write_csv(folder / "notes.csv", [{"who": "me", "what": "seen"}])
    (folder / "settings.xml").write_text("<settings/>")
    (folder / "README.md").write_bytes(b"\xff\xfe\x00")
    (folder / "empty.txt").touch()
    (folder / "folder.csv").mkdir()
    (folder / "folder.xml").mkdir()


@pytest.mark.parametrize(
    "name", ["USA_US101-1_1_T-1.xml", "scene.json", "tracks.csv", "scenario_1.parquet"]
)
def test_a_pointer_in_the_place_of_a_recording_says_what_brings_it(
    name: str, tmp_path: Path
) -> None:
    write_csv(tmp_path / "us101.csv", ngsim_rows(1, 0.0, 0.0, 50.0))
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:e17c6a1f\nsize 776913\n"
    for other in (name, "README.md", "picture.png"):
        (tmp_path / other).write_text(pointer)
    (recording, missing) = sorted(
        datasets.open(tmp_path).sources, key=lambda source: source.path.name != "us101.csv"
    )
    assert recording.load().tracks
    with pytest.raises(
        InvalidFile, match=f"{name}: this is a pointer of Git LFS: 'git lfs pull' brings the file"
    ):
        missing.load()


def test_every_recording_of_a_mixed_folder_is_found(tmp_path: Path) -> None:
    mixed(tmp_path)
    sources = datasets.open(tmp_path, roads=tmp_path / "roads").sources
    assert sorted((source.format, source.name) for source in sources) == [
        ("CommonRoad", "A_B-1_1_T-1"),
        ("CommonRoad", "C_D-1_1_T-1"),
        ("INTERACTION", "cases_val/1"),
        ("INTERACTION", "site/000"),
        ("NGSIM", "i80"),
        ("NGSIM", "us101"),
        ("highD", "highD/01"),
    ]
    for source in sources:
        source.load()


def test_names_that_several_have_are_led_by_their_places(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        write_csv(tmp_path / folder / "site" / "vehicle_tracks_000.csv", CAR)
    write_csv(tmp_path / "c" / "site" / "vehicle_tracks_001.csv", CAR)
    (tmp_path / "A_B-1_1_T-1.xml").write_text(commonroad(obstacle(1, 0.0, 0.0, 0.0, 5.0)))
    write_archive(
        tmp_path / "b.tar", {"A_B-1_1_T-1.xml": commonroad(obstacle(2, 0.0, 0.0, 0.0, 5.0))}
    )
    sources = datasets.open(tmp_path).sources
    assert [source.name for source in sources] == [
        "A_B-1_1_T-1.xml/A_B-1_1_T-1",
        "a/site/vehicle_tracks_000.csv/site/000",
        "b/site/vehicle_tracks_000.csv/site/000",
        "b.tar/A_B-1_1_T-1",
        "site/001",
    ]
    assert [list(source.load().tracks) for source in sources if source.format == "CommonRoad"] == [
        ["1"],
        ["2"],
    ]


def test_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.csv").write_text("who,what\n")
    with pytest.raises(
        InvalidFile,
        match=r"no recording of a known format is here \(.*CommonRoad, .*highD, .*INTERACTION",
    ):
        _ = datasets.open(tmp_path).sources


def test_path_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="absent: no such file or folder"):
        datasets.open(tmp_path / "absent")


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.csv", b"", ":1: the file is empty"),
        ("a.csv", b"\xff\xfet\0r\0", ":1: this is not UTF-8 text"),
        ("a.parquet", b"PAR1", ": the file can't be read"),
        ("a.tar.xz", b"\xfd7zXZ\0", ": "),
        ("07_tracksMeta.csv", b"", ":1: the file is empty"),
    ],
)
def test_table_that_nobody_can_read_is_named_when_it_is_loaded_and_not_passed_over(
    tmp_path: Path, name: str, content: bytes, complaint: str
) -> None:
    mixed(tmp_path)
    before = len(datasets.open(tmp_path).sources)
    (tmp_path / name).write_bytes(content)
    found = {source.name: source for source in datasets.open(tmp_path).sources}
    assert len(found) == before + 1
    with pytest.raises(InvalidFile, match=rf"{name}{complaint}"):
        found[name].load()


def test_track_file_that_nobody_can_read_does_not_keep_the_others_from_being_read(
    tmp_path: Path,
) -> None:
    write_csv(tmp_path / "site" / "vehicle_tracks_000.csv", CAR)
    (tmp_path / "site" / "vehicle_tracks_001.csv").touch()
    good, bad = datasets.open(tmp_path).sources
    assert len(good.load().tracks) == 1
    with pytest.raises(InvalidFile, match=r"vehicle_tracks_001\.csv:1: the file is empty"):
        bad.load()


def test_recording_whose_name_no_scenario_can_have_is_refused(tmp_path: Path) -> None:
    write_csv(tmp_path / "\x1b[31msite" / "vehicle_tracks_000.csv", CAR)
    with pytest.raises(
        InvalidFile,
        match=r"name of recording '\\x1b\[31msite/000' has characters that can't be printed",
    ):
        _ = datasets.open(tmp_path).sources


@pytest.mark.parametrize(
    ("columns", "missing"),
    [
        ("track_id,frame_id,timestamp_ms,x,y,vx,vy", "agent_type, psi_rad"),
        ("track_id,frame_id,time,agent_type,x,y,vx,vy,psi_rad,length,width", "timestamp_ms"),
        ("Vehicle_ID,Frame_ID,Local_X,v_Vel", "local_y"),
        ("vehicle_id,sim_time,position_x", "position_y"),
    ],
)
def test_table_that_lacks_a_column_of_its_format_is_refused_and_not_passed_over(
    tmp_path: Path, columns: str, missing: str
) -> None:
    (tmp_path / "t.csv").write_text(f"{columns}\n")
    (source,) = datasets.open(tmp_path).sources
    with pytest.raises(InvalidFile, match=rf"t\.csv:1: no column {missing}"):
        source.load()


def test_numbered_highd_tracks_without_their_meta_files_are_refused(tmp_path: Path) -> None:
    path = write_highd(tmp_path, [Car(1, 100.0, 21.0, 30.0)])
    (tmp_path / "01_recordingMeta.csv").unlink()
    (source,) = datasets.open(path).sources
    with pytest.raises(InvalidFile, match=r"there is no 01_recordingMeta\.csv beside it"):
        source.load()


def test_importing_the_readers_imports_nothing_heavy() -> None:
    code = (
        "import sys, recognition.recordings; print({'torch', 'sklearn', 'matplotlib', 'libsumo', "
        "'pyarrow'} & set(sys.modules))"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout
        == "set()\n"
    )
