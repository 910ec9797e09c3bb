"""Catalogue folders exist."""

from collections.abc import Iterator

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.0.0:reference_control.catalogs_referenced_by_directory", level="warning", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A catalogue location must name an existing folder, relative to the scenario.

    A warning: templates list locations that they do not use, and some tools look for catalogues elsewhere as well.
    """
    for element in document.elements("Directory"):
        name = document.value(element, "path")
        if name is not None and not document.has_folder(name):
            location = local_name(element.getparent())  # type: ignore[arg-type]  # a Directory is in a location
            yield Finding(element, f"{location}: there is no folder {name!r}")
