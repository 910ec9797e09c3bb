"""Catalogue entries that are referred to exist."""

from collections.abc import Iterator

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule
from schemas.rules.wording import unknown


@rule("asam.net:xosc:1.0.0:reference_control.catalog_reference_resolvability", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A CatalogReference must name an entry of a catalogue in one of the catalogue locations.

    Where a catalogue location is not there the entry may be in it, and this is a warning.
    """
    catalogs = document.catalogs
    level = "error" if catalogs.complete else "warning"
    for element in document.elements("CatalogReference"):
        catalog, name = document.value(element, "catalogName"), document.value(element, "entryName")
        entry = catalogs.entry(document, element)
        if catalog is None or name is None:
            continue
        if entry is not None:
            if entry.catalog != catalog:
                message = f"{entry.document.path.name} has the entry, but its catalogue is called {entry.catalog!r}"
                yield Finding(element, message, "warning")
        elif catalog in catalogs.names:
            known = catalogs.names[catalog]
            yield Finding(element, f"{unknown('entry', name, known)} in the catalogue {catalog!r}", level)
        else:
            yield Finding(element, f"{unknown('catalogue', catalog, catalogs.names)} in the catalogue locations", level)
