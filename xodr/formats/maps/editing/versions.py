"""OpenDRIVE files in another version of the standard, 1.4 to 1.9.

Geometry, lanes and links stay as they are written. `CHANGES` lists each element, attribute and
value that some versions lack. Where no motion depends on it, it is left out or said in the words
of the version, with a remark for each kind. What would change roads or traffic is refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from schemas.common.errors import Unsupported, UsageError
from schemas.common.xml import line_of
from xodr.formats.maps.editing.changes import CHANGES, VERSIONS, Version, elements_at
from xodr.formats.maps.editing.tree import EditedRoads

_NAMESPACES = (1, 8)
"""First version whose files may have a namespace."""


def version_of(revision: str) -> Version:
    """A version as it is written: `1.8`.

    Raises:
        UsageError: it is not one of `VERSIONS`.
    """
    known = {name_of(version): version for version in VERSIONS}
    if revision not in known:
        message = f"OpenDRIVE {revision!r} is not written, only {', '.join(known)}"
        raise UsageError(message)
    return known[revision]


def in_version(path: Path, version: Version) -> tuple[bytes, list[str]]:
    """An OpenDRIVE file in another version, and what was left out or said otherwise, one sentence
    each.

    Args:
        version: one of `VERSIONS`.

    Raises:
        InvalidFile: it is no OpenDRIVE file; names file, line and element.
        Unsupported: it has what the version can't say, named with file, line and element.
    """
    file = EditedRoads(path)
    notes = [*file.remarks, *_changed(file, version)]
    header = file.root.find("header")
    if header is not None:
        header.set("revMajor", str(version[0]))
        header.set("revMinor", str(version[1]))
    if version < _NAMESPACES and file.leave_namespace():
        notes.append("the namespace of its elements is left out: files have none before 1.8")
    return file.content(), notes


def name_of(version: Version) -> str:
    """A version as it is written: `1.8`."""
    return ".".join(map(str, version))


def _changed(file: EditedRoads, version: Version) -> Iterator[str]:
    """Make the changes, in place; a remark for each kind."""
    for lacking, where, edit, reason in CHANGES:
        found = list(elements_at(file.root, where)) if version in lacking else []
        if not found:
            continue
        line, tag = line_of(found[0]), str(found[0].tag)
        if edit is None:
            message = f"OpenDRIVE {name_of(version)} {reason}"
            raise Unsupported(message, path=str(file.path), line=line, element=tag)
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        for element in found:
            edit(element)
        yield f"{file.path.name}:{line}: {tag}{more}: {reason}"
