"""Stages of a loop are done once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from generation.loop.stages import Stages
from schemas.errors import InvalidFile, UsageError


def stages(out: Path, told: list[tuple[str, bool]], **settings: Any) -> Stages:
    return Stages(out, {"sut": "cas", **settings}, lambda name, found, seconds: told.append((name, seconds is not None)))


def test_a_finished_stage_is_not_done_again(tmp_path: Path) -> None:
    told: list[tuple[str, bool]] = []
    assert stages(tmp_path / "out", told).once("count", lambda: {"value": 1}) == {"value": 1}
    assert stages(tmp_path / "out", told).once("count", lambda: pytest.fail("it was done")) == {"value": 1}
    assert told == [("count", True), ("count", False)]


def test_a_stage_that_was_interrupted_is_done_again(tmp_path: Path) -> None:
    def interrupted() -> dict[str, Any]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stages(tmp_path / "out", []).once("count", interrupted)
    assert stages(tmp_path / "out", []).once("count", lambda: {"value": 2}) == {"value": 2}


def test_other_settings_need_another_folder(tmp_path: Path) -> None:
    stages(tmp_path / "out", [], budget="10")
    with pytest.raises(UsageError, match=r"other settings \(budget\)"):
        stages(tmp_path / "out", [], budget="20")


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError, match="something else"):
        stages(tmp_path, [])


@pytest.mark.parametrize("text", ["", "{", "[1]"])
def test_a_damaged_stage_is_named(tmp_path: Path, text: str) -> None:
    stages(tmp_path, []).once("count", dict)
    (tmp_path / "stages" / "count.json").write_text(text)
    with pytest.raises(InvalidFile, match=r"count\.json:.* remove it"):
        stages(tmp_path, []).once("count", dict)
