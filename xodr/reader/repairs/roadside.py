"""Signals, objects and controllers that cannot be read: roads are driven without them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lxml import etree

from schemas.errors import ToolchainError
from xodr.reader.elements import text
from xodr.reader.junctions import read_controller
from xodr.reader.repairs.repair import SCHEMA, Repair, leave_out
from xodr.reader.road_objects import read_object, read_signal, read_signal_reference

_READERS: dict[str, Callable[[etree._Element], object]] = {
    "road/signals/signal": lambda element: read_signal(element, ""),
    "road/signals/signalReference": read_signal_reference,
    "road/objects/object": lambda element: read_object(element, ""),
    "controller": read_controller,
    "junction/controller": lambda element: text(element, "id"),
}


def repair_roadside(root: etree._Element) -> Iterator[Repair]:
    """Leave out what cannot be read."""
    for path, read in _READERS.items():
        for element in root.findall(path):
            try:
                read(element)
            except ToolchainError as error:
                leave_out(element)
                yield Repair(element, SCHEMA, error.message, f"the {element.tag} is left out")
