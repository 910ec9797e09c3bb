"""What all commands, and the further commands that some of them have, answer alike."""

from __future__ import annotations

from importlib import import_module

import pytest

from schemas.version import version
from tests.commands import SCRIPTS, Command

NAMES = [
    [name, *further]
    for name, target in SCRIPTS.items()
    for further in ([], *([one] for one in getattr(import_module(target.partition(":")[0]), "COMMANDS", ())))
]


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


@pytest.mark.parametrize("further", ["train", "evaluate"])
def test_verbose_adds_the_traceback_of_an_error(command: Command, tmp_path: object, further: str) -> None:
    call = ["xosc-recognize", further, f"{tmp_path}/absent", "--out", f"{tmp_path}/out"]
    bare, more = command(*call), command(*call, "-v")
    assert bare.code == more.code != 0
    assert bare.err.count("\n") == 1
    assert more.err.startswith("Traceback") and more.err.endswith(bare.err)
