"""One import and one command for everything: what they reach, and what they load."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import xosc_toolchain as xt
from tests.commands import SCRIPTS, Command
from xosc_toolchain import start
from xosc_toolchain.xosc import COMMANDS, SHELLS

ROOT = Path(__file__).parents[2]
CUT_IN = ROOT / "xosc" / "library" / "simple_cut_in.xosc"


def test_every_name_is_there() -> None:
    assert {name for name in dir(xt) if not name.startswith("__")} == set(xt.__all__)
    for name in xt.__all__:
        assert getattr(xt, name) is not None, name
    with pytest.raises(AttributeError, match="'xosc_toolchain' has no attribute 'absent'"):
        xt.absent  # type: ignore[attr-defined]


def test_the_import_loads_nothing_but_itself() -> None:
    code = (
        "import sys, xosc_toolchain; print(sorted({'numpy', 'lxml', 'typer', 'runner', 'xosc', "
        "'libsumo'} & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert found.stdout.strip() == "[]"


def test_modules_of_the_same_names_do_not_matter(tmp_path: Path) -> None:
    """A user's own `scenario.py` beside `import xosc_toolchain as xt`; names of the package are
    reached through it alone.
    """
    (tmp_path / "program.py").write_text(
        f"import xosc_toolchain as xt\nresult = xt.run({str(CUT_IN)!r}, sut='adas', "
        "world='kinematic')\nprint(result.verdict)\n"
    )
    found = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "passed"


def test_the_umbrella_has_all_commands(command: Command) -> None:
    assert {"xosc", *(f"xosc-{name}" for name in COMMANDS)} == set(SCRIPTS)
    installed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "scripts"
    ]
    assert installed == {name: f"xosc_toolchain.start:{name.replace('-', '_')}" for name in SCRIPTS}
    assert all(getattr(start, name.replace("-", "_")).args == (name,) for name in SCRIPTS)
    answer = command("xosc", "--help")
    assert answer.code == 0
    assert all(f"\n  {name} " in answer.out for name in (*COMMANDS, "completion"))
    assert command("xosc", "flatten").code == 2


def test_a_command_of_the_umbrella_is_the_command(command: Command) -> None:
    assert command("xosc", "run", "--world", "kinematic", CUT_IN) == command(
        "xosc-run", "--world", "kinematic", CUT_IN
    )
    assert "xosc run [OPTIONS]" in command("xosc", "run", "--help").out
    assert (
        command("xosc", "check", "absent.xosc").code
        == command("xosc-check", "absent.xosc").code
        == 3
    )


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_completes_every_command(command: Command, shell: str) -> None:
    answer = command("xosc", "completion", shell)
    assert answer.code == 0
    assert all(f"_{name}_COMPLETE".replace("-", "_").upper() in answer.out for name in SCRIPTS)


def test_an_unknown_shell_is_refused(command: Command) -> None:
    answer = command("xosc", "completion", "tcsh")
    assert (answer.code, answer.err) == (
        2,
        "xosc: the shell 'tcsh' is not one of bash, zsh, fish, powershell\n",
    )


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("xosc-run --su", ["--sut", "--sut-timeout", "--sut-in-process"]),
        ("xosc r", ["recognize", "replay", "road", "run"]),
        ("xosc-run simple_cut_in -p CutIn_G", ["CutIn_Gap_m=25"]),
        ("xosc-run absent -p CutIn_G", []),
        ("xosc-run simple_cut_in_v", ["simple_cut_in_variation"]),
        ("xosc run --sut ad", ["adas"]),
        ("xosc-run --fail-if min_t", ["min_ttc", "min_thw"]),
        ("xosc-export --to o", ["openlabel", "osi"]),
        ("xosc-list --class 'highway cut i", ["highway cut in"]),
        ("xosc-generate --method dr", ["draws"]),
        ("xosc-generate --density unif", ["uniform"]),
        ("xosc-loop --kind cut_", ["cut_in", "cut_out"]),
        ("xosc-road info rounda", ["roundabout"]),
    ],
)
def test_words_are_completed(words: str, expected: list[str]) -> None:
    closed = words + "'" * (words.count("'") % 2)
    name = words.partition(" ")[0]
    variable = f"_{name}_COMPLETE".replace("-", "_").upper()
    environment = {
        **os.environ,
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(shlex.split(closed)) - 1),
        variable: "complete_bash",
    }
    code = f"import sys; sys.argv = [{name!r}]; from {SCRIPTS[name]} import main; main()"
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert found.stdout.strip().splitlines() == expected


# help ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(set(SCRIPTS) - {"xosc", "xosc-recognize", "xosc-road"}))
def test_help_has_groups_and_examples_that_parse(command: Command, name: str) -> None:
    text = command(name, "--help").out
    assert "\nOutput:\n" in text and "\nExamples:\n" in text.replace("\n  Examples:", "\nExamples:")
    examples = [
        line.strip()
        for line in text.splitlines()
        if line.strip().startswith(f"{name} ") and "Usage" not in line
    ]
    assert examples


@pytest.mark.parametrize("name", ["xosc-run", "xosc-export", "xosc-generate", "xosc-loop"])
def test_help_lists_all_systems(command: Command, name: str) -> None:
    brief = command(name, "--help").out.partition("Systems under test:")[2].partition("\n\n")[0]
    assert set(xt.systems()) <= set(brief.replace(",", " ").split())
    text = command(name, "--help-all").out.partition("Systems under test:")[2]
    assert all(f"\n  {system} " in text for system in xt.systems())
    assert {"adas", "cas", "none", "module:Class"} <= set(xt.systems())
