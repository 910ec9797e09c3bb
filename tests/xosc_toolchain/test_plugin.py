"""Packages that extend the toolchain: the template, installed in a folder of its own, adds kinds by entry points."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.commands import Command
from xosc_toolchain.plugin import write_plugin

ROOT = Path(__file__).parents[2]
CUT_IN = str(ROOT / "xosc" / "library" / "simple_cut_in.xosc")
RUN = (
    "-m",
    "runner.xosc_run",
    CUT_IN,
    "--world",
    "kinematic",
    "--sut",
    "none",
    "--max-time",
    "1",
    "--allow-inconclusive",
)


def install(project: Path, target: Path) -> None:
    """Put a project's package and its metadata in a folder, as an installer does."""
    about = tomllib.loads((project / "pyproject.toml").read_text())["project"]
    package = project / about["name"]
    for file in package.rglob("*.py"):
        copy = target / file.relative_to(project)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(file.read_bytes())
    metadata = target / f"{about['name']}-{about['version']}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n"
    )
    groups = about["entry-points"].items()
    lines = [
        line
        for group, entries in groups
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in entries.items()))
    ]
    (metadata / "entry_points.txt").write_text("\n".join([*lines, ""]))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on the path with the template's package installed, which adds an action too."""
    project, target = tmp_path_factory.mktemp("project"), tmp_path_factory.mktemp("site")
    write_plugin("acme", project)
    root = project / "acme"
    (root / "acme" / "actions.py").write_text(
        "from runner.engine.actions.speed import SpeedAction\n"
        "from runner.engine.compile.registry import action\n\n"
        '@action("AcmeSpeedAction")\n'
        "class AcmeSpeedAction(SpeedAction):\n"
        '    """A speed action under a name of its own."""\n'
    )
    text = (root / "pyproject.toml").read_text()
    (root / "pyproject.toml").write_text(
        text + '\n[project.entry-points."xosc.action"]\nacme = "acme.actions"\n'
    )
    install(root, target)
    return target


def call(site: Path | None, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command with a folder of installed packages on the path."""
    path = os.pathsep.join([*([str(site)] if site else []), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
    )


def test_a_measure_of_an_installed_package_is_measured(site: Path, tmp_path: Path) -> None:
    done = call(site, tmp_path, *RUN, "--out", "out")
    assert done.returncode == 0, done.stderr
    assert "acme_short_ttc" in pq.read_schema(tmp_path / "out" / "runs.parquet").names


def test_it_is_a_limit_by_its_name(site: Path, tmp_path: Path) -> None:
    limit = ("--fail-if", "acme_short_ttc>=0")
    assert call(site, tmp_path, *RUN, *limit).returncode == 1
    without = call(None, tmp_path, *RUN, *limit)
    assert (without.returncode, "a measure with a limit is expected" in without.stderr) == (2, True)


def test_untrusted_loads_no_plug_in(site: Path, tmp_path: Path) -> None:
    code = """
import sys
from schemas.common.policy import UNTRUSTED, in_force
from schemas.common import packages
from runner.judging.measures.measure import measures
with in_force(UNTRUSTED):
    print(packages.plugins("xosc.measure"), "acme_short_ttc" in measures(), "acme.measures" in sys.modules)
print("acme_short_ttc" in measures())
with in_force(UNTRUSTED):
    print("acme_short_ttc" in measures())
"""
    done = call(site, tmp_path, "-c", code)
    assert done.stdout.split("\n")[:3] == ["{} False False", "True", "False"], done.stderr


def test_an_export_of_an_installed_package_is_a_target(site: Path, tmp_path: Path) -> None:
    export = ("-m", "runner.exchange.xosc_export")
    listed = call(site, tmp_path, *export, "--targets")
    assert "acme-speeds plug-in   of acme.speeds, installed by pip" in listed.stdout
    done = call(site, tmp_path, *export, *RUN[2:], "--to", "acme-speeds", "--out", "out")
    assert done.returncode == 0, done.stderr
    (written,) = (tmp_path / "out").glob("*.json")
    assert "Ego" in written.read_text()


def test_an_action_of_an_installed_package_is_executed(site: Path, tmp_path: Path) -> None:
    code = """
from runner.engine.compile.registry import action
class Node:
    tag = "AcmeSpeedAction"
    def invalid(self, told): return ValueError(told)
print(action.find(Node()).__name__)
"""
    assert call(site, tmp_path, "-c", code).stdout == "AcmeSpeedAction\n"
    assert "ValueError" in call(None, tmp_path, "-c", code).stderr


def test_a_plug_in_that_fails_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "site" / "bad-1.dist-info"
    folder.mkdir(parents=True)
    (folder / "entry_points.txt").write_text("[xosc.measure]\nbad = bad.measures\n")
    (tmp_path / "work").mkdir()
    done = call(tmp_path / "site", tmp_path / "work", *RUN, "--out", "out")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(
        "xosc-run: the plug-in 'bad' of xosc.measure (bad.measures) can't be imported"
    )


def test_the_template_is_written_once(command: Command, tmp_path: Path) -> None:
    answer = command("xosc", "new", "plugin", "acme", "--out", tmp_path)
    assert answer.code == 0 and str(tmp_path / "acme" / "pyproject.toml") in answer.out
    assert command("xosc", "new", "plugin", "acme", "--out", tmp_path).code == 2
    assert command("xosc", "new", "plugin", "not-a-name", "--out", tmp_path).code == 2


def test_metadata_in_the_working_folder_is_none_of_a_package(site: Path) -> None:
    limit = ("--fail-if", "acme_short_ttc>=0")
    assert call(site, site, *RUN, *limit).returncode == 2
