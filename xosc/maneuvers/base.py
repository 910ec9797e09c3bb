"""Shared parts of the builders: numbers, enumerations of the standard, conversion of scenariogeneration's objects to elements."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache, partial
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np
from lxml import etree
from scenariogeneration import xosc as sg

from schemas.common.errors import UsageError

Number = float | str
"""A number, or the text of a parameter reference `$Speed` or an expression `${2 * $Speed}`."""


def number(value: Number) -> float | str:
    """The value as scenariogeneration takes it; UsageError for what is neither finite nor a reference."""
    if isinstance(value, str):
        if value.startswith("$"):
            return value
        raise UsageError(f"{value!r} is neither a number nor a parameter reference, which begins with $")
    if not math.isfinite(value):
        raise UsageError(f"{value} is not a finite number")
    return float(value)


@cache
def enum_value(kind: str, name: str) -> Any:
    """The member of one of the standard's enumerations; UsageError where it has no such member."""
    members = {key: value for key, value in vars(getattr(sg, kind)).items() if not key.startswith("_")}
    if name not in members:
        raise UsageError(f"{kind} has no {name!r}, it has {', '.join(members)}")
    return members[name]


_TRAJECTORY = """<Trajectory name="{name}" closed="false"><Shape><Polyline>
{vertices}</Polyline></Shape></Trajectory>
"""
_VERTEX = '<Vertex time="%r"><Position><WorldPosition %s/></Position></Vertex>\n'
"""A line per vertex without indentation: half of a catalogue of recorded motion would be blanks"""
_PLACES = 1 << 17
"""Places of vertices whose texts are kept, some 50 MB: scenes of one recording that overlap have them in common"""
_BETWEEN = re.compile(r">\n *<")
ESCAPED = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}


class Polyline(sg.Trajectory):
    """A `Trajectory` with one vertex a row of columns t, x, y and perhaps z and h, kept as its text, as it stands in a catalogue.

    Three objects a vertex would take most of the time of writing recorded motion.

    Raises:
        UsageError: a value is not finite.
    """

    def __init__(self, name: str, columns: Mapping[str, Sequence[float]]) -> None:
        super().__init__(name, False)
        values = np.array(list(columns.values()), np.float64) + 0.0  # no -0.0: `_place` takes it for 0.0
        for value in values[~np.isfinite(values)].tolist():
            number(value)  # refuses it
        time, *places = values.tolist()
        texts = map(partial(_place, tuple(columns)[1:]), *places)
        vertices = "".join([_VERTEX % vertex for vertex in zip(time, texts, strict=True)])
        self.text = _TRAJECTORY.format(name=escape(name, ESCAPED), vertices=vertices)

    @property
    def dense(self) -> str:
        """The text without indentation."""
        return _BETWEEN.sub("><", self.text).strip()

    def get_element(self) -> ElementTree.Element:
        """The element, as scenariogeneration asks for it."""
        return ElementTree.fromstring(self.dense)  # noqa: S314 - made here


@lru_cache(maxsize=_PLACES)
def _place(axes: tuple[str, ...], *values: float) -> str:
    """Attributes of a place."""
    return " ".join(f'{axis}="{value!r}"' for axis, value in zip(axes, values, strict=True))


def rendered(built: Any) -> etree._Element:
    """The element of a scenariogeneration object, in version 1.3 of the standard.

    The version that scenariogeneration writes is a global of the process: it is set here only, and put back.
    """
    if isinstance(built, Polyline):
        return etree.fromstring(built.dense)
    before = sg.VersionBase.version_major, sg.VersionBase.version_minor
    sg.VersionBase().setVersion(1, 3)
    try:
        return _copied(built.get_element())
    finally:
        sg.VersionBase().setVersion(*before)


def _copied(element: Any, parent: etree._Element | None = None) -> etree._Element:
    """An element of the standard library's XML tree as one of lxml's."""
    tag, attributes = element.tag, element.attrib
    copied = etree.Element(tag, attributes) if parent is None else etree.SubElement(parent, tag, attributes)
    copied.text = element.text
    for child in element:
        _copied(child, copied)
    return copied
