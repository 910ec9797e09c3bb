"""Repairs of OpenDRIVE files that the reader refuses although what they mean is plain.

The reader itself is strict. Where it refuses a file, the repairs change the parsed document, and it is read once more; each kind
of repair becomes one remark. A repair never chooses between two meanings: what is left unclear is refused by the reader.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from os import PathLike

from lxml import etree

from schemas.remarks import Remark
from schemas.xml import line_of
from xodr.reader.repairs.header import repair_header
from xodr.reader.repairs.lanes import repair_lanes
from xodr.reader.repairs.links import repair_links
from xodr.reader.repairs.order import repair_order
from xodr.reader.repairs.plan_view import repair_plan_view
from xodr.reader.repairs.repair import Repair
from xodr.reader.repairs.roadside import repair_roadside
from xodr.reader.repairs.values import repair_values

_REPAIRS: tuple[Callable[[etree._Element], Iterator[Repair]], ...] = (
    repair_header,
    repair_values,
    repair_order,
    repair_plan_view,
    repair_lanes,
    repair_roadside,
    repair_links,  # last: roads may have been left out
)


def repair(root: etree._Element, path: str | PathLike[str]) -> tuple[Remark, ...]:
    """Repair a document whose elements have names without namespaces; what was assumed, each thing once."""
    found: dict[tuple[str, str], list[Repair]] = {}
    for kind in _REPAIRS:
        for each in kind(root):
            found.setdefault((each.rule, each.assumption), []).append(each)
    return tuple(_remark(path, alike) for alike in found.values())


def _remark(path: str | PathLike[str], alike: list[Repair]) -> Remark:
    """One remark for repairs of one kind: the first of them, and how many more there are."""
    first = alike[0]
    more = f" (and {len(alike) - 1} more)" if len(alike) > 1 else ""
    message = f"{first.element.tag}: {first.fault}{more}; {first.assumption}"
    return Remark(first.rule, message, str(path), line_of(first.element))
