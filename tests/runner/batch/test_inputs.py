"""Runs are remembered by the content of all that decides them."""

from __future__ import annotations

import re
import shutil
from importlib import invalidate_caches
from pathlib import Path

import pytest

from generation.space.logical.library import ROADS, SCENARIOS
from runner.batch.inputs import inputs
from runner.judging.settings import RunSettings

SYSTEM = """
class Mine:
    def __init__(self, brake: float = {brake}) -> None:
        self.brake = brake

    def reset(self, ego, timestep, seed):
        pass

    def control(self, observation, dt):
        from runner.systems import Control
        return Control()  # {comment}
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A copy of a scenario, with its catalogues and its road, that can be changed."""
    shutil.copytree(SCENARIOS / "catalogs", tmp_path / "xosc" / "library" / "catalogs")
    (tmp_path / "xodr" / "library").mkdir(parents=True)
    shutil.copy(ROADS / "highway_straight.xodr", tmp_path / "xodr" / "library")
    shutil.copy(SCENARIOS / "cut_in_highway.xosc", tmp_path / "xosc" / "library")
    return tmp_path / "xosc" / "library" / "cut_in_highway.xosc"


def test_nothing_changed_is_the_same(scenario: Path) -> None:
    assert inputs(scenario, RunSettings()) == inputs(scenario, RunSettings())


FILES = (
    "cut_in_highway.xosc",
    "catalogs/vehicles/vehicle_catalog.xosc",
    "../../xodr/library/highway_straight.xodr",
)


@pytest.mark.parametrize("file", FILES)
def test_a_file_that_changes_is_another_input(scenario: Path, file: str) -> None:
    before = inputs(scenario, RunSettings())
    path = scenario.parent / file
    path.write_text(path.read_text().replace("xosc-toolchain", "somebody"))
    assert inputs(scenario, RunSettings()) != before


@pytest.mark.parametrize("element", ["LogicFile", "Directory"])
def test_files_that_a_parameter_names_are_inputs(scenario: Path, element: str) -> None:
    text, other = scenario.read_text(), "../../xodr/library/other.xodr"
    attribute, changed = (
        ("filepath", other) if element == "LogicFile" else ("path", "catalogs/vehicles")
    )
    old = re.search(rf'<{element} {attribute}="([^"]*)"', text)
    assert old is not None
    text = text.replace(old[0], f'<{element} {attribute}="$Where"', 1)
    declared = (
        '<ParameterDeclarations><ParameterDeclaration name="Where" parameterType="string" '
        f'value="{old[1]}"/>'
    )
    scenario.write_text(re.sub(r"<ParameterDeclarations>", declared, text, count=1))
    before = inputs(scenario, RunSettings())
    named = scenario.parent / (
        old[1] if element == "LogicFile" else f"{changed}/vehicle_catalog.xosc"
    )
    if element == "LogicFile":
        shutil.copy(named, scenario.parent / other)
    named.write_text(named.read_text().replace("xosc-toolchain", "somebody"))
    assert inputs(scenario, RunSettings()) != before, "the file by its default"
    if element == "LogicFile":
        assert inputs(scenario, RunSettings(), {"Where": other}) != inputs(scenario, RunSettings())


def test_settings_of_runs_and_systems_are_inputs(scenario: Path) -> None:
    before = inputs(scenario, RunSettings())
    for run in (
        RunSettings(timestep=0.1),
        RunSettings(sut="cas:brake=6"),
        RunSettings(world="kinematic"),
        RunSettings(seed=1),
    ):
        assert inputs(scenario, run) != before


def test_a_plug_in_of_the_same_name_with_other_code_is_another_input(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    module = tmp_path / "own_system.py"
    module.write_text(SYSTEM.format(brake=6.0, comment="first"))
    invalidate_caches()
    before = inputs(scenario, RunSettings(sut="own_system:Mine"))
    assert inputs(scenario, RunSettings(sut="own_system:Mine")) == before
    module.write_text(SYSTEM.format(brake=6.0, comment="second"))
    assert inputs(scenario, RunSettings(sut="own_system:Mine")) != before
