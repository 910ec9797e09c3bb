"""What the files of the library say about themselves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime

from recognition.catalogue.writing.annotation import ontology_tags
from recognition.labels import Label
from xosc.maneuvers import Header
from xosc.tags import ASAM, Tag, properties

COMMAND = "python -m generation.logical"
"""What makes the files."""
AUTHOR = "xosc-toolchain"
_DATE = datetime(2026, 11, 21)


def header(description: str, tags: Sequence[Tag]) -> Header:
    """A file's header, with its tags as properties."""
    return Header(description, AUTHOR, _DATE, properties([*tags, Tag("MadeBy", COMMAND)]))


def scenario_tags(name: str, situation: str, label: Label | None, road: Sequence[Tag], categories: Iterable[str]) -> list[Tag]:
    """The tags of a scenario.

    Args:
        situation: what happens, in a word or two.
        label: its class for the ego, where it is one of the 17.
        road: tags of its road.
        categories: of its participants.
    """
    title = label.title if label is not None else ""
    tags = [*ontology_tags(title, categories), *road, Tag("scenarioName", name, ASAM), Tag("Situation", situation)]
    tags += [Tag("Class", title)] if title else []
    return list(dict.fromkeys([*tags, Tag("Ego", "Ego")]))
