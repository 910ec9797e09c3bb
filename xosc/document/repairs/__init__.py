"""Repairs of documents as they are loaded.

Each repair is a function of a root and its version that changes the tree where something has one
sensible meaning, and yields a remark on each change. What has no such meaning is left to be
refused; where they do not need it, a remark says that it was there.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from dataclasses import replace

from schemas.common.remarks import Remark
from xosc.document.node import Node
from xosc.document.repairs import attributes, elements
from xosc.document.repairs.revisions import Version, claimed, correct_revision, is_valid

_REPAIRS = (
    attributes.leave_out_absent_values,
    attributes.correct_attribute_names,
    attributes.correct_declared_names,
    elements.join_doubled_elements,
    elements.keep_first_positions,
    elements.move_content,
    elements.double_lone_vertices,
    attributes.keep_last_declarations,
    elements.correct_element_names,
    elements.order_elements,
    attributes.add_missing_attributes,
    elements.add_missing_boxes,
    elements.add_missing_elements,
    attributes.tell_repeated_names,
    attributes.correct_spellings,
)
"""In the order in which they are made."""
_OF_VALID_DOCUMENTS = (
    attributes.correct_declared_names,
    attributes.keep_last_declarations,
    attributes.tell_repeated_names,
)
"""Repairs of faults that no XSD forbids."""


def repair(root: Node, versions: tuple[Version, ...]) -> list[Remark]:
    """Make all repairs in a document, in place.

    Args:
        root: the root, in no namespace.
        versions: those of the standard that can be read, ascending.
    """
    version = claimed(root)
    # One validation decides: a valid document skips most repairs, whose faults the XSD would show.
    valid = version in versions and is_valid(root, version)
    remarks = [] if valid else correct_revision(root, versions)
    version = claimed(root)
    if version not in versions:
        return remarks
    repairs = _OF_VALID_DOCUMENTS if valid else _REPAIRS
    remarks += [remark for make in repairs for remark in make(root, version)]
    return _once(
        root, remarks if valid else [*remarks, *elements.remarks_on_violations(root, version)]
    )


def _once(root: Node, remarks: list[Remark]) -> list[Remark]:
    """Remarks that say the same of several lines as one, on the first of them; those with a cause
    once a catalogue entry."""
    entries = [
        entry.line or 0 for catalog in root.children("Catalog") for entry in catalog.children()
    ]
    keys = [
        (
            remark.rule,
            remark.message,
            bisect_right(entries, remark.line or 0) if remark.cause else 0,
        )
        for remark in remarks
    ]
    count = Counter(keys)
    first: dict[tuple[str, str, int], Remark] = {}
    for key, remark in zip(keys, remarks, strict=True):
        first.setdefault(key, remark)
    return [
        replace(remark, message=f"{remark.message} (and {count[key] - 1} more)")
        if count[key] > 1
        else remark
        for key, remark in first.items()
    ]
