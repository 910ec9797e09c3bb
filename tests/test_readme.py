"""What the README says can be typed can be typed."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.runner.files import scenario

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
SCRIPTS = [
    [line.split(" #")[0].strip() for line in block.splitlines() if line.strip()] for language, block in BLOCKS if not language
]
COMMANDS = [command for script in SCRIPTS for command in script]
PROGRAMS = [block for language, block in BLOCKS if language == "python"]
NOT_RUN = [command for command in COMMANDS if command.startswith("make ")]
"""They install; that their targets are there is checked below, and continuous integration runs what they consist of."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with what a user has after a checkout, whose results go nowhere else, and a scenario of one's own."""
    for package in ("xosc", "xodr"):
        shutil.copytree(ROOT / package / "library", tmp_path / package / "library")
    scenario(tmp_path, stop=0.5).rename(tmp_path / "scenario.xosc")
    return tmp_path


def executed(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    return subprocess.run(arguments, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script[0])
def test_commands_of_a_block_do_their_work_one_after_the_other(folder: Path, script: list[str]) -> None:
    for command in script:
        if command not in NOT_RUN:
            done = executed(["bash", "-c", command], folder)
            verdicts = {0, 1} if command.startswith("xosc-run") else {0}
            assert done.returncode in verdicts, f"{command}: {done.stderr}"


@pytest.mark.parametrize("command", NOT_RUN)
def test_command_that_installs_is_a_target_of_the_makefile(command: str) -> None:
    planned = subprocess.run(["make", "--dry-run", *command.split()[1:]], cwd=ROOT, capture_output=True, text=True)
    assert planned.returncode == 0, planned.stderr


@pytest.mark.parametrize("program", PROGRAMS)
def test_program_runs(folder: Path, program: str) -> None:
    done = executed([sys.executable, "-c", program], folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_every_command_of_the_package_is_shown() -> None:
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    built = {name for name, target in scripts.items() if importlib.util.find_spec(target.partition(":")[0])}
    assert {command.split()[0] for command in COMMANDS} >= built


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!https?:)([^)#]+)\)", TEXT))))
def test_linked_file_is_there(target: str) -> None:
    assert (ROOT / target).is_file()


@pytest.mark.parametrize("name", ["XOSC_SCHEMA_DIR", "XOSC_CACHE_DIR"])
def test_environment_variables_are_those_of_the_code(name: str) -> None:
    assert f"`{name}`" in TEXT
    assert any(
        f'"{name}"' in path.read_text(encoding="utf-8") for path in [*ROOT.glob("schemas/*.py"), *ROOT.glob("xodr/**/*.py")]
    )
