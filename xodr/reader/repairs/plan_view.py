"""Roads and geometries without a length."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.repairs.repair import Repair, given, leave_out, value

RULE = "xosc.toolchain:xodr:1.4.0:road.geometry.reference_line_is_complete"


def repair_plan_view(root: etree._Element) -> Iterator[Repair]:
    """Give roads the length of their line, lines that of their road; leave roads out that have neither."""
    for road in root.findall("road"):
        geometries = road.findall("planView/geometry")
        length, lengths = value(road, "length") or 0.0, [value(geometry, "length") or 0.0 for geometry in geometries]
        if length <= 0.0 and sum(lengths) > 0.0:
            fault = given(road, "length", "is no length")
            road.set("length", repr(sum(lengths)))
            yield Repair(road, RULE, fault, "the length of its geometries is read")
        elif length > 0.0 and len(geometries) == 1 and lengths == [0.0]:
            geometries[0].set("length", repr(length))
            yield Repair(geometries[0], RULE, "the only geometry of the road has no length", "the length of the road is read")
        elif not any(lengths):
            leave_out(road)
            yield Repair(road, RULE, f"the road {road.get('id')!r} has no geometry with a length", "the road is left out")
