"""The one place where XML is parsed: no document types, no entities, no network, no oversized input."""

from __future__ import annotations

import re
from io import BytesIO
from os import PathLike
from pathlib import Path

from lxml import etree

from schemas.errors import InvalidFile
from schemas.storage import read_bytes

_BEFORE_DOCTYPE = re.compile(rb"(?:\xef\xbb\xbf|\xff\xfe|\xfe\xff)?(?>\s+|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL)
_HINTS_OF_THE_PARSER = re.compile(r", (?:line \d+, column \d+.*|(?:use|try) XML_PARSE_HUGE.*)$", re.DOTALL)


def parse(path: str | PathLike[str]) -> etree._ElementTree:
    """Parse an XML file that may come from anyone.

    Args:
        path: a regular file that is not too large (see `schemas.storage`), in any encoding that its declaration or byte order
            mark names.

    Raises:
        InvalidFile: the file is missing, a folder, empty, too large, not well-formed, or declares a document type
            (neither OpenSCENARIO nor OpenDRIVE has one, and entities are how XML attacks its readers).
    """
    path = Path(path)
    data = read_bytes(path)
    if not data.strip():
        raise InvalidFile("the file is empty", path=path, line=1)
    return parse_bytes(data, path)


def parse_bytes(data: bytes, path: Path) -> etree._ElementTree:
    """Parse the content of a file that was read already (from an archive, say), with the same care.

    Args:
        path: the file's name in errors.

    Raises:
        InvalidFile: not well-formed, or declares a document type.
    """
    doctype = _BEFORE_DOCTYPE.match(data if b"\0" not in data[:4] else data.replace(b"\0", b""))
    if doctype:
        raise _doctype_refused(path, doctype.group().count(b"\n") + 1)
    parser = etree.XMLParser(resolve_entities=False, load_dtd=False, no_network=True, huge_tree=False)
    try:
        tree = etree.parse(BytesIO(data), parser, base_url=str(path).encode(errors="backslashreplace").decode())
    except etree.XMLSyntaxError as error:
        message = _HINTS_OF_THE_PARSER.sub("", error.msg or "no XML was found")
        raise InvalidFile(f"not well-formed XML: {message}", path=path, line=error.lineno) from None
    except (LookupError, UnicodeError, ValueError) as error:
        raise InvalidFile(f"not readable as XML: {error}", path=path) from None
    if tree.docinfo.internalDTD is not None:
        raise _doctype_refused(path, None)
    return tree


def line_of(element: etree._Element) -> int | None:
    """1-based source line of an element."""
    line: int | None = element.sourceline  # type: ignore[assignment]  # the stubs leave its type open
    return line


def local_name(element: etree._Element) -> str:
    """Name of an element without its namespace; "" for comments and processing instructions."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def _doctype_refused(path: Path, line: int | None) -> InvalidFile:
    return InvalidFile("a document type (DOCTYPE) is refused, with any entities it declares", path=path, line=line)
