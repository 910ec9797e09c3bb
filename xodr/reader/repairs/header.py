"""Files without a header or without a version: all versions from 1.4 on are read alike."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from xodr.reader.repairs.repair import Repair, given, value

HEADER = "asam.net:xodr:1.0.0:xml.fileheader_is_present"
VERSION = "asam.net:xodr:1.0.0:xml.version_is_defined"

_ASSUMED = {"revMajor": "1", "revMinor": "4"}


def repair_header(root: etree._Element) -> Iterator[Repair]:
    """Give the file a header with a version where it has none."""
    header = root.find("header")
    if header is None:
        root.insert(0, etree.Element("header", _ASSUMED))
        yield Repair(root, HEADER, "the element header is missing", "read as OpenDRIVE 1.4")
        return
    for name, assumed in _ASSUMED.items():
        number = value(header, name)
        if number is None or number != int(number):
            fault = given(header, name, "is no version")
            header.set(name, assumed)
            yield Repair(header, VERSION, fault, "read as OpenDRIVE 1.4")
