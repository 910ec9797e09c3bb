"""Repairs of documents as they are loaded.

The kinds of repairs are the modules of `xosc.repairs.kinds` (see `schemas.discovery`): each has a function
`repair(root, version)` that changes the tree where something has one sensible meaning, and yields a remark on each change, and
a constant `BREAKS_SCHEMA` that says whether only documents have its fault that are not valid against the XSD.
What has no such meaning is left to those who refuse it; where they do not need it, a remark says that it was there.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from schemas import discovery
from schemas.remarks import Remark
from xosc.node import Node
from xosc.repairs import leftovers, revision


def repair(root: Node, versions: tuple[revision.Version, ...]) -> list[Remark]:
    """Make all repairs in a document, in place.

    Args:
        root: the root, in no namespace.
        versions: those of the standard that can be read, ascending.
    """
    version = revision.claimed(root)
    valid = version in versions and revision.is_valid(root, version)
    remarks = [] if valid else revision.repair(root, versions)
    version = revision.claimed(root)
    if version not in versions:
        return remarks
    kinds = [kind for kind in discovery.load("xosc.repairs.kinds") if not (valid and kind.BREAKS_SCHEMA)]
    remarks += [remark for kind in kinds for remark in kind.repair(root, version)]
    return _once(remarks if valid else [*remarks, *leftovers.remarks(root, version)])


def _once(remarks: list[Remark]) -> list[Remark]:
    """Remarks that say the same of several lines as one, on the first of them."""
    count = Counter((remark.rule, remark.message) for remark in remarks)
    first: dict[tuple[str, str], Remark] = {}
    for remark in remarks:
        first.setdefault((remark.rule, remark.message), remark)
    return [
        replace(remark, message=f"{remark.message} (and {count[key] - 1} more)") if count[key] > 1 else remark
        for key, remark in first.items()
    ]
