"""Meaning of names in a scenario: the ego, and the target of a storyboard element reference."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import takewhile
from typing import TypeVar

from lxml import etree

from xosc.node import Node

EGO_NAME = re.compile(r"(ego|hero)([-_ ]?(vehicle|car))?[-_ ]?\d*", re.IGNORECASE)
"""Names of vehicles that are meant as the ego, in scenarios that do not say which entity it is."""

STORYBOARD = ("Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action")
"""The elements that have a state, from the outermost inwards."""

_T = TypeVar("_T")
Names = tuple[str, ...]
"""Names of an element and those around it, from the story inwards."""


def names_of(element: etree._Element) -> Names:
    """The name of a storyboard element with those around it; of any other element, those around it only."""
    around = (element, *element.iterancestors(*STORYBOARD))
    return tuple(str(each.get("name", "")) for each in around if each.tag in STORYBOARD)[::-1]


def nearest(reference: str, around: Names, candidates: Iterable[tuple[Names, _T]]) -> Sequence[_T]:
    """Return the elements that a name or the end of a path (`Act::Event`) refers to: the nearest to the reference.

    Args:
        around: names of the elements in which the reference stands.
        candidates: elements of the type that is meant, with their names.

    Returns:
        One, several that are equally near, or none.
    """
    parts = tuple(reference.split("::"))
    near = [(_shared(path, around), element) for path, element in candidates if path[-len(parts) :] == parts]
    most = max((shared for shared, _ in near), default=0)
    return [element for shared, element in near if shared == most]


def meant(state: Node, scenario: Node) -> Sequence[Node]:
    """The elements that a StoryboardElementStateCondition may mean (OpenSCENARIO XML 1.3): one, as a rule."""
    kind = state.get("storyboardElementType").lower()
    tag = next((each for each in STORYBOARD if each.lower() == kind), None)
    candidates = [(names_of(each.element), each) for each in scenario.iter(tag)] if tag is not None else []
    return nearest(state.get("storyboardElementRef"), names_of(state.element), candidates)


def _shared(path: Names, other: Names) -> int:
    """Number of names that two paths begin with in common."""
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(path, other, strict=False)))
