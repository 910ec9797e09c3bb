"""What is taken for recordings and scenarios of a user's folder."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path

import pytest

from generation.loop.findings import closing
from generation.loop.inputs import Inputs, distinct
from generation.loop.loop import run_loop
from generation.loop.xosc_loop import main
from generation.search.settings import LoopSettings
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.terminal.command_line import progress_bar
from tests.commands import Command
from tests.recognition.motorway import write_motorway
from tests.runner.files import car, distribution, place, scenario
from xosc.exports import standard
from xosc.exports.draft import Folder


def test_recordings_and_scenarios_are_told_apart(tmp_path: Path) -> None:
    write_motorway(tmp_path / "recordings")
    scenario(tmp_path, stop=1.0)
    distribution(tmp_path, "gaps", {"Gap": (10, 20, 10)})
    found = Inputs.of(tmp_path)
    assert [source.name for source in found.recordings] == ["recordings/01"]
    assert [path.name for path in found.scenarios] == ["gaps.xosc", "scenario.xosc"]


def test_scenarios_that_cannot_be_read_are_listed_and_the_others_go_on(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    scenario(folder, "good", stop=0.2)
    distribution(folder, "varied", {"Gap": (10, 20, 10)})
    (folder / "broken.xosc").write_text("<OpenSCENARIO>\n<FileHeader", encoding="utf-8")
    (folder / "gone.xosc").symlink_to("nowhere")
    (folder / "folder.xosc").mkdir()
    (folder / "varied.xosc").write_text(
        (folder / "varied.xosc")
        .read_text(encoding="utf-8")
        .replace("scenario.xosc", "nowhere.xosc"),
        encoding="utf-8",
    )
    found = run_loop(
        folder,
        tmp_path / "out",
        LoopSettings(processes=1),
        partial(progress_bar, quiet=True),
        lambda *_: None,
    )
    reasons = {each.title: each.reason for each in found.refused}
    assert set(reasons) == {"broken", "gone", "good", "varied"}
    assert "line 2: not well-formed XML" in reasons["broken"]
    assert reasons["gone"] == "no such file"
    assert "nowhere.xosc" in reasons["varied"]
    states = {name: [run.state for run in runs] for name, runs in found.scenarios.files.items()}
    assert states == {
        "broken.xosc": ["error"],
        "gone.xosc": ["error"],
        "good.xosc": ["passed"],
        "varied.xosc": ["error"],
    }
    assert {Path(each.partition(":")[0]).name for each in found.checked.problems} == {
        "broken.xosc",
        "gone.xosc",
        "varied.xosc",
    }
    assert f"not searched: gone: {reasons['gone']}" in closing(found)


def test_of_a_variation_file_no_more_sets_are_run_than_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    scenario(folder, "scenario", stop=0.2)
    for name, last in (("many", 60), ("few", 20)):
        distribution(folder, name, {"Gap": (10, last, 10)})
    shutil.copytree(folder, folder / "again")  # files of one name are told apart
    distribution(folder / "again", "many", {"Gap": (10, 40, 10)})
    settings = LoopSettings(processes=1, sample=2, rounds=0)
    found = run_loop(
        folder, tmp_path / "out", settings, partial(progress_bar, quiet=True), lambda *_: None
    ).scenarios
    runs = {"few.xosc": 2, "many.xosc": 2, "scenario.xosc": 1}
    assert {name: len(runs) for name, runs in found.files.items()} == runs | {
        f"again/{name}": runs[name] for name in runs
    }
    assert found.sampled == {"many.xosc": 6, "again/many.xosc": 4}


def test_files_are_checked_with_the_roads_and_catalogues_that_they_are_run_with(
    tmp_path: Path,
) -> None:
    folder, elsewhere = tmp_path / "mine", tmp_path / "elsewhere"
    standard.export(SCENARIOS / "simple_cut_in.xosc", "1.3", Folder(folder))
    elsewhere.mkdir()
    for part in ("roads", "catalogs/vehicles"):
        (folder / part).rename(elsewhere / Path(part).name)
    run = RunSettings(
        timestep=0.1, road_path=(str(elsewhere / "roads"),), catalog_path=(str(elsewhere),)
    )

    def problems(run: RunSettings) -> list[str]:
        settings = LoopSettings(run, processes=1, rounds=0)
        out = tmp_path / f"out{len(run.road_path)}"
        return run_loop(
            folder, out, settings, partial(progress_bar, quiet=True), lambda *_: None
        ).checked.problems

    assert problems(run) == []
    assert any("there is no file" in each for each in problems(RunSettings()))


@pytest.mark.slow
def test_runs_that_end_with_an_error_are_told_and_change_the_exit_code(
    tmp_path: Path, command: Command
) -> None:
    folder = tmp_path / "mine"
    crash = place("Ego", 100, 20) + place("Lead", 110, 0)
    scenario(folder, "collides", init=crash, stop=1.0)
    arguments = (
        folder,
        "--labels",
        "rules",
        "--quiet",
        "--jobs",
        1,
        "--rounds",
        1,
        "--method",
        "draws",
    )
    answer = command("xosc-loop", *arguments, "--out", tmp_path / "first")
    assert (answer.code, answer.err) == (0, ""), "what fails is what a loop is to find"
    foreign = (
        '<ScenarioObject name="Ego"><ExternalObjectReference '
        'name="library/object"/></ScenarioObject>'
    )
    scenario(folder, "foreign", entities=[foreign, car("Lead")])
    distribution(folder, "gaps", {"Gap": (50, 60, 10)}, of="foreign")
    answer = command("xosc-loop", *arguments, "--out", tmp_path / "second")
    assert answer.code == 1
    *told, last = answer.err.splitlines()
    assert last.startswith("xosc-loop: exit code 1: ")
    told = [line for line in told if "ExternalObjectReference" in line]
    assert [line.split(": ")[1] for line in told] == ["gaps", "foreign.xosc", "gaps.xosc"]
    assert told[2].endswith("(and 1 more run with errors)")


def test_scenarios_alone_are_enough(tmp_path: Path) -> None:
    scenario(tmp_path, stop=1.0)
    assert Inputs.of(tmp_path).recordings == []


def test_recordings_that_cannot_be_read_are_listed_and_the_rest_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "mine", tmp_path / "out"
    write_motorway(folder / "cut")
    tracks = folder / "cut" / "01_tracks.csv"
    tracks.write_bytes(tracks.read_bytes()[:3000])
    (folder / "notes.csv").write_bytes(b"\xff\xfe\x00")
    (folder / "half.tar.xz").write_bytes(b"\xfd7zXZ\0")
    scenario(folder, stop=0.2)
    monkeypatch.setattr(
        "sys.argv", ["xosc-loop", str(folder), "--out", str(out), "--labels", "rules", "--quiet"]
    )
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 1
    told = capsys.readouterr().err.splitlines()
    reasons = {
        "cut/01": "values in a table",
        "half.tar.xz": "no tar archive",
        "notes.csv": "not UTF-8 text",
    }
    last = told.pop()
    assert last.startswith("xosc-loop: exit code 1: cut/01: ")
    assert last.endswith("; 2 more, see above")
    for line, (name, reason) in zip(told, reasons.items(), strict=True):
        assert line.startswith(f"xosc-loop: {name}: ")
        assert reason in line
    page = (out / "index.html").read_text(encoding="utf-8")
    assert all(f"/{name}" in page for name in ("notes.csv:1", "half.tar.xz", "01_tracks.csv:"))
    assert (out / "scenarios" / "scenario" / "replay.html").is_file()


def test_a_folder_with_neither_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(InvalidFile, match=r"no recording of a known format .*, and no scenario"):
        Inputs.of(tmp_path)


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a folder is expected"):
        Inputs.of(scenario(tmp_path, stop=1.0))


def test_the_output_may_not_be_among_the_recordings(tmp_path: Path) -> None:
    scenario(tmp_path, stop=1.0)
    with pytest.raises(UsageError, match="inside the folder"):
        run_loop(
            tmp_path,
            tmp_path / "out",
            LoopSettings(),
            lambda *_: progress_bar("", 0, quiet=True),
            lambda *_: None,
        )


def test_recordings_are_told_apart_by_their_content(tmp_path: Path) -> None:
    write_motorway(tmp_path / "recordings")
    before = Inputs.of(tmp_path).recorded
    shutil.copy(SCENARIOS / "simple_cut_in.xosc", tmp_path)
    assert Inputs.of(tmp_path).recorded == before
    table = tmp_path / "recordings" / "01_tracks.csv"
    table.write_bytes(table.read_bytes().replace(b"1", b"2", 1))
    assert Inputs.of(tmp_path).recorded != before


def test_scenarios_are_told_apart_by_their_content_and_that_of_their_roads(tmp_path: Path) -> None:
    standard.export(SCENARIOS / "simple_cut_in.xosc", "1.3", Folder(tmp_path))
    names = [Inputs.of(tmp_path).played(RunSettings())]
    for pattern in ("*.xodr", "simple_cut_in.xosc"):
        (file,) = tmp_path.rglob(pattern)
        file.write_text(file.read_text(encoding="utf-8") + "<!-- changed -->", encoding="utf-8")
        names.append(Inputs.of(tmp_path).played(RunSettings()))
    (file,) = tmp_path.rglob("*.xodr")
    file.unlink()
    names.append(Inputs.of(tmp_path).played(RunSettings()))
    assert len(set(names)) == 4


def test_scenarios_of_the_same_name_have_names_of_their_own(tmp_path: Path) -> None:
    for folder in ("a", "b/c"):
        (tmp_path / folder).mkdir(parents=True)
        shutil.copy(SCENARIOS / "simple_cut_in.xosc", tmp_path / folder / "mine.xosc")
    shutil.copy(SCENARIOS / "simple_cut_in.xosc", tmp_path / "other.xosc")
    assert sorted(Inputs.of(tmp_path).names.values()) == ["a_mine", "b_c_mine", "other"]
    shutil.copy(SCENARIOS / "simple_cut_in.xosc", tmp_path / "a_mine.xosc")
    found = Inputs.of(tmp_path).names
    assert sorted(found.values()) == ["a_mine", "a_mine_2", "b_c_mine", "other"]
    assert distinct(found, ["other", "other_2"])[tmp_path / "other.xosc"] == "other_3"
