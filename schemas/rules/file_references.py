"""Files that are referred to exist."""

from collections.abc import Iterator
from pathlib import PurePosixPath, PureWindowsPath

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.storage import in_any_case

_LEVELS = {"LogicFile": "error", "ScenarioFile": "error", "SceneGraphFile": "warning", "File": "warning"}


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_file_reference")
def check(document: Document) -> Iterator[Finding]:
    """A file that is referred to must exist, relative to the referring file; a road network may be in a folder asked for.

    Models for graphics and animations are only warned about, since a run can do without them; so are absolute paths, which
    may exist on the machine that they are meant for.
    """
    for tag, level in _LEVELS.items():
        for element in document.elements(tag):
            name = document.value(element, "filepath")
            if name and not _exists(document, tag, name):
                absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute()
                place = "" if absolute else f" in {document.path.parent}"
                alike = in_any_case(document.file(name))
                spelt = f"; {alike} differs in upper and lower case" if alike else ""
                yield Finding(element, f"{tag}: there is no file {name!r}{place}{spelt}", "warning" if absolute else level)


def _exists(document: Document, tag: str, name: str) -> bool:
    return document.road_file(name) is not None if tag == "LogicFile" else document.has_file(name)
