"""`python -m studies.generation adversary` refuses wrong input before it writes anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile, UsageError
from studies.generation.commands.adversary import command
from tests.studies.generation.adversary.conftest import CUT_IN


def test_an_unknown_objective_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match="no objective 'luck'; objectives: risk-field, distance, fuzzy"
    ):
        command(CUT_IN, tmp_path / "out", objective="luck")
    assert not (tmp_path / "out").exists()


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="this is a folder, a file is expected"):
        command(tmp_path, tmp_path / "out")
