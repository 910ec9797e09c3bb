"""Tables of what a target cannot say, or does not mind, as places in a scenario and the reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, cast

from lxml import etree

from xosc.document import Document
from xosc.node import SOURCE, Node


class Rule(NamedTuple):
    """A place in a scenario, as XPath from its root, and what the target makes of what stands there."""

    where: str
    reason: str


def refuse(document: Document, rules: Sequence[Rule]) -> None:
    """Refuse the first thing in a scenario that is in a table of what the target can't say.

    Raises:
        Unsupported: it is there, named with file (a catalogue's, where it came from there), line and reason.
    """
    for node, reason in _found(document, rules):
        raise node.unsupported(reason)


def remarks(document: Document, rules: Sequence[Rule]) -> list[str]:
    """A remark for every rule of a table that applies, with the first place where it does."""
    first: dict[str, Node] = {}
    for node, reason in _found(document, rules):
        first.setdefault(reason, node)
    return [f"{node.where}: {node.tag}: {reason}" for reason, node in first.items()]


def _found(document: Document, rules: Sequence[Rule]) -> Iterator[tuple[Node, str]]:
    """Elements in their order with the reason of the first rule that is about them."""
    reasons: dict[etree._Element, str] = {}
    for rule in rules:
        for element in cast(list[etree._Element], document.root.xpath(rule.where)):
            reasons.setdefault(element, rule.reason)
    for element in document.root.iter():
        if element in reasons:
            yield located(element, document), reasons[element]


def located(element: etree._Element, document: Document) -> Node:
    """An element of a document in the file that it came from: a catalogue's entry knows which that is."""
    source = next((each.get(SOURCE) for each in (element, *element.iterancestors()) if each.get(SOURCE)), None)
    return Node(element, Path(source) if source else document.path)
