"""What all commands, and the further commands that some of them have, answer alike."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from schemas.common.errors import exit_codes
from schemas.common.packages import version
from schemas.common.storage import DRAFT
from tests.commands import SCRIPTS, Command, load
from tests.runner.files import scenario
from xosc.listing import LIBRARY

NAMES = [
    *([name] for name in SCRIPTS),
    *(["xosc-recognize", each] for each in ("catalogue", "label", "record", "train")),
]


@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_tells_its_version(command: Command, name: list[str]) -> None:
    assert command(*name, "--version") == (0, f"{' '.join(name)} {version()}\n", "")


@pytest.mark.parametrize("verbose", ["-v", "--verbose"])
@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_has_help_and_can_be_verbose(
    command: Command, name: list[str], verbose: str
) -> None:
    answer = command(*name, verbose, "--help-all")
    assert (answer.code, answer.err) == (0, "")
    assert all(option in answer.out for option in ("-v, --verbose", "--version", "--help"))


def subcommands() -> list[list[str]]:
    """All commands, with those of groups."""
    groups = {name: typer.main.get_command(load(name).app) for name in SCRIPTS}
    further = (
        [name, each, *inner]
        for name, group in groups.items()
        for each, one in getattr(group, "commands", {}).items()
        for inner in ([], *([key] for key in getattr(one, "commands", {})))
    )
    return [[name] for name in SCRIPTS] + list(further)


HELP_LINES, HELP_COLUMNS = 60, 80


@pytest.mark.parametrize("name", subcommands(), ids=" ".join)
def test_help_is_short_and_names_every_option(command: Command, name: list[str]) -> None:
    brief, full = (command(*name, option).out for option in ("--help", "--help-all"))
    assert len(brief.splitlines()) <= HELP_LINES
    assert "..." not in brief.partition("Commands:")[2].partition("\n\n")[0]
    prose = brief.partition("\n\n")[2].partition("  Examples:")[0].splitlines()
    assert max(map(len, prose)) <= HELP_COLUMNS
    options = r"(?<=[ /])--[a-z][\w-]+"
    own = re.findall(r"^ +(?:-\w, )?(--[a-z][\w-]+)", full, re.MULTILINE)
    assert set(own) <= set(re.findall(options, brief))


@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_refuses_what_it_does_not_know(command: Command, name: list[str]) -> None:
    answer = command(*name, "--bogus")
    assert (answer.code, answer.out) == (2, "")
    assert "--bogus" in answer.err


@pytest.mark.parametrize("further", ["train", "label"])
def test_verbose_adds_the_traceback_of_an_error(
    command: Command, tmp_path: Path, further: str
) -> None:
    call = [
        "xosc-recognize",
        further,
        f"{tmp_path}/absent",
        *(["--out", f"{tmp_path}/out"] if further == "train" else []),
    ]
    bare, more = command(*call), command(*call, "-v")
    assert bare.code == more.code != 0
    assert bare.err.count("\n") == 1
    assert more.err.startswith("Traceback") and more.err.endswith(bare.err)


@pytest.mark.parametrize("inside", ["", "/in/it"])
@pytest.mark.parametrize(
    "call",
    [
        ["xosc-run", "a.xosc", "--out"],
        ["xosc-export", "a.xosc", "--to", "1.1", "--out"],
        ["xosc-generate", "a.xosc", "--out"],
        ["xosc-loop", "recordings", "--out"],
        ["xosc-recognize", "recordings", "--out"],
        ["xosc-recognize", "recordings", "--out", "new", "--keep-model"],
        ["xosc-recognize", "record"],
        ["xosc-recognize", "train", "recordings", "--out"],
    ],
    ids=" ".join,
)
def test_a_file_in_the_way_of_an_output_folder_is_named_in_one_line(
    command: Command, tmp_path: Path, call: list[str], inside: str
) -> None:
    (tmp_path / "file").write_text("mine")
    answer = command(*call, f"{tmp_path}/file{inside}")
    assert answer == (
        2,
        "",
        f"{call[0]}: {tmp_path}/file: a folder to write into is expected, this is a file\n",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


ABSENT = [
    ["xosc", "run", "absent.xosc"],
    ["xosc-run", "absent.xosc"],
    ["xosc-check", "absent.xosc"],
    ["xosc-list", "absent.xosc"],
    ["xosc-export", "absent.xosc", "--to", "esmini", "--out", "out"],
    ["xosc-export", "absent.xosc", "--to", "osi", "--out", "out"],
    ["xosc-replay", "absent"],
    ["xosc-explore", "absent.xosc"],
    ["xosc-road", "info", "absent.xodr"],
    ["xosc-road", "convert", "absent.xodr", "--out", "map.osm"],
    ["xosc-generate", "absent.xosc", "--out", "out"],
    ["xosc-loop", "absent", "--out", "out"],
    ["xosc-recognize", "absent", "--out", "out"],
    ["xosc-recognize", "label", "absent"],
    ["xosc-recognize", "train", "absent", "--out", "out"],
]


def test_all_commands_are_asked_for_a_missing_file() -> None:
    assert {call[0] for call in ABSENT} == set(SCRIPTS)


@pytest.mark.parametrize("call", ABSENT, ids=" ".join)
def test_a_missing_file_has_one_exit_code(
    command: Command, call: list[str], tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = command(*call)
    assert answer.code == 3 and "absent" in answer.out + answer.err


BROKEN = """
class Broken:
    def reset(self, ego, timestep, seed): pass
    def control(self, observation, dt): raise ValueError("broken")
