"""Catalogues of recordings: what is in them, that they are sound and the same
each time, and that edited files stay.
"""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import copytree

import numpy as np
import pyarrow.parquet as pq
import pytest

import runner
import xosc
from recognition.catalogue import pipeline
from recognition.catalogue.detect import ByRules, EgoRequirements, passage, vehicles
from recognition.catalogue.pipeline import Summary
from recognition.catalogue.recordings import VEHICLES, CatalogueSettings
from recognition.catalogue.writing import index, replay, storyboard
from recognition.catalogue.writing.write import CatalogueConfig, criticality_of
from recognition.recordings import open as open_recordings
from recognition.scenes.cut import SceneCutter, Scope
from runner.recording import Recording
from schemas import check_many
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.terminal.command_line import progress_bar
from schemas.common.terminal.files import expand
from tests.commands import Command
from tests.recognition import motorway
from tests.recognition.traffic import interaction_rows, write_csv
from xosc.document import Document
from xosc.writing import tags


def build(recordings: Path, out: Path, **settings: object) -> Summary:
    return pipeline.build(
        [recordings], out, CatalogueSettings(**settings), ByRules, partial(progress_bar, quiet=True)
    )


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def rows(out: Path) -> list[dict]:
    return json.loads((out / "index.json").read_text())["scenarios"]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    motorway.write_motorway(folder)
    return folder


