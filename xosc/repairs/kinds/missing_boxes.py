"""Vehicles and pedestrians without a BoundingBox."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node

BREAKS_SCHEMA = True

_BOXES = {
    "car": (1.4, 4.5, 1.8, 1.5),
    "van": (1.6, 5.5, 2.0, 2.4),
    "truck": (3.0, 9.0, 2.5, 3.5),
    "bus": (3.4, 12.0, 2.55, 3.2),
    "motorbike": (0.7, 2.2, 0.8, 1.5),
    "bicycle": (0.55, 1.8, 0.6, 1.7),
    "pedestrian": (0.0, 0.5, 0.6, 1.8),
    "wheelchair": (0.3, 1.1, 0.7, 1.4),
}
"""x of the centre in front of the rear axle, length, width and height (m) of those that are common in Europe, by category."""


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give them that of their category; those of which there is no usual size keep having none."""
    for node in root.iter("Vehicle", "Pedestrian"):
        category = node.get(f"{node.tag.lower()}Category", "")
        if node.find("BoundingBox") is not None or category not in _BOXES:
            continue
        x, length, width, height = _BOXES[category]
        box = etree.Element("BoundingBox")
        box.sourceline = node.line  # type: ignore[assignment]  # the stubs leave its type open
        etree.SubElement(box, "Center", x=f"{x:g}", y="0", z=f"{height / 2:g}")
        etree.SubElement(box, "Dimensions", length=f"{length:g}", width=f"{width:g}", height=f"{height:g}")
        node.element.append(box)
        usual = f"that of a usual {category} is assumed: {length:g} m long, {width:g} m wide, {height:g} m high"
        yield node.remark(UID, f"{node.tag} {node.get('name', '')!r}: the element BoundingBox is missing; {usual}")
