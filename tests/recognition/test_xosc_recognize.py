"""The command `xosc-recognize`: options, exit codes, what goes to standard
output and standard error.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from recognition import xosc_recognize
from runner.batch.batch import execute
from runner.batch.jobs import Job
from runner.judging.settings import RunSettings
from schemas.common.packages import version
from tests.recognition import motorway
from tests.recognition.traffic import Car, write_highd


class Answer(NamedTuple):
    code: int
    out: str
    err: str


Command = Callable[..., Answer]


@pytest.fixture
def recognize(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command in this process."""

    def call(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["xosc-recognize", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            xosc_recognize.main()
        return Answer(int(end.value.code or 0), *capsys.readouterr())

    return call


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    motorway.write_motorway(folder)
    return folder


def test_recordings_become_a_catalogue(
    recognize: Command, recordings: Path, tmp_path: Path
) -> None:
    answer = recognize(recordings, "--out", tmp_path, "--labels", "rules")
    assert answer.code == 0
    # The field ends before some vehicles' scenes do.
    assert answer.err.startswith("xosc-recognize: 2 replays have no verdict as recorded, ")
    _, *table, place = answer.out.splitlines()
    counts = {name: int(count) for count, name in (line.split(maxsplit=1) for line in table)}
    assert place == f"catalogue: {tmp_path}"
    told = json.loads((tmp_path / "index.json").read_text())["scenarios"]
    assert counts["highway cut in"] == sum(row["class"] == "highway cut in" for row in told) == 2


def test_options_may_come_first(recognize: Command, recordings: Path, tmp_path: Path) -> None:
    answer = recognize(
        "--scenes", "vehicles", "-q", "--labels", "rules", "--out", tmp_path, recordings
    )
    assert answer == (0, "", "")
    assert len(list((tmp_path / "vehicles").glob("*.xosc"))) == 6


def test_a_folder_may_have_the_name_of_a_command(
    recognize: Command, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "train").symlink_to(recordings)
    for number, folder in enumerate((["catalogue", "train"], ["./train"], ["-q", "train"])):
        assert recognize(*folder, "--out", f"out{number}", "--labels", "rules").code == 0
        assert (tmp_path / f"out{number}" / "index.json").read_bytes() == (
            tmp_path / "out0" / "index.json"
        ).read_bytes()


def test_verbose_tells_why_vehicles_have_no_scene(
    recognize: Command, recordings: Path, tmp_path: Path
) -> None:
    answer = recognize(
        recordings, "--out", tmp_path, "--scenes", "vehicles", "--labels", "rules", "-v"
    )
    assert "1 vehicles are no ego of a scene\n" in answer.out
    assert "vehicle 7: moves within 2.0 m only" in answer.out
    assert "passages: 6 straight" in answer.out


def test_edited_files_are_reported(recognize: Command, recordings: Path, tmp_path: Path) -> None:
    recognize(recordings, "--out", tmp_path, "--labels", "rules", "-q")
    (tmp_path / "index.csv").write_text("mine")
    answer = recognize(recordings, "--out", tmp_path, "--labels", "rules", "-q")
    assert (answer.code, answer.out) == (0, "")
    assert (
        answer.err
        == "xosc-recognize: index.csv was edited since it was written, it is left as it is\n"
    )


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "Missing argument 'PATH...'"),
        (["--bogus"], "--bogus"),
        (["in"], "--out"),
        (["in", "--out", "out", "--scenes", "all"], "--scenes"),
        (["in", "--out", "out", "--standard", "2.0"], "--standard"),
        (
            ["in", "--out", "out", "--labels", "rules", "--model", "m"],
            "--model and --labels rules exclude each other",
        ),
        (
            ["in", "--out", "out", "--labels", "rules", "--keep-model", "m"],
            "--keep-model is for a model that labels",
        ),
        (["in", "--out", "out", "--model", "absent"], "absent: there is no model in this folder"),
        (["in", "--out", "/dev/null/out", "--labels", "rules"], "/dev/null"),
    ],
)
def test_2_wrong_usage(
    recognize: Command,
    recordings: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    complaint: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").symlink_to(recordings)
    answer = recognize(*arguments)
    assert answer.code == 2
    assert complaint in answer.err
    assert "Traceback" not in answer.err


def test_2_recordings_of_one_name(recognize: Command, tmp_path: Path) -> None:
    one, two = (motorway.write_motorway(tmp_path / folder / "site") for folder in ("a", "b"))
    answer = recognize(
        tmp_path / "a", tmp_path / "b", "--out", tmp_path / "out", "--labels", "rules"
    )
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert f"{two}: {one} has a recording called 'site/01' too" in answer.err
    assert recognize(tmp_path, "--out", tmp_path / "out", "--labels", "rules").code == 0


def test_nothing_recognised_is_said(recognize: Command, tmp_path: Path) -> None:
    write_highd(tmp_path / "in", [Car(1, 100.0, 21.0, 30.0)])
    answer = recognize(tmp_path / "in", "--out", tmp_path / "out", "--labels", "rules")
    assert answer == (0, "no scenario was recognised\n", "")


def test_5_internal_error(
    recognize: Command, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recognition.catalogue.pipeline.label", lambda *_: 1 // 0)
    answer = recognize(recordings, "--out", tmp_path, "--labels", "rules")
    assert answer.code == 5
    assert "Traceback" in answer.err
    assert answer.err.endswith(
        "xosc-recognize: internal error: ZeroDivisionError: integer division or modulo by zero\n"
    )


def test_3_no_recordings(recognize: Command, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    answer = recognize(tmp_path / "in", "--out", tmp_path / "out", "--labels", "rules")
    assert (answer.code, answer.err.count("\n")) == (3, 1)
    assert "no recording of a known format" in answer.err
    assert recognize(tmp_path / "absent", "--out", tmp_path / "out", "--labels", "rules").code == 3


def test_3_an_invalid_recording_among_others(recognize: Command, tmp_path: Path) -> None:
    motorway.write_motorway(tmp_path / "in", "01")
    bad = motorway.write_motorway(tmp_path / "in", "02")
    bad.write_text(bad.read_text().replace("30.0", "nan", 1))
    answer = recognize(tmp_path / "in", "--out", tmp_path / "out", "--labels", "rules")
    assert answer.code == 3
    assert "highway cut in" in answer.out
    assert (
        answer.err.startswith("xosc-recognize: ")
        and "02_tracks.csv:2: column xVelocity" in answer.err
    )


# commands -----------------------------------------------------------------------------------


def test_runs_are_labelled(recognize: Command, tmp_path: Path, recordings: Path) -> None:
    recognize(recordings, "--out", tmp_path / "in", "--labels", "rules", "-q")
    scenario = next((tmp_path / "in" / "highway_cut_in").glob("*1_0*_maneuver.xosc"))
    (tmp_path / "runs").mkdir()
    job = Job("run", scenario, scenario)
    assert (
        execute(job, RunSettings(sut="none", world="kinematic"), tmp_path / "runs").status
        == "completed"
    )
    answer = recognize("label", tmp_path / "runs", "--labels", "rules")
    assert (answer.code, answer.err) == (0, "")
    assert "run: highway cut in of Ego at " in answer.out and "written: " not in answer.out
    answer = recognize("label", tmp_path / "runs", "--labels", "rules", "--annotate")
    assert f"written: {scenario.with_name(f'{scenario.stem}_labelled.xosc')}" in answer.out


def test_label_needs_runs(recognize: Command, recordings: Path) -> None:
    answer = recognize("label", recordings, "--labels", "rules")
    assert (answer.code, answer.err.count("\n")) == (3, 1)
    assert "no results of xosc-run" in answer.err


def test_version(recognize: Command) -> None:
    assert recognize("--version") == (0, f"xosc-recognize {version()}\n", "")


def test_help_names_all_commands_and_loads_nothing_heavy() -> None:
    code = (
        "import sys; from recognition import xosc_recognize; sys.argv = "
        "['xosc-recognize', '--help']\n"
        "try: xosc_recognize.main()\n"
        "except SystemExit as end: print(end.code)\n"
        "print([name for name in ('torch', 'sklearn', 'numpy', 'matplotlib', 'libsumo', 'scipy') "
        "if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *text, ended, loaded = run.stdout.splitlines()
    assert (ended, loaded) == ("0", "[]")
    joined = " ".join(" ".join(text).split())
    assert all(f" {name} " in joined for name in ("catalogue", "label", "record", "train"))


def test_places_beside_the_given_road_are_told(recognize: Command, tmp_path: Path) -> None:
    rows = [
        f"{step / 10},{name},{x + 3.0 * step},{y},30"
        for step in range(60)
        for name, x, y in (("on", 10.0, -5.6), ("beside", 60.0, 9.0))
    ]
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "tracks.csv").write_text("\n".join(["t,id,x,y,speed", *rows]), "utf-8")
    (tmp_path / "own" / "columns.toml").write_text(
        '[columns]\ntrack = "id"\ntime = "t"\nx = "x"\ny = "y"\nspeed = "speed"\n'
        '[units]\ntime = "s"\nspeed = "m/s"\n',
        "utf-8",
    )
    call = (tmp_path / "own", "--labels", "rules", "--road", "highway_straight")
    answer = recognize(*call, "--out", tmp_path / "out")
    assert "50% of the vehicles' places are on a road of highway_straight.xodr" in answer.err
