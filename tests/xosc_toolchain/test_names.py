"""Shipped scenarios are found by name, and new ones, variations and projects begin as them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import xosc_toolchain as xt
from schemas.common.errors import UsageError
from schemas.common.terminal.files import expand
from tests.commands import Command

ROOT = Path(__file__).parents[2]
LIBRARY = ROOT / "xosc" / "library"
NAME = "highway_lead_brake"
SHORT = ("--world", "kinematic", "--max-time", "1", "--allow-inconclusive", "--sut", "none")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder without a clone."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_commands_take_the_name_of_a_shipped_scenario(folder: Path, command: Command) -> None:
    assert NAME in command("xosc-run", NAME, *SHORT).out
    assert command("xosc-check", NAME).out.startswith("1 file checked, 1 accepted")
    assert command("xosc-list", NAME).out.splitlines()[1].split()[0] == NAME
    assert command("xosc-export", NAME, "--to", "1.3", "--out", "exported").code == 0
    assert (folder / "exported" / f"{NAME}.xosc").is_file()
    assert xt.run(NAME, world="kinematic", max_time=0.1, sut="none").scenario.stem == NAME


@pytest.mark.parametrize(
    "arguments",
    [
        ("xosc-run",),
        ("xosc-check",),
        ("xosc-list",),
        ("xosc-export", "--to", "1.3", "--out", "out"),
        ("xosc-generate", "--out", "out"),
    ],
)
def test_misspelt_names_get_a_suggestion(arguments: tuple[str, ...], command: Command) -> None:
    name, *options = arguments
    answer = command(name, "highway_lead_brak", *options)
    assert answer.code == 3
    assert (
        "highway_lead_brak: neither a file nor the name of a shipped scenario; "
        f"did you mean '{NAME}'?"
    ) in answer.err


def test_a_file_of_the_folder_comes_first_with_a_remark(folder: Path, command: Command) -> None:
    (folder / f"{NAME}.xosc").write_text("<none/>")
    answer = command("xosc-check", NAME)
    assert answer.code == 1
    assert f"remark: {NAME}.xosc of this folder counts" in answer.err
    assert command("xosc-check", f"{NAME}.xosc").err == ""
    assert command("xosc-check", "missing.xosc").code == 3


def test_names_are_shipped_files_under_untrusted_too(command: Command) -> None:
    assert command("xosc-run", NAME, *SHORT, "--untrusted").code == 0


def test_copies_of_shipped_scenarios_run(folder: Path, command: Command) -> None:
    answer = command("xosc-list", NAME, "roundabout_entering", "--copy-to", "mine")
    assert (answer.code, answer.err) == (0, "8 files copied to mine\n")
    assert command("xosc-check", "mine").out.startswith("8 files checked, 8 accepted")
    (folder / "mine" / "xosc" / "library" / f"{NAME}.xosc").write_text("other")
    assert command("xosc-list", NAME, "--copy-to", "mine").code == 2
    assert command("xosc-list", NAME, "--copy-to", "mine", "--overwrite").code == 0


@pytest.mark.parametrize(
    ("text", "code", "told"),
    [
        ((LIBRARY / f"{NAME}.xosc").read_text(), 1, "stdin.xosc:"),
        ((ROOT / "xodr/library/highway_straight.xodr").read_text(), 0,
            "1 file checked, 1 accepted"),
        ("", 1, "stdin.xosc:1: error"),
        ("no xml", 1, "stdin.xosc:1: error: not well-formed"),
    ],
    ids=["scenario", "road", "empty", "text"],
)  # fmt: skip
def test_a_pipe_is_checked(
    text: str, code: int, told: str, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    import io

    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    answer = command("xosc-check", "-")
    assert answer.code == code
    assert told in answer.out


def test_a_pipe_is_no_file_to_play(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"<OpenSCENARIO/>")))
    assert "standard input is none" in command("xosc-check", "-", "--triage").err


def test_a_new_project_runs_where_it_is(
    folder: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert command("xosc", "new", "project", "mine").code == 0
    monkeypatch.chdir(folder / "mine")
    assert command("xosc-check", ".").out.startswith("4 files checked, 4 accepted")
    assert command("xosc-run", "scenarios", "--dry-run").code == 0
    monkeypatch.chdir(folder)
    assert "already" in command("xosc", "new", "project", "mine").err


def test_new_scenarios_begin_as_shipped_ones(folder: Path, command: Command) -> None:
    made = command("xosc", "new", "scenario", "mine", "--like", "cut_in_highway").out.splitlines()
    assert made[0] == "mine.xosc"
    shutil.rmtree(folder / "exported", ignore_errors=True)
    assert command("xosc", "new", "variation", "sets").out.splitlines()[0] == "sets.xosc"
    assert command("xosc-check", ".").code == 0
    assert sum(1 for _ in xt.variations("sets.xosc")) == 8
    assert command("xosc", "new", "scenario", "mine").code == 2
    assert command("xosc", "new", "scenario", "../mine").code == 2
    assert (
        "did you mean 'cut_in_highway'?"
        in command("xosc", "new", "scenario", "x", "--like", "cut_in_higway").err
    )


def test_commands_take_the_name_of_a_shipped_road(folder: Path, command: Command) -> None:
    assert command("xosc-road", "info", "sharp_curve").code == 0
    assert command("xosc-road", "compare", "roundabout", "roundabout").code == 0
    answer = command("xosc-road", "info", "sharp_curv")
    assert answer.code == 3
    told = "neither a file nor the name of a shipped road; did you mean 'sharp_curve'?"
    assert told in answer.err
    (folder / "sharp_curve").write_text("mine")
    assert command("xosc-road", "info", "sharp_curve").code != 0, "a file comes first"


def test_a_misspelt_argument_of_run_gets_a_suggestion() -> None:
    with pytest.raises(xt.ToolchainError, match="did you mean 'parameters'"):
        xt.run(NAME, paramters={"Lead_Headway_s": 1})  # type: ignore[call-arg]


@pytest.mark.parametrize(
    "path", ["xosc/library/simple_cut_in.xosc", "xosc/library", "xosc/library/cut_in_*.xosc"]
)
def test_paths_of_documents_stand_for_shipped_files_without_a_clone(
    path: str, folder: Path
) -> None:
    beneath = path.removeprefix("xosc/library").lstrip("/")
    assert expand([path]) == expand([str(LIBRARY / beneath)]) != []
    own = folder / "xosc" / "library" / "simple_cut_in.xosc"
    own.parent.mkdir(parents=True)
    with pytest.raises(UsageError, match="stands for no"):
        expand(["xosc/library"])  # a folder of the user's comes first
    own.touch()
    assert expand(["xosc/library"]) == [own.relative_to(folder)]
