"""A misspelt name is answered by the nearest one, wherever it is given."""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc_toolchain as xt
from tests.commands import Command

LIBRARY = Path(__file__).parents[1] / "xosc" / "library"
NAME = "highway_lead_brake"
FILE = str(LIBRARY / f"{NAME}.xosc")


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("xosc-run", FILE, "--sut", "adsa"), "adas"),
        (("xosc-run", FILE, "--fail-if", "min_tcc<1"), "min_ttc"),
        (("xosc-run", FILE, "--ego", "Ego1"), "Ego"),
        (("xosc-run", FILE, "-p", "Lead_Deceleration=1"), "Lead_Deceleration_mps2"),
        (("xosc-run", FILE, "--suut", "adas"), None),
        (("xosc-generate", FILE, "--out", "out", "--method", "mcgs"), "mcsg"),
    ],
)
def test_options(
    arguments: tuple[str, ...],
    meant: str | None,
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = command(*arguments)
    assert answer.code == 2
    question = f"did you mean {meant!r}?" if meant else "--sut"
    assert question in answer.err


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ('<EntityRef entityRef="Lead"', '<EntityRef entityRef="Laed"', "Lead"),
        ("$Ego_Speed_mps", "$Ego_Sped_mps", "Ego_Speed_mps"),
    ],
)
def test_names_in_scenarios(old: str, new: str, meant: str, tmp_path: Path) -> None:
    text = (LIBRARY / f"{NAME}.xosc").read_text(encoding="utf-8")
    assert old in text
    text = text.replace("catalogs/vehicles", str(LIBRARY / "catalogs" / "vehicles"))
    text = text.replace("../../xodr", str(LIBRARY.parents[1] / "xodr"))
    (tmp_path / "wrong.xosc").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(xt.ToolchainError, match=f"did you mean '{meant}'") as caught:
        xt.run(tmp_path / "wrong.xosc", world="kinematic")
    assert caught.value.line is not None


def test_elements(tmp_path: Path, command: Command) -> None:
    text = (LIBRARY / f"{NAME}.xosc").read_text(encoding="utf-8")
    (tmp_path / "wrong.xosc").write_text(text.replace("SpeedAction>", "SpedAction>"))
    assert "did you mean 'SpeedAction'?" in command("xosc-check", str(tmp_path / "wrong.xosc")).out