@pytest.fixture(scope="module")
def made(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("catalogue")
    build(recordings, out)
    return out


@pytest.fixture
def catalogue(made: Path, tmp_path: Path) -> Path:
    return copytree(made, tmp_path / "catalogue")


def test_recordings_whose_files_would_have_one_name_are_refused(tmp_path: Path) -> None:
    for folder in ("a b", "a_b"):
        motorway.write_motorway(tmp_path / "in" / folder, "01")
    with pytest.raises(
        UsageError, match=r"of recording 'a_b/01' would have the names of .*'a b/01'"
    ):
        build(tmp_path / "in", tmp_path / "out")


def test_every_file_is_sound(made: Path) -> None:
    assert [
        problem for _, problems in check_many(expand([str(made)])) for problem in problems
    ] == []


def test_each_class_has_its_folder_with_catalogues_that_its_scenarios_refer_to(made: Path) -> None:
    cut_in = made / "highway_cut_in"
    kinds = {
        path.parent.relative_to(cut_in / "catalogs").parts[0]
        for path in cut_in.glob("catalogs/**/*.xosc")
    }
    assert kinds == {"vehicles", "trajectories", "maneuvers", "controllers"}
    for path in cut_in.glob("*.xosc"):
        assert xosc.resolve(xosc.load(path)).node.need("Entities").find("ScenarioObject"), (
            "its references are resolved"
        )


def test_catalogues_have_the_names_of_their_files(made: Path) -> None:
    files = list(made.rglob("catalogs/**/*.xosc"))
    assert len(files) > 3
    assert [re.findall('<Catalog name="(.*?)"', path.read_text()) for path in files] == [
        [path.stem] for path in files
    ]


@pytest.mark.parametrize("target", ["esmini", "1.0"])
def test_exports_of_several_classes_fit_into_one_folder(
    command: Command, made: Path, tmp_path: Path, target: str
) -> None:
    """Each by a call of its own; a catalogue's file has its name, by which esmini opens it."""
    chosen = {row["class"]: row for row in rows(made) if row["maneuver"]}
    files = [made / row[name] for row in chosen.values() for name in ("file", "maneuver")]
    assert len(chosen) > 2
    for file in files:
        done = command("xosc-export", file, "--to", target, "--out", tmp_path)
        assert done.code == 0, done.err
    assert len(list(tmp_path.glob("*.xosc"))) == len(files)
    catalogs = list(tmp_path.rglob("catalogs/**/*.xosc"))
    assert [re.findall('<Catalog name="(.*?)"', path.read_text()) for path in catalogs] == [
        [path.stem] for path in catalogs
    ]
    assert [
        problem
        for _, found in check_many(expand([str(tmp_path)]))
        for problem in found
        if problem.level == "error"
    ] == []


def test_scenarios_run_and_cut_in(made: Path) -> None:
    row = next(
        row
        for row in rows(made)
        if row["class"] == "highway cut in" and row["vehicle"] == motorway.EGO
    )
    for name in (row["file"], row["maneuver"]):
        result = runner.run(made / name, sut="none", world="kinematic")
        assert (result.status, result.ego) == ("completed", "Ego")
        cutter = result.recording.locate().tracks["car_2"].columns
        assert cutter["lane_id"][0] == -2 and cutter["lane_id"][-1] == -3


def test_the_index_tells_the_same_in_all_its_formats(made: Path) -> None:
    told = rows(made)
    assert {"highway cut in", "highway car following", "right lane change"} <= {
        row["class"] for row in told
    }
    table = pq.read_table(made / "index.parquet").to_pylist()
    assert table == [{name: row[name] for name in index.COLUMNS} for row in told]
    beside = [row for row in told if row["min_distance"] is not None]
    assert beside and all(
        row["max_risk_field"] >= 0.0 <= row["max_collision_probability"] <= 1.0 for row in beside
    )
    with (made / "index.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert (
        [row["file"] for row in read]
        == [row["file"] for row in told]
        == sorted(row["file"] for row in told)
    )
    assert all(
        (made / row[name]).is_file() for row in told for name in ("file", "openlabel", "road")
    )
    assert all((row["maneuver"] is None) == bool(row["no_maneuver"]) for row in told)
    assert all((made / row["maneuver"]).is_file() for row in told if row["maneuver"])


def test_the_index_says_why_and_measures_the_pair_within_the_event(made: Path) -> None:
    told = rows(made)
    assert {row["trust"] for row in told} == {"rules alone"}
    (cut_in,) = [row for row in told if row["class"] == "highway cut in"][:1]
    assert re.search(
        r"becomes the lead within 80 m; gap [\d.]+.*; ego on road .*; partner from "
        r"road .* lane .* to road",
        cut_in["why"],
    )
    assert (cut_in["road_kind"], cut_in["partial"], cut_in["pair_touches"]) == (
        "main",
        False,
        False,
    )
    assert cut_in["gap"] == pytest.approx(cut_in["tags"]["gap"], abs=0.5)
    assert cut_in["closing_speed"] == pytest.approx(
        cut_in["ego_speed"] - cut_in["partner_speed"], abs=0.1
    )
    assert cut_in["pair_ttc"] is None or cut_in["pair_ttc"] >= cut_in["min_ttc"] - 0.002


def test_tags_are_openlabel_beside_the_scenario_and_properties_in_it(made: Path) -> None:
    row = next(
        row
        for row in rows(made)
        if row["class"] == "highway cut in" and row["vehicle"] == motorway.EGO
    )
    told = {tag.type: tag.value for tag in tags.read(made / row["openlabel"])}
    expected = {
        "Class": "highway cut in",
        "State": "known",
        "RuleClass": "highway cut in",
        "Recording": row["recording"],
    }
    assert expected.items() <= told.items()
    assert {"MotionCutIn", "RoadTypeMotorway", "VehicleCar"} <= told.keys()
    assert told["MinTimeHeadway"] == row["min_thw"] == pytest.approx(20.4 / 30.0, abs=0.02)
    held = {
        each.get("name"): each.get("value")
        for each in xosc.load(made / row["file"]).root.iter("Property")
    }
    assert held["openlabel.Class"] == "highway cut in" and held["openlabel.Vehicle"] == motorway.EGO


@pytest.mark.parametrize("version", [(1, 0), (1, 2)])
def test_older_versions_are_written_on_request(
    recordings: Path, tmp_path: Path, version: tuple[int, int]
) -> None:
    build(recordings, tmp_path, config=CatalogueConfig(version=version))
    files = sorted(tmp_path.rglob("*.xosc"))
    assert files and {xosc.load(file).version for file in files} == {version}
    assert [problem for _, problems in check_many(files) for problem in problems] == []
    reasons = {row["no_maneuver"] for row in rows(tmp_path) if row["class"] == "highway cut in"}
    assert all("1.0" in reason for reason in reasons) if version == (1, 0) else reasons == {None}


# the same again, and what people edit ----------------------------------------------------------


def test_the_same_recordings_give_the_same_bytes(
    recordings: Path, made: Path, catalogue: Path, tmp_path: Path
) -> None:
    again = build(recordings, catalogue)
    assert (again.edited, again.removed) == ([], [])
    build(recordings, tmp_path / "elsewhere")
    assert content(catalogue) == content(made) == content(tmp_path / "elsewhere")


@pytest.mark.parametrize("name", ["scenario", "catalogue", "index.csv", "road"])
def test_what_a_person_edited_stays_and_is_reported(
    recordings: Path, catalogue: Path, name: str
) -> None:
    row = rows(catalogue)[0]
    vehicles = (
        next(catalogue.glob("*/catalogs/vehicles/*/*.xosc")).relative_to(catalogue).as_posix()
    )
    edited = {"scenario": row["file"], "catalogue": vehicles, "road": row["road"]}.get(name, name)
    before = content(catalogue)
    (catalogue / edited).write_bytes(before[edited] + b"\n")
    for _ in range(2):
        assert build(recordings, catalogue).edited == [edited]
    assert content(catalogue) == before | {edited: before[edited] + b"\n"}


def test_a_persons_own_file_is_not_overwritten(
    recordings: Path, made: Path, tmp_path: Path
) -> None:
    row = rows(made)[0]
    (tmp_path / row["file"]).parent.mkdir(parents=True)
    (tmp_path / row["file"]).write_text("mine")
    assert build(recordings, tmp_path).edited == [row["file"]]
    assert (tmp_path / row["file"]).read_text() == "mine"


def test_files_that_are_no_longer_part_of_it_go_unless_edited(
    recordings: Path, catalogue: Path
) -> None:
    kept, *others = [row["file"] for row in rows(catalogue)]
    (catalogue / kept).write_text("mine")
    summary = build(recordings, catalogue, scenes=VEHICLES)
    assert kept in summary.edited and set(others) <= set(summary.removed)
    assert (catalogue / kept).read_text() == "mine" and not any(
        (catalogue / name).exists() for name in others
    )
    assert {path.parent.name for path in catalogue.glob("*/*.xosc")} == {
        "vehicles",
        Path(kept).parent.name,
    }


def test_a_catalogue_of_other_recordings_is_left_alone(catalogue: Path, tmp_path: Path) -> None:
    before = content(catalogue)
    motorway.write_motorway(tmp_path / "others", "02")
    with pytest.raises(UsageError, match="this folder has a catalogue of other recordings"):
        build(tmp_path / "others", catalogue)
    assert content(catalogue) == before


def test_a_manifest_that_names_files_elsewhere_is_refused(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "manifest.json").write_text('{"files": {"../victim": "0"}}')
    with pytest.raises(InvalidFile, match="outside of the catalogue"):
        build(recordings, tmp_path / "out")


def test_a_damaged_index_is_refused(catalogue: Path, recordings: Path) -> None:
    (catalogue / "index.json").write_text('{"recordings": 7, "scenarios": ["none"]}')
    with pytest.raises(InvalidFile, match=r"index\.json: .* a list of objects 'recordings'"):
        build(recordings, catalogue)
    with pytest.raises(InvalidFile, match=r"index\.json: .* a list of objects 'scenarios'"):
        index.rows_of(catalogue)


# recordings ---------------------------------------------------------------------------------


def test_a_bad_recording_is_reported_and_the_others_go_on(recordings: Path, tmp_path: Path) -> None:
    copytree(recordings, tmp_path / "in")
    track_file = motorway.write_motorway(tmp_path / "in", "02")
    track_file.write_text(track_file.read_text().replace("30.0", "fast", 1))
    summary = build(tmp_path / "in", tmp_path / "out")
    assert [name.rpartition("/")[2] for name in summary.failures] == ["02"]
    assert "02_tracks.csv:2" in str(next(iter(summary.failures.values())))
    assert {row["recording"].rpartition("/")[2] for row in rows(tmp_path / "out")} == {"01"}


def test_recordings_of_one_name_are_refused(recordings: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has a recording called .* too"):
        pipeline.build(
            [recordings, recordings],
            tmp_path,
            CatalogueSettings(),
            ByRules,
            partial(progress_bar, quiet=True),
        )


# scenes of vehicles -------------------------------------------------------------------------


def test_every_usable_vehicle_has_a_scene_and_the_others_a_reason(
    recordings: Path, tmp_path: Path
) -> None:
    summary = build(recordings, tmp_path, scenes=VEHICLES)
    told = rows(tmp_path)
    assert {row["vehicle"] for row in told} == {"1", "2", "3", "4", "5", "6"}
    assert [(each["what"], each["reason"]) for each in summary.exclusions] == [
        ("7", "moves within 2.0 m only")
    ]
    assert summary.passages == {"straight": 6}
    assert {row["vehicle"]: row["class"] for row in told}[motorway.EGO] == "highway cut in"


def test_a_scene_that_begins_with_a_contact_is_reported(tmp_path: Path) -> None:
    """Two vehicles side by side, whose boxes overlap; a third one far ahead."""
    rows_of_all = [
        row
        for name, x, y in ((1, 0.0, 0.0), (2, 2.0, 1.0), (3, 60.0, 0.0))
        for row in interaction_rows(name, x, y, 8.0, 0.0, 0.0, n=60)
    ]
    recording = driven(tmp_path, all=rows_of_all)
    cutter = SceneCutter(recording, Scope())
    found = {
        name: criticality_of(cutter.cut(name, 0.0, 9.0))["collision_time"]
        for name in recording.tracks
    }
    assert found == {"1": 0.0, "2": 0.0, "3": None}


def driven(tmp_path: Path, **tracks: list) -> Recording:
    (source,) = open_recordings(
        write_csv(
            tmp_path / "site/vehicle_tracks_000.csv",
            [row for rows in tracks.values() for row in rows],
        )
    ).sources
    return source.load()


@pytest.mark.parametrize(
    ("turn", "name"),
    [(0.0, "straight"), (90.0, "left"), (-80.0, "right"), (170.0, "back"), (-40.0, "straight")],
)
def test_passages_are_told_by_the_change_of_direction(
    tmp_path: Path, turn: float, name: str
) -> None:
    share = np.clip((np.arange(120) - 40) / 40, 0.0, 1.0)
    h = np.radians(20.0 + turn * share)
    x, y = (np.cumsum(0.8 * f(h)) for f in (np.cos, np.sin))
    track = interaction_rows(1, 0.0, 0.0, 8.0, 0.0, 0.0, n=120)
    places = zip(track, x.tolist(), y.tolist(), h.tolist(), strict=True)
    moved = [
        row | {"x": a, "y": b, "psi_rad": c, "vx": 8 * np.cos(c), "vy": 8 * np.sin(c)}
        for row, a, b, c in places
    ]
    assert passage(driven(tmp_path, one=moved).tracks["1"]) == name


def test_reasons_against_a_vehicle(recordings: Path) -> None:
    (source,) = open_recordings(recordings).sources
    recording = source.load()
    assert recording.network is not None
    strict = EgoRequirements(duration=5.0, extent=200.0, gap=0.03, speed=25.0, on_road=1.1)
    names, exclusions = vehicles(recording, recording.network, strict)
    reasons = {each.what: each.reason for each in exclusions}
    assert names == []
    assert reasons["5"] == "recorded for 4.0 s only"
    assert (
        "jumps at 30 m/s" in reasons["1"] and "on a road for 100% of its rows only" in reasons["1"]
    )
    assert "not recorded for 0.0 s in between" in reasons["1"]
    assert "moves within" in reasons["6"] and "jumps" not in reasons["6"]


def test_a_vehicle_without_rows_is_no_ego(recordings: Path) -> None:
    (source,) = open_recordings(recordings).sources
    recording = source.load()
    assert recording.network is not None
    track = recording.tracks["5"]
    absent = replace(
        track, read=lambda: {name: values[:0] for name, values in track.columns.items()}
    )
    alone = Recording([absent], recording.timestep, recording.network)
    names, (exclusion,) = vehicles(alone, recording.network, EgoRequirements())
    assert (names, exclusion.rows, exclusion.reason) == ([], 0, "never recorded")


def test_every_scenario_was_played_and_is_near_its_raw_places(made: Path) -> None:
    told = rows(made)
    assert told and all(0.0 <= row["deviation"] <= row["most_deviation"] < 0.3 for row in told)
    assert json.loads((made / "index.json").read_text())["unplayable"] == {}


def test_maneuvers_that_do_not_play_are_none_and_say_why(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The manoeuvre is written for a lane that the road has not, as an estimation may want."""
    written = storyboard.scenario

    def wrong(stage: object, header: object, *more: object) -> Document:
        document = written(stage, header, *more)
        for position in document.root.iter("LanePosition"):
            position.set("laneId", "9")
        return document

    monkeypatch.setattr(storyboard, "scenario", wrong)
    summary = build(recordings, tmp_path)
    told = rows(tmp_path)
    assert told and {row["maneuver"] for row in told} == {None}
    assert all("it does not play: " in row["no_maneuver"] for row in told), told[0]["no_maneuver"]
    assert not list(tmp_path.glob("*/*_maneuver.xosc")) and not summary.unplayable
    assert "maneuver.xosc" not in (tmp_path / "manifest.json").read_text()


def test_maneuvers_that_never_begin_are_none_and_say_why(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The trigger waits for a time after the end of the run."""
    written = storyboard.scenario

    def late(stage: object, header: object, *more: object) -> Document:
        document = written(stage, header, *more)
        for declared in document.root.iter("ParameterDeclaration"):
            if declared.get("name") == "Begin_s":
                declared.set("value", "100")
        return document

    monkeypatch.setattr(storyboard, "scenario", late)
    build(recordings, tmp_path)
    told = [row for row in rows(tmp_path) if row["class"] == "highway cut in"]
    assert told and {row["maneuver"] for row in told} == {None}
    reasons = [row["no_maneuver"] for row in told]
    assert all(reason.startswith("its run is inconclusive: ") for reason in reasons), reasons
    assert not any(str(tmp_path) in reason for reason in reasons), "bytes depend on no folder"


def test_replays_without_a_verdict_are_named_in_the_index(
    command: Command, recordings: Path, made: Path, tmp_path: Path
) -> None:
    """The truck is no longer recorded after 8 s, shortly before the ego would reach it."""
    named = {row["file"]: row["inconclusive"] for row in rows(made) if row["inconclusive"]}
    assert named and all("truck_5 was removed at" in reason for reason in named.values())
    for row in rows(made):
        result = runner.run(made / row["file"], sut="none", world="kinematic", timestep=0.1)
        assert (result.verdict.outcome == "inconclusive") == (row["file"] in named), row["file"]
    done = command("xosc-recognize", recordings, "--labels", "rules", "--out", tmp_path)
    assert done.code == 0
    assert (
        f"{len(named)} replays have no verdict as recorded, {next(iter(named))} first" in done.err
    )
    assert next(iter(named.values())) in done.err


def test_scenarios_that_do_not_play_are_left_out_with_their_reason(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = replay.scenario

    def wrong(*arguments: object, **named: object) -> bytes:
        content = written(*arguments, **named)
        return content.replace(b'catalogName="TrajectoryCatalog"', b'catalogName="Trajectories"')

    monkeypatch.setattr(replay, "scenario", wrong)
    summary = build(recordings, tmp_path)
    assert rows(tmp_path) == [] and summary.unplayable and not summary.classes
    assert all(reason.startswith("it does not play: ") for reason in summary.unplayable.values())
    assert json.loads((tmp_path / "index.json").read_text())["unplayable"] == summary.unplayable
    assert not list(tmp_path.glob("*/*.xosc")) and not list(tmp_path.glob("*/*.json"))
    assert not list(tmp_path.glob("*/catalogs/trajectories"))
