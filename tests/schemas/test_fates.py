"""Fates of fields: what is undeclared, the share that is kept, and the table."""

from __future__ import annotations

import pytest

from schemas.common import fates

FIELDS = {"a": "metres", "b": "", "c": ""}
TABLES = {
    "one": {"a": fates.kept("x"), "b": fates.lost("no place"), "c": fates.changed("rounded")},
    "two": {"a": fates.kept(), "b": fates.lost("no place"), "c": fates.lost("no word")},
}


def test_fields_without_a_fate_and_fates_without_a_field_are_named() -> None:
    assert fates.undeclared(FIELDS, TABLES["one"]) == []
    assert fates.undeclared(FIELDS, {"a": fates.kept(), "z": fates.kept()}) == ["b", "c", "z"]


def test_a_note_is_written_once() -> None:
    assert list(fates.matrix(FIELDS, TABLES)) == [
        "| field | one | two |",
        "|---|---|---|",
        "| a (metres) | ● x | ● |",
        "| b | ○ 1 | ○ 1 |",
        "| c | ◐ 2 | ○ 3 |",
        "",
        "1: no place. 2: rounded. 3: no word.",
    ]
    assert fates.share_kept(TABLES) == (2, 6)


def test_lines_stand_between_their_markers() -> None:
    page = "a\n<!-- t -->\nold\n<!-- end of t -->\nb"
    assert fates.replaced(page, "t", ["new"]) == "a\n<!-- t -->\nnew\n<!-- end of t -->\nb"
    with pytest.raises(ValueError, match="no markers"):
        fates.replaced(page, "other", [])