"""
RUNS = [
    ["xosc-run", "--world", "kinematic"],
    ["xosc-export", "--world", "kinematic", "--to", "parquet", "--out", "out"],
]
SEARCHES = [
    ["xosc-generate", "--budget", "2", "--free", "Gap=40..60", "--method", "draws", "--out", "out"],
    ["xosc-loop", "--labels", "rules", "--out", "out"],
]


@pytest.mark.parametrize(
    ("sut", "code"), [("broken_system:Broken", 5), ("bridge:wait=0.1", 5), ("unheard-of", 2)]
)
@pytest.mark.parametrize("call", RUNS, ids=" ".join)
def test_a_system_that_fails_has_one_exit_code(
    command: Command, call: list[str], sut: str, code: int, tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "broken_system.py").write_text(BROKEN)
    monkeypatch.chdir(tmp_path)
    assert command(*call, LIBRARY / "simple_cut_in.xosc", "--sut", sut).code == code


@pytest.mark.parametrize(("sut", "code"), [("broken_system:Broken", 5), ("unheard-of", 2)])
@pytest.mark.parametrize("call", SEARCHES, ids=" ".join)
def test_a_system_that_fails_in_every_run_of_a_search_has_the_same_exit_code(
    command: Command, call: list[str], sut: str, code: int, tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "broken_system.py").write_text(BROKEN)
    path = scenario(tmp_path / "mine", stop=1.0)
    monkeypatch.chdir(tmp_path)
    answer = command(
        *call, path if call[0] == "xosc-generate" else path.parent, "--sut", sut, "--quiet"
    )
    assert answer.code == code
    assert code == 2 or "broken_system.py:4" in answer.err


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_help_of_every_command_has_the_exit_codes(command: Command, name: str) -> None:
    told = " ".join(command(name, "--help").out.split())
    shared = exit_codes("", "").partition(", ")[2].partition(". With")[0]
    assert "Exit codes: 0 " in told and shared in told


# standard streams that are closed, full, or no longer read --------------------------------------

CUT_IN = str(LIBRARY / "simple_cut_in.xosc")
ROADS = LIBRARY.parents[1] / "xodr" / "library"
CALLS: dict[str, tuple[list[str], int]] = {
    "xosc": (["check", CUT_IN], 0),
    "xosc-list": ([CUT_IN], 0),
    "xosc-check": ([CUT_IN], 0),
    "xosc-run": ([CUT_IN, "--world", "kinematic"], 0),
    "xosc-export": ([CUT_IN, "--to", "1.3", "--out", "exported"], 0),
    "xosc-replay": (["absent"], 3),
    "xosc-road": (["info", str(ROADS / "sharp_curve.xodr")], 0),
    "xosc-recognize": (["--bogus"], 2),
    "xosc-generate": (["--bogus"], 2),
    "xosc-loop": (["--bogus"], 2),
    "xosc-explore": (["absent"], 3),
}
"""A quick call of each command, and its exit code"""
assert CALLS.keys() == SCRIPTS.keys()


def in_shell(
    name: str, arguments: list[str], streams: str, folder: Path
) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, with its streams as a shell redirects them."""
    program = Path(sys.executable).with_name(name)
    script = f'"$0" "$@" {streams}'
    return subprocess.run(
        ["bash", "-c", script, program, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_closed_streams_change_no_exit_code(name: str, tmp_path: Path) -> None:
    arguments, code = CALLS[name]
    assert in_shell(name, arguments, ">&- 2>&-", tmp_path).returncode == code


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_a_message_that_cannot_be_written_changes_no_exit_code(name: str, tmp_path: Path) -> None:
    arguments, code = CALLS[name]
    assert in_shell(name, arguments, "2>/dev/full", tmp_path).returncode == code


@pytest.mark.parametrize("name", CALLS)
def test_output_that_cannot_be_written_is_one_line_and_exit_code_2(
    name: str, tmp_path: Path
) -> None:
    answer = in_shell(name, ["--help"], ">/dev/full", tmp_path)
    assert (answer.returncode, answer.stderr) == (2, f"{name}: No space left on device\n")


@pytest.mark.parametrize("name", CALLS)
def test_output_that_is_no_longer_read_is_exit_code_141(name: str, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    program = Path(sys.executable).with_name(name)
    answer = subprocess.run(
        [program, "--help"], cwd=tmp_path, stdout=writing, stderr=subprocess.PIPE, timeout=120
    )
    os.close(writing)
    assert (answer.returncode, answer.stderr) == (141, b"")


def test_a_draft_that_a_killed_command_has_left_is_no_scenario(
    command: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stop=0.1)
    path.with_name(f"{DRAFT}0123abcd.xosc").write_text("<OpenSCE")
    answer = command("xosc-check", tmp_path)
    assert (answer.code, answer.out.splitlines()[-1].partition(",")[0]) == (0, "2 files checked")
