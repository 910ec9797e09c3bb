"""What versions before 1.2 leave open, and this runner reads otherwise from 1.2 on, where it can be said."""

from __future__ import annotations

from lxml import etree

from xosc.document import Document

SAID_SINCE = (1, 2)
_MEANT = (
    ("SpeedActionDynamics", "followingMode", "follow"),
    ("LaneChangeActionDynamics", "followingMode", "follow"),
    ("AccelerationCondition", "direction", "longitudinal"),
)
"""Attributes, and what is meant before they can be said."""


def left_open(document: Document) -> list[tuple[etree._Element, str, str]]:
    """Each element with such an attribute, the attribute, and what is meant where it is not said."""
    return [(element, attribute, value) for tag, attribute, value in _MEANT for element in document.root.iter(tag)]
