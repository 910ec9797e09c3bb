"""Typed, located access to the elements of a resolved OpenSCENARIO document, and what names in it
refer to."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any, TypeVar

from lxml import etree

from schemas.catalogs import referred
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.remarks import Remark
from schemas.expressions.values import MARK, boolean, number

SOURCE = "{urn:xosc-toolchain}source"
"""Attribute naming the file that an element came from, where that is not the document's own
(catalogue entries)."""
LINE = "{urn:xosc-toolchain}line"
"""Attribute keeping the source line of such an element's root."""
TO_RIGHT = "{urn:xosc-toolchain}toRight"
"""Attribute of elements whose lateral values count to the right of the entity that they refer to,
see `xosc.document.carla`."""
OWN = (SOURCE, LINE, TO_RIGHT)
"""Attributes that no file has."""

_REQUIRED: Any = object()


class Node:
    """One element: attributes as Python values, children by name, and errors with file and line.

    Args:
        element: the lxml element.
        path: file that the document was read from.
    """

    __slots__ = ("element", "path")

    def __init__(self, element: etree._Element, path: Path) -> None:
        self.element = element
        # An entry of a catalogue keeps its own file: relative paths and errors are of that.
        source = element.get(SOURCE)
        self.path = _path(source) if source else path

    def __repr__(self) -> str:
        return f"<{self.tag} {self.where}>"

    @property
    def tag(self) -> str:
        """Element name."""
        return str(self.element.tag)

    @property
    def line(self) -> int | None:
        """Line in the file named by `path`."""
        # Elements that were made or copied have no line of their own.
        return int(str(self.element.get(LINE) or self.element.sourceline or 0)) or None

    @property
    def where(self) -> str:
        """`file:line`; the file alone where the line is not known."""
        return f"{self.path}:{self.line}" if self.line else str(self.path)

    @property
    def parent(self) -> Node | None:
        """The enclosing element, None for the root."""
        above = self.element.getparent()
        return Node(above, _source_of(above, self.path, {})) if above is not None else None

    # attributes -----------------------------------------------------------------------------

    def has(self, name: str) -> bool:
        """Whether the attribute is present."""
        return name in self.element.attrib

    def get(self, name: str, default: Any = _REQUIRED) -> Any:
        """Attribute as written; InvalidFile where it is absent and no default is given."""
        value = self.element.get(name)
        if value is not None:
            return value
        if default is _REQUIRED:
            raise self.invalid(f"the attribute {name!r} is missing")
        return default

    def float(self, name: str, default: Any = _REQUIRED) -> Any:
        """Attribute as float. `INF` is a value of the standard's type, NaN is refused.

        In a document that is read for many parameter sets it may be a `NumberColumn`.
        """
        text = self.get(name, default)
        if text is default:
            return default
        try:
            return number(text)
        except ValueError as error:
            if text.startswith(MARK):
                return _column(text)
            raise self.invalid(f"{name}: {error}") from None

    def finite(self, name: str, default: Any = _REQUIRED) -> Any:
        """Attribute as a finite float."""
        value = self.float(name, default)
        if value is not default and abs(value) == math.inf:
            raise self.invalid(f"{name}={value!r} must be a finite number")
        return value

    def int(self, name: str, default: Any = _REQUIRED) -> Any:
        """Attribute as int; `2.0`, which expressions produce, is accepted."""
        value = self.finite(name, default)
        if value is default:
            return default
        if value != int(value):
            raise self.invalid(f"{name}={self.get(name)!r} is not an integer")
        return int(value)

    def bool(self, name: str, default: Any = _REQUIRED) -> Any:
        """Attribute as bool: true, false, 1 or 0."""
        text = self.get(name, default)
        if text is default:
            return default
        try:
            return boolean(text)
        except ValueError as error:
            raise self.invalid(f"{name}: {error}") from None

    def choice(self, name: str, values: Iterable[str], default: Any = _REQUIRED) -> Any:
        """Attribute as one of `values`."""
        text = self.get(name, default)
        if text is not default and text not in values:
            raise self.invalid(f"{name}={text!r} is not one of {', '.join(sorted(values))}")
        return text

    def file(self, name: str) -> Path:
        """Attribute as a path; a relative one starts at the folder of the file that the element
        stands in."""
        return referred(self.path, self.get(name))

    # children -------------------------------------------------------------------------------

    def children(self, *tags: str) -> list[Node]:
        """Child elements in document order, those with one of `tags` where any are given."""
        return [
            Node(child, self.path)
            for child in self.element
            # Comments and processing instructions have a function as tag.
            if isinstance(child.tag, str) and (not tags or child.tag in tags)
        ]

    def find(self, *steps: str) -> Node | None:
        """First descendant along a path of child names, or None."""
        element: etree._Element | None = self.element
        path = self.path
        for step in steps:
            element = element.find(step) if element is not None else None
            if element is not None and element.get(SOURCE):
                path = _path(str(element.get(SOURCE)))
        return Node(element, path) if element is not None else None

    def need(self, *steps: str) -> Node:
        """Return the result of `find`; a missing element is an InvalidFile."""
        node = self.find(*steps)
        if node is None:
            raise self.invalid(f"the element {'/'.join(steps)} is missing")
        return node

    def only(self) -> Node:
        """The single child of an element that holds a choice."""
        children = self.children()
        if len(children) != 1:
            raise self.invalid(f"exactly one child element is expected, {len(children)} found")
        return children[0]

    def iter(self, *tags: str) -> Iterator[Node]:
        """Yield the element and its descendants with one of `tags`, in document order."""
        # Shared: each walk upwards ends at an element that an earlier one has passed.
        sources: dict[etree._Element, Path] = {}
        for element in self.element.iter(*tags):
            if isinstance(element.tag, str):
                yield Node(element, _source_of(element, self.path, sources))

    def at(self, element: etree._Element) -> Node:
        """An element inside this one, as a node of the file that it came from."""
        return Node(element, _source_of(element, self.path, {}))

    def text(self) -> str:
        """Text content, stripped."""
        return (self.element.text or "").strip()

    # errors ---------------------------------------------------------------------------------

    def invalid(self, message: str) -> InvalidFile:
        """An InvalidFile at this element, to be raised by the caller."""
        return InvalidFile(message, path=self.path, line=self.line, element=self.tag)

    def remark(self, rule: str, message: str, cause: str = "") -> Remark:
        """A remark on this element: the rule that it breaks, what is wrong with it and what is
        assumed; cause as in `Remark`."""
        return Remark(rule, message, str(self.path), self.line, cause, self.tag)

    def unsupported(self, message: str) -> Unsupported:
        """An Unsupported at this element, to be raised by the caller."""
        return Unsupported(message, path=self.path, line=self.line, element=self.tag)


