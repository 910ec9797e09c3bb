"""Documents in which elements of some forms repeat, as text: objects for each of them would take most of the time of writing.

A form is made of a document that has parameter references `$name` where values go; it is valid by the XSD of its version, and
so are the elements with values in their places.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from string import Template
from xml.sax.saxutils import escape

from xosc.document import Document, to_bytes
from xosc.maneuvers.base import ESCAPED, Number, number


class Form:
    """The elements of some tags of a document, with references `$name` for values.

    Args:
        document: in the version that is written; each tag is there once or not at all.
        tags: of the elements.
    """

    def __init__(self, document: Document, tags: Sequence[str]) -> None:
        text = to_bytes(document).decode()
        found = {tag: re.search(rf" *<{tag} .*?</{tag}>\n", text, re.DOTALL) for tag in tags}
        self._texts = {tag: Template(match[0]) for tag, match in found.items() if match is not None}

    def filled(self, names: Mapping[str, str], numbers: Mapping[str, Number]) -> dict[str, str]:
        """The elements by their tags, indented as they stand in the document, with values in place of references.

        Raises:
            UsageError: a number is not finite.
        """
        values = {key: escape(name, ESCAPED) for key, name in names.items()}
        values |= {key: str(number(value)) for key, value in numbers.items()}
        return {tag: text.substitute(values) for tag, text in self._texts.items()}


def extended(document: Document, more: Iterable[Mapping[str, str]]) -> bytes:
    """The content of the file of a document, with more elements.

    Args:
        document: has one element of each tag.
        more: elements by their tags (`Form.filled`), which follow those of the document in this order.
    """
    text, more = to_bytes(document).decode(), list(more)
    for tag in dict.fromkeys(tag for elements in more for tag in elements):
        before, end, after = text.partition(f"</{tag}>\n")
        text = "".join([before, end, *(elements[tag] for elements in more if tag in elements), after])
    return text.encode()
