"""The typed, located view of elements."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from lxml import etree

from schemas.common.errors import InvalidFile, Unsupported
from xosc import Node
from xosc.document.node import LINE, SOURCE


def node(text):
    return Node(etree.fromstring(text), Path("file.xosc"))


def test_attributes_are_typed():
    element = node('<a f="1.5" i="2.0" b="1" inf="-INF" c="red" s=" x "/>')
    assert (element.float("f"), element.int("i"), element.bool("b")) == (1.5, 2, True)
    assert (element.float("inf"), element.choice("c", ("red",)), element.get("s")) == (
        -math.inf,
        "red",
        " x ",
    )
    assert (
        element.float("no", None),
        element.int("no", 3),
        element.bool("no", None),
        element.get("no", ""),
    ) == (
        None,
        3,
        None,
        "",
    )


@pytest.mark.parametrize("text", ["NaN", "nan", "1_0", "", "1,5", "1e999", "x"])
def test_what_is_no_number_is_refused(text):
    with pytest.raises(InvalidFile, match=r"file\.xosc:1: a: x: "):
        node(f'<a x="{text}"/>').float("x")


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda a: a.finite("inf"), "must be a finite number"),
        (lambda a: a.int("half"), "is not an integer"),
        (lambda a: a.bool("half"), "neither true nor false"),
        (lambda a: a.choice("half", ("x", "y")), "is not one of x, y"),
        (lambda a: a.get("none"), "'none' is missing"),
        (lambda a: a.need("b", "c"), "element b/c is missing"),
        (lambda a: a.only(), "exactly one child element is expected, 2 found"),
    ],
)
def test_what_is_wrong_is_said_with_file_line_and_element(read, message):
    with pytest.raises(InvalidFile, match=rf"file\.xosc:2: a: .*{message}"):
        read(node('\n<a inf="INF" half="0.5"><b/><!-- c --><d/></a>'))


def test_children_skip_comments_and_instructions():
    element = node("<a><!-- x --><b/><?c d?><e/><b/></a>")
    assert [child.tag for child in element.children()] == ["b", "e", "b"]
    assert [child.tag for child in element.children("b")] == ["b", "b"]
    assert element.find("e", "f") is None


def test_places_follow_inlined_elements():
    element = node(
        f'<a xmlns:t="{SOURCE[1:-7]}"><b><c t:source="cat.xosc" t:line="7"><d/></c></b></a>'
    )
    assert element.element[0][0].get(LINE) == "7"
    assert element.need("b", "c").where == "cat.xosc:7"
    assert element.need("b", "c", "d").path == Path("cat.xosc")
    assert [found.path.name for found in element.iter("b", "d")] == ["file.xosc", "cat.xosc"]
    assert isinstance(element.need("b", "c").unsupported("no"), Unsupported)
