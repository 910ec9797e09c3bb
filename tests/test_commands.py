"""What all commands, and the further commands that some of them have, answer alike."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.packages import version
from tests.commands import SCRIPTS, Command

NAMES = [*([name] for name in SCRIPTS), *(["xosc-recognize", each] for each in ("catalogue", "label", "record", "train"))]


@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_tells_its_version(command: Command, name: list[str]) -> None:
    assert command(*name, "--version") == (0, f"{' '.join(name)} {version()}\n", "")


@pytest.mark.parametrize("verbose", ["-v", "--verbose"])
@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_has_help_and_can_be_verbose(command: Command, name: list[str], verbose: str) -> None:
    answer = command(*name, verbose, "--help")
    assert (answer.code, answer.err) == (0, "")
    assert all(option in answer.out for option in ("-v, --verbose", "--version", "--help"))


@pytest.mark.parametrize("name", NAMES, ids=" ".join)
def test_every_command_refuses_what_it_does_not_know(command: Command, name: list[str]) -> None:
    answer = command(*name, "--bogus")
    assert (answer.code, answer.out) == (2, "")
    assert "--bogus" in answer.err


@pytest.mark.parametrize("further", ["train", "label"])
def test_verbose_adds_the_traceback_of_an_error(command: Command, tmp_path: Path, further: str) -> None:
    call = ["xosc-recognize", further, f"{tmp_path}/absent", *(["--out", f"{tmp_path}/out"] if further == "train" else [])]
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
    assert answer == (2, "", f"{call[0]}: {tmp_path}/file: a folder to write into is expected, this is a file\n")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