def _column(text: str) -> Any:
    """A number of a document that is read for many parameter sets."""
    from schemas.expressions.columns import current

    return current().of(text)


@lru_cache(maxsize=256)
def _path(source: str) -> Path:
    """Return the path for a text, the same object each time."""
    return Path(source)


def _source_of(element: etree._Element, default: Path, known: dict[etree._Element, Path]) -> Path:
    """The file that an element came from: that of its nearest ancestor with one. Those that are
    known end the search."""
    passed, source = [], default
    current: etree._Element | None = element
    while current is not None:
        if current in known:
            source = known[current]
            break
        passed.append(current)
        if own := current.get(SOURCE):
            source = _path(own)
            break
        current = current.getparent()
    known.update(dict.fromkeys(passed, source))
    return source


# meaning of names -------------------------------------------------------------------------------


EGO_NAME = re.compile(r"(ego|hero)([-_ ]?(vehicle|car))?[-_ ]?\d*", re.IGNORECASE)
"""Names of vehicles that are meant as the ego, in scenarios that do not say which entity it is."""

STORYBOARD = ("Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action")
"""The elements that have a state, from the outermost inwards."""

_T = TypeVar("_T")
Names = tuple[str, ...]
"""Names of an element and those around it, from the story inwards."""


def names_of(element: etree._Element) -> Names:
    """The name of a storyboard element with those around it; of any other element, those around it
    only."""
    around = (element, *element.iterancestors(*STORYBOARD))
    return tuple(str(element.get("name", "")) for element in around if element.tag in STORYBOARD)[
        ::-1
    ]


def nearest(reference: str, around: Names, candidates: Iterable[tuple[Names, _T]]) -> Sequence[_T]:
    """Return the elements that a name or the end of a path (`Act::Event`) refers to: the nearest to
    the reference.

    Args:
        around: names of the elements in which the reference stands.
        candidates: elements of the type that is meant, with their names.

    Returns:
        One, several that are equally near, or none.
    """
    parts = tuple(reference.split("::"))
    near = [
        (_shared(path, around), element)
        for path, element in candidates
        if path[-len(parts) :] == parts
    ]
    # The nearest, as names resolve in programs: `Act::Event` in one's own story comes first.
    most = max((shared for shared, _ in near), default=0)
    return [element for shared, element in near if shared == most]


def meant(state: Node, scenario: Node) -> Sequence[Node]:
    """The elements that a StoryboardElementStateCondition may mean (OpenSCENARIO XML 1.3): one, as
    a rule."""
    kind = state.get("storyboardElementType").lower()
    tag = next((tag for tag in STORYBOARD if tag.lower() == kind), None)
    candidates = (
        [(names_of(node.element), node) for node in scenario.iter(tag)] if tag is not None else []
    )
    return nearest(state.get("storyboardElementRef"), names_of(state.element), candidates)


def _shared(path: Names, other: Names) -> int:
    """Number of names that two paths begin with in common."""
    return sum(
        1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(path, other, strict=False))
    )
