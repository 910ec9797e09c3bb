"""A misspelt name is answered by the nearest one, wherever it is given."""

from __future__ import annotations

from pathlib import Path

import pytest

import xosc_toolchain as xt
from tests.commands import Command

LIBRARY = Path(__file__).parents[1] / "xosc" / "library"
NAME = "highway_lead_brake"


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("xosc-run", NAME, "--sut", "adsa"), "adas"),
        (("xosc-run", NAME, "--world", "kinematc"), "kinematic"),
        (("xosc-run", NAME, "--fail-if", "min_tcc<1"), "min_ttc"),
        (("xosc-run", NAME, "--ego", "Ego1"), "Ego"),
        (("xosc-run", NAME, "-p", "Lead_Deceleration=1"), "Lead_Deceleration_mps2"),
        (("xosc-run", NAME, "--suut", "adas"), None),
        (("xosc-export", NAME, "--to", "cralo", "--out", "out"), "carla"),
        (("xosc-list", "--class", "highway cutin"), "highway cut in"),
        (("xosc-list", "--tag", "Clas"), "Class"),
        (("xosc-generate", NAME, "--out", "out", "--method", "mcgs"), "mcsg"),
        (("xosc", "rnu"), "run"),
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


@pytest.mark.parametrize("call", [xt.run, xt.prepare, xt.Session])
def test_settings_in_python(call) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(xt.ToolchainError, match="there is no setting 'sutt'; did you mean 'sut'"):
        call(NAME, sutt="adas")
