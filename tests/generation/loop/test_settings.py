"""Settings of a loop as they are told on its page and compared with those of a
loop in the same folder.
"""

from __future__ import annotations

from pathlib import Path

from generation.search.settings import Ask, LoopSettings
from runner.judging.settings import RunSettings


def test_settings_are_told_in_the_words_of_the_command() -> None:
    ask = Ask(Path("traffic"), pinned={"Gap": "5", "Speed": "20"}, maps=("A=a", "B=b"))
    told = LoopSettings(
        RunSettings(sut="aeb", road_path=("roads",), strict=True), ask=ask
    ).deciding()
    assert {name: told[name] for name in ("recorded", "kind", "density", "pin", "free", "map")} == {
        "recorded": "traffic", "kind": "–", "density": "mixture", "pin": "Gap=5, Speed=20",
        "free": "–", "map": "A=a, B=b",
    }  # fmt: skip
    assert (told["sut"], told["road_path"], told["strict"], told["ego"], told["budget"]) == (
        "aeb",
        "roads",
        "yes",
        "–",
        "300",
    )
    assert not [text for text in told.values() if set(text) & set("{}[]()'")]


def test_every_setting_that_decides_is_told() -> None:
    assert LoopSettings(ask=Ask(free=("Gap",))).deciding() != LoopSettings().deciding()
    assert (
        LoopSettings(processes=7, against=Path("before"), overwrite=True).deciding()
        == LoopSettings().deciding()
    )
