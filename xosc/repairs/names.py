"""Names that a document uses and a version of the standard does not have: evidence for another version."""

from __future__ import annotations

from collections.abc import Iterator

from schemas.expressions import is_expression
from xosc.node import Node
from xosc.repairs.attributes import attributes, content, names

Version = tuple[int, int]

_EXPRESSIONS_SINCE = (1, 1)


def foreign(root: Node, version: Version) -> list[str]:
    """Return a sentence on each element, attribute or expression that a version lacks and another one has.

    Names that no version has are misspelt, and say nothing of the version. Nor do values: the runner reads
    those of all versions alike.

    Args:
        root: root of a document, in no namespace.
        version: one of the standard's.
    """
    return list(dict.fromkeys(_foreign(root, version)))


def _foreign(root: Node, version: Version) -> Iterator[str]:
    inside, declared = content(version), attributes(version)
    known_children, known_attributes = names(content), names(attributes)
    lacks = f"{version[0]}.{version[1]} has no"
    for node in root.iter():
        tag = node.tag
        for child in node.children() if tag in inside else ():
            if child.tag in known_children[tag] and child.tag not in inside[tag]:
                yield f"{lacks} {child.tag} in {tag}"
        for name in map(str, node.element.attrib) if tag in declared else ():
            if name in known_attributes[tag] and name not in declared[tag]:
                yield f"{lacks} attribute {name!r} of {tag}"
            elif version < _EXPRESSIONS_SINCE and name != "name" and is_expression(node.get(name)):
                yield f"{lacks} expressions, as {name}={node.get(name)!r}"
