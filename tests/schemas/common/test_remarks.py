"""Repairs are told once, or refused."""

from __future__ import annotations

import pytest

from schemas.common.errors import InvalidFile
from schemas.common.remarks import Remark, Remarks

FIRST = Remark(
    "xosc.toolchain:xosc:1.0.0:a.b", "'x' is no number; 0 is assumed", "folder/file.xosc", 7
)
SECOND = Remark("xosc.toolchain:xosc:1.0.0:c.d", "the file has no header", "folder/file.xosc")


def test_a_remark_says_place_assumption_and_rule():
    assert (
        str(FIRST)
        == "folder/file.xosc:7: 'x' is no number; 0 is assumed [xosc.toolchain:xosc:1.0.0:a.b]"
    )
    assert str(SECOND) == "folder/file.xosc: the file has no header [xosc.toolchain:xosc:1.0.0:c.d]"
    assert str(FIRST.error()) == str(FIRST)


def test_remarks_are_kept_once_in_their_order():
    remarks = Remarks()
    remarks.add(SECOND, FIRST)
    remarks.add(FIRST)
    assert remarks.found == (SECOND, FIRST)


def test_strict_remarks_refuse_the_first():
    remarks = Remarks(strict=True)
    remarks.add()
    with pytest.raises(InvalidFile, match=r"file\.xosc:7: .*a\.b"):
        remarks.add(FIRST, SECOND)
