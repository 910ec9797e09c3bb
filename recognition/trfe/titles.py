"""Names of the classes that a model knows."""

from __future__ import annotations

from recognition.labels.classes import Label
from recognition.trfe.discovery.discovery import FIRST_DISCOVERED
from recognition.trfe.samples import BACKGROUND


def title_of(label: int) -> str:
    """Name of a class of a model."""
    if label == BACKGROUND:
        return "nothing"
    return f"discovered {label - FIRST_DISCOVERED + 1:02d}" if label >= FIRST_DISCOVERED else Label(label).title
