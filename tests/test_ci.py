"""What other repositories are offered for their CI: hooks and workflow parse,
and their commands do what they say.
"""

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
ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"] if "run" in step}
WORKFLOW = yaml.safe_load((ROOT / "docs" / "ci" / "scenarios.yml").read_text(encoding="utf-8"))
CONTAINER = (ROOT / "Containerfile").read_text(encoding="utf-8")
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Somebody's scenarios under git: one of the library with its road and
    catalogue, laid out in their way.
    """
    folder = tmp_path / "repository"
    library = ROOT / "xosc" / "library"
    shutil.copytree(library / "catalogs", folder / "catalogs")
    shutil.copytree(ROOT / "xodr" / "library", folder / "roads")
    text = (library / "simple_cut_in.xosc").read_text().replace("../../xodr/library/", "roads/")
    (folder / "cut in.xosc").write_text(text)
    subprocess.run("git init -q . && git add .", shell=True, cwd=folder, check=True)
    return folder


def call(command: str | list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command line (in a shell, where it is a text) with this
    environment's commands on the path.
    """
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


def acted(folder: Path, **inputs: str) -> subprocess.CompletedProcess[str]:
    """Do the commands of the action in a folder, by this environment's commands."""
    given = {"bin": str(Path(sys.executable).parent), **inputs}
    pairs = [f"{name}={value}" for name, value in given.items()]
    return call([sys.executable, str(ROOT / ".ci" / "action"), str(folder), *pairs], folder)


def test_the_action_pins_others_reads_inputs_by_its_environment_and_needs_no_secret() -> None:
    text = (ROOT / "action.yml").read_text(encoding="utf-8")
    used = re.findall(r"uses: (\S+)", text)
    assert used
    assert all(re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", name) for name in used)
    assert "secrets." not in text
    assert "github.token" not in text
    for step in STEPS.values():
        assert step["shell"] == "bash"
        assert "${{" not in step["run"], "an expression in a script is code of whoever sets it"
    named = set(re.findall(r"inputs\.(\w+)", text))
    assert named == ACTION["inputs"].keys()
    assert all(about["description"] and "default" in about for about in ACTION["inputs"].values())


def test_the_action_installs_its_own_version_by_the_constraints() -> None:
    assert STEPS["install"]["env"]["PACKAGE"] == "${{ inputs.package || github.action_path }}"
    assert STEPS["install"]["env"]["CONSTRAINTS"].endswith("/constraints.txt")


def test_the_workflow_uses_the_released_action_with_inputs_that_it_has() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    (step,) = (
        step
        for step in WORKFLOW["jobs"]["scenarios"]["steps"]
        if "/xosc-toolchain@" in step.get("uses", "")
    )
    assert step["uses"].endswith(f"/xosc-toolchain@v{version}")
    assert step["with"].keys() <= ACTION["inputs"].keys()
    assert WORKFLOW["permissions"] == {"contents": "read"}


def test_the_container_is_pinned_and_its_user_has_no_rights() -> None:
    lines = CONTAINER.splitlines()
    images = [line.split()[1] for line in lines if line.startswith("FROM ")]
    assert set(images) == {"python:3.11.9-slim-bookworm"}
    (user,) = (line.split()[1] for line in lines if line.startswith("USER "))
    assert int(user) >= 1000
    assert lines.index(f"USER {user}") < next(
        at for at, line in enumerate(lines) if line.startswith("ENTRYPOINT ")
    )
    assert "--require-hashes" in CONTAINER
    assert "--no-index" in CONTAINER
    assert not re.search(r"^ADD |https?:|(?i:secret|token|password)", CONTAINER, re.MULTILINE)
    (entry,) = (line for line in lines if line.startswith("ENTRYPOINT "))
    assert json.loads(entry.removeprefix("ENTRYPOINT "))[0] in SCRIPTS


def test_the_container_is_built_of_what_the_wheel_is() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    kept = {line[1:] for line in ignored if line.startswith("!")}
    wheel = set(project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"])
    assert kept >= wheel | {"pyproject.toml", "requirements.lock", "hatch_build.py"}
    assert all((ROOT / name).exists() for name in kept)


def test_hooks_and_steps_call_commands_that_there_are() -> None:
    assert {shlex.split(hook["entry"])[0] for hook in HOOKS.values()} <= SCRIPTS.keys()
    scripts = " ".join(step["run"] for step in STEPS.values())
    assert set(re.findall(r"/(xosc-\w+)", scripts)) == {"xosc-check", "xosc-run"} <= SCRIPTS.keys()
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


@pytest.mark.slow
def test_the_action_annotates_what_is_wrong_and_reports_the_runs(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = repository.parent / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    (repository / "xosc.toml").write_text('sut = "adas"\n')
    answer = acted(repository, paths="\ncut in.xosc\n")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    reports = repository / "reports"
    assert json.loads((reports / "check.sarif").read_text())["runs"][0]["results"] == []
    (suite,) = etree.parse(reports / "runs.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("1", "0", "0")
    assert json.loads((reports / "runs" / "cut_in" / "result.json").read_text())["sut"] == "adas"
    assert [line.split(" | ")[:2] for line in summary.read_text().splitlines()[2:]] == [
        ["| cut_in", "passed"]
    ]
    path = repository / "cut in.xosc"
    path.write_text(path.read_text().replace("<Story ", '<Story color="red" '))
    answer = acted(repository, run="false", reports="others", untrusted="true")
    assert answer.returncode == 1
    assert "step run" not in answer.stdout
    (result, *_) = json.loads((repository / "others" / "check.sarif").read_text())["runs"][0][
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


def test_a_path_that_begins_as_an_option_is_a_path(tmp_path: Path) -> None:
    answer = acted(tmp_path, paths="--version", run="false")
    assert answer.returncode == 3, answer.stdout + answer.stderr
    assert "--version" in answer.stderr
