"""Catalogue entries that are referred to exist."""

from collections.abc import Iterator
from pathlib import Path

from schemas.catalogs import ENTRIES, NoEntry
from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule(ENTRIES, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A CatalogReference must name an entry of a catalogue in one of the catalogue locations.

    Where a catalogue location is not there the entry may be in it, and this is a warning.
    """
    for element in document.elements("CatalogReference"):
        try:
            entry = document.entry(element)
        except NoEntry as error:
            yield Finding(element, str(error), "warning" if error.undecided else None)
            continue
        if entry is not None and entry.catalog != document.value(element, "catalogName"):
            message = f"{Path(entry.path).name} has the entry, but its catalogue is called {entry.catalog!r}"
            yield Finding(element, message, "warning")
