"""Records that do not ascend, or of which several begin at the same place."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

from xodr.reader.repairs.repair import Repair, leave_out, value

RULE = "xosc.toolchain:xodr:1.4.0:road.records_ascend"

_OF_ROADS = {
    "type": ("s",),
    "planView/geometry": ("s",),
    "elevationProfile/elevation": ("s",),
    "lateralProfile/superelevation": ("s",),
    "lateralProfile/crossfall": ("s",),
    "lateralProfile/shape": ("s", "t"),
    "lanes/laneOffset": ("s",),
    "lanes/laneSection": ("s",),
}
_OF_LANES = {"width": ("sOffset",), "border": ("sOffset",), "speed": ("sOffset",)}
_UNIQUE = frozenset({"elevation", "superelevation", "laneOffset", "shape", "width", "border"})
"""Records of which only one can hold at a place."""


def repair_order(root: etree._Element) -> Iterator[Repair]:
    """Sort records, and keep the last of several that begin at the same place."""
    for road in root.iterfind("road"):
        for path, keys in _OF_ROADS.items():
            yield from _sorted(road.findall(path), keys)
        for lane in road.iter("lane"):
            for path, keys in _OF_LANES.items():
                yield from _sorted(lane.findall(path), keys)


def _sorted(records: list[etree._Element], names: tuple[str, ...]) -> Iterator[Repair]:
    keys = {record: tuple(value(record, name) for name in names) for record in records}
    if len(records) < 2 or any(None in key for key in keys.values()):
        return
    known = {record: tuple(number for number in key if number is not None) for record, key in keys.items()}
    out_of_order = next((after for before, after in pairwise(records) if known[after] < known[before]), None)
    if out_of_order is not None:
        before = records[records.index(out_of_order) - 1]
        _put_in_order(records, sorted(records, key=known.__getitem__))
        fault = f"{_place(known[out_of_order], names)} follows {_place(known[before], names)}"
        yield Repair(out_of_order, RULE, fault, "the records are read in ascending order")
    for before, after in pairwise(sorted(records, key=known.__getitem__)):
        if before.tag in _UNIQUE and known[before] == known[after] and before.attrib != after.attrib:
            leave_out(before)
            fault = f"two records begin at {_place(known[after], names)}"
            yield Repair(after, RULE, fault, "the last of them is read")


def _put_in_order(records: list[etree._Element], ordered: list[etree._Element]) -> None:
    parent = records[0].getparent()
    if parent is None:
        return
    first = parent.index(records[0])
    for record in records:
        leave_out(record)
    for number, record in enumerate(ordered):
        parent.insert(first + number, record)


def _place(key: tuple[float, ...], names: tuple[str, ...]) -> str:
    return " ".join(f"{name}={number:g}" for name, number in zip(names, key, strict=True))
