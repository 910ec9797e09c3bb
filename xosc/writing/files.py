"""New OpenSCENARIO documents from their parts."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from lxml import etree

from schemas.versions.registry import OPENSCENARIO, detect
from xosc.document import Document
from xosc.writing.versions import Version, checked, convert


@dataclass(frozen=True)
class FileHeader:
    """Header of a file.

    Attributes:
        description: what the file holds.
        author: author of the file.
        date: when; it is asked for, so that the same call gives the same bytes.
        properties: names and values of the header's Properties (1.2 and later), tags for example.
    """

    description: str
    author: str
    date: datetime
    properties: Mapping[str, str] = field(default_factory=dict, hash=False)


def new_document(
    path: str | os.PathLike[str],
    header: FileHeader,
    parts: Sequence[etree._Element],
    version: Version = (1, 3),
) -> Document:
    """A document that holds `parts`, as they stand in 1.3, after its FileHeader. It is not written
    yet: see `xosc.write`.

    Args:
        path: the file that it is to become; file references in it are relative to that.
        header: what the FileHeader says.
        parts: the children of OpenSCENARIO after the FileHeader.
        version: the version to write it in.

    Raises:
        Unsupported: the version cannot say all of it.
        InvalidFile: the parts do not make a valid document.
    """
    root = etree.Element(OPENSCENARIO)
    root.append(_file_header(header))
    root.extend(parts)
    document = Document(Path(path), root, (1, 3), detect(root.getroottree()).kind)
    return checked(document) if version == document.version else convert(document, version)


def _file_header(header: FileHeader) -> etree._Element:
    date = header.date.isoformat(timespec="seconds")
    texts = {"description": header.description, "author": header.author, "date": date}
    created = etree.Element("FileHeader", {"revMajor": "1", "revMinor": "3", **texts})
    if header.properties:
        properties = etree.SubElement(created, "Properties")
        for name, value in header.properties.items():
            etree.SubElement(properties, "Property", {"name": name, "value": value})
    return created
