"""`xosc-generate --method adversary` refuses what it has no use for."""

from __future__ import annotations

from pathlib import Path

import pytest

from generation.logical.library import SCENARIOS
from tests.commands import Command
from tests.generation.adversary.conftest import CUT_IN


@pytest.mark.parametrize("option", [("--free", "Ego_Speed_mps"), ("--kind", "cut_in"), ("--estimate",)])
def test_options_about_parameters_are_refused(option: tuple[str, ...], command: Command, tmp_path: Path) -> None:
    answer = command("xosc-generate", CUT_IN, "--method", "adversary", "--out", tmp_path / "out", *option)
    assert answer.code == 2
    assert "which the method adversary does not search" in answer.err
    assert not (tmp_path / "out").exists()


def test_a_catalogue_is_refused(command: Command, tmp_path: Path) -> None:
    answer = command("xosc-generate", SCENARIOS, "--method", "adversary", "--out", tmp_path / "out")
    assert answer.code == 2
    assert "takes a scenario, not a catalogue" in answer.err
