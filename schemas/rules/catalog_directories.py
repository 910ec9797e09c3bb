"""Catalogue folders exist."""

from collections.abc import Iterator

from schemas.catalogs import DIRECTORIES, locate
from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule(DIRECTORIES, level="warning", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A catalogue location must name an existing folder, relative to the scenario.

    A warning: templates list locations that they do not use, and libraries that have been moved are found by their name.
    """
    for element in document.elements("Directory"):
        name = document.value(element, "path")
        if name is None:
            continue
        try:
            fault = locate(document.file(name), document.path, document.catalog_path).assumed
        except (OSError, ValueError):
            fault = f"there is no folder {name!r}"
        if fault:
            location = local_name(element.getparent())  # type: ignore[arg-type]  # a Directory is in a location
            yield Finding(element, f"{location}: {fault}")
