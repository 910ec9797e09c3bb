"""The page on architecture names what is there, is short, and its picture is the
one that belongs to it.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from pkgutil import resolve_name
from types import ModuleType

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def loaded() -> ModuleType:
    """`docs/picture.py`, which no package holds."""
    spec = importlib.util.spec_from_file_location("docs_picture", DOCS / "picture.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


picture = loaded()
TEXT = picture.PAGE.read_text(encoding="utf-8")
WAYS = picture.ways(TEXT)
NAMES = sorted(set(picture.NAMED.findall(TEXT)))


@pytest.mark.parametrize("name", NAMES)
def test_name_is_there(name: str) -> None:
    assert resolve_name(name) is not None


def test_three_ways_have_at_most_eight_steps_each_of_which_names_code() -> None:
    assert [way.title for way in WAYS] == [
        "A speed value, from XML to SUMO",
        "A recording, to an `.xosc`",
        "A parameter vector, to a reward",
    ]
    assert all(1 < len(way.steps) <= 8 and all(way.steps) for way in WAYS)


def test_picture_is_what_make_docs_draws() -> None:
    assert picture.PICTURE.read_text(encoding="utf-8") == picture.picture(TEXT), "run make docs"


def test_every_room_is_in_the_picture_once() -> None:
    drawn = picture.picture(TEXT)
    rooms = [
        room for floor in picture.FLOORS for package in floor for room in picture.rooms(package)
    ]
    assert all(drawn.count(f">{room}</text>") == rooms.count(room) for room in rooms)
