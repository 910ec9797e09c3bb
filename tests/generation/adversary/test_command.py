"""`xosc-generate --method adversary` refuses what it has no use for."""

from __future__ import annotations

from pathlib import Path

import pytest

from generation.logical.library import SCENARIOS
from tests.commands import Command
from tests.generation.adversary.conftest import CUT_IN

OPTIONS = ["--free Ego_Speed_mps", "--kind cut_in", "--estimate", "--density kde", "--weight 1", "--concrete", "--against ."]


@pytest.mark.parametrize("option", OPTIONS)
def test_options_about_parameters_are_refused(option: str, command: Command, tmp_path: Path) -> None:
    answer = command("xosc-generate", CUT_IN, "--method", "adversary", "--out", tmp_path / "out", *option.split())
    assert answer.code == 2
    assert "which the method adversary does not search" in answer.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("method", "message"),
    [("adversary", "no objective 'luck'; objectives: risk-field, distance, fuzzy"), ("quality", "--objective is for the method")],
)
def test_objectives_are_those_of_an_adversary(method: str, message: str, command: Command, tmp_path: Path) -> None:
    answer = command("xosc-generate", CUT_IN, "--method", method, "--objective", "luck", "--out", tmp_path / "out")
    assert answer.code == 2
    assert message in answer.err
    assert not (tmp_path / "out").exists()


def test_a_catalogue_is_refused(command: Command, tmp_path: Path) -> None:
    answer = command("xosc-generate", SCENARIOS, "--method", "adversary", "--out", tmp_path / "out")
    assert answer.code == 2
    assert "takes a scenario, not a catalogue" in answer.err
