"""What other repositories are offered for their CI: hooks and workflow parse, and their commands do what they say."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from lxml import etree

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[1]
HOOKS = {hook["id"]: hook for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())}
STEPS = {
    step["name"]: step["run"]
    for step in yaml.safe_load((ROOT / "docs" / "ci" / "scenarios.yml").read_text())["jobs"][
        "scenarios"
    ]["steps"]
    if "run" in step
}
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Somebody's scenarios under git: one of the library with its road and catalogue, laid out in their way."""
    folder = tmp_path / "repository"
    library = ROOT / "xosc" / "library"
    shutil.copytree(library / "catalogs", folder / "catalogs")
    shutil.copytree(ROOT / "xodr" / "library", folder / "roads")
    text = (library / "simple_cut_in.xosc").read_text().replace("../../xodr/library/", "roads/")
    (folder / "cut in.xosc").write_text(text)
    subprocess.run("git init -q . && git add .", shell=True, cwd=folder, check=True)
    return folder


def call(command: str | list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command line (in a shell, where it is a text) with this environment's commands on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    shell = isinstance(command, str)
    arguments = ["bash", "-e", "-c", command] if shell else command
    return subprocess.run(
        arguments, cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True
    )


def hooked(hook: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Call a hook as pre-commit does: its entry, and the tracked files that it is for."""
    named = subprocess.run(
        ["git", "ls-files", "-z"], cwd=folder, capture_output=True, text=True, check=True
    ).stdout.split("\0")
    chosen = [name for name in named if name and re.search(HOOKS[hook]["files"], name)]
    left = HOOKS[hook].get("exclude", "^$")
    return call(
        [
            *shlex.split(HOOKS[hook]["entry"]),
            *(name for name in chosen if not re.search(left, name)),
        ],
        folder,
    )


def test_the_workflow_installs_one_version_that_needs_no_package_index_to_have_this_project() -> (
    None
):
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    workflow = yaml.safe_load((ROOT / "docs" / "ci" / "scenarios.yml").read_text())
    assert workflow["env"]["XOSC_TOOLCHAIN"].endswith(f"/xosc_toolchain-{version}-py3-none-any.whl")
    assert STEPS["install"] == 'pip install "$XOSC_TOOLCHAIN"'
    setup = next(
        step
        for step in workflow["jobs"]["scenarios"]["steps"]
        if "setup-python" in step.get("uses", "")
    )
    assert setup["with"]["cache"] == "pip"


def test_hooks_and_steps_call_commands_that_there_are() -> None:
    assert {shlex.split(hook["entry"])[0] for hook in HOOKS.values()} <= SCRIPTS.keys()
    assert set(re.findall(r"\bxosc-(?!toolchain)\w+", " ".join(STEPS.values()))) <= SCRIPTS.keys()
    assert all(
        hook["language"] == "system" and hook["name"] and hook["files"] for hook in HOOKS.values()
    )


@pytest.mark.slow
@pytest.mark.parametrize("hook", HOOKS)
def test_a_hook_passes_sound_files(hook: str, repository: Path) -> None:
    answer = hooked(hook, repository)
    assert (answer.returncode, answer.stdout) == (0, ""), answer.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hook", "code"), [("xosc-check", 1), ("xosc-compile", 3), ("xosc-run", 3)]
)
def test_a_hook_refuses_a_broken_file(hook: str, code: int, repository: Path) -> None:
    path = repository / "cut in.xosc"
    path.write_text(
        path.read_text().replace('entityRef="CutIn" relative', 'entityRef="Nobody" relative')
    )
    answer = hooked(hook, repository)
    assert answer.returncode == code
    assert "cut in.xosc:" in answer.stdout + answer.stderr


def test_the_summary_of_a_workflow_that_has_run_nothing_is_empty(tmp_path: Path) -> None:
    answer = call(STEPS["summary"], tmp_path)
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")


@pytest.mark.slow
def test_the_workflow_annotates_what_is_wrong_and_reports_the_runs(repository: Path) -> None:
    assert call(STEPS["check"], repository).returncode == 0
    assert (
        json.loads((repository / "reports" / "check.sarif").read_text())["runs"][0]["results"] == []
    )
    answer = call(STEPS["run"], repository)
    assert answer.returncode == 0, answer.stderr
    (suite,) = etree.parse(repository / "reports" / "runs.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("1", "0", "0")
    assert (repository / "reports" / "runs" / "cut_in" / "result.json").is_file()
    summary = repository / "summary.md"
    assert (
        call(f"export GITHUB_STEP_SUMMARY={summary}\n{STEPS['summary']}", repository).returncode
        == 0
    )
    assert [line.split(" | ")[:2] for line in summary.read_text().splitlines()[2:]] == [
        ["| cut_in", "passed"]
    ]
    path = repository / "cut in.xosc"
    path.write_text(path.read_text().replace("<Story ", '<Story color="red" '))
    assert call(STEPS["check"], repository).returncode == 1
    (result, *_) = json.loads((repository / "reports" / "check.sarif").read_text())["runs"][0][
        "results"
    ]
    place = result["locations"][0]["physicalLocation"]
    line = next(
        number for number, text in enumerate(path.read_text().splitlines(), 1) if "<Story " in text
    )
    assert (place["artifactLocation"]["uri"], place["region"]["startLine"]) == (
        "cut%20in.xosc",
        line,
    )
