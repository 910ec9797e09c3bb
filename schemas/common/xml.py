"""The only XML parser of the toolchain: no document types, no entities, no network, no oversized
input."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import BytesIO
from os import PathLike
from pathlib import Path

from lxml import etree

from schemas.common.errors import InvalidFile
from schemas.common.remarks import Remark
from schemas.common.storage import read_bytes

_WELL_FORMED = "asam.net:{}:1.0.0:xml.valid_xml_document"
# Possessive: a long prologue without a DOCTYPE fails in one pass, without backtracking.
_BEFORE_DOCTYPE = re.compile(
    rb"(?:\xef\xbb\xbf|\xff\xfe|\xfe\xff)?(?>\s+|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL
)
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_DECLARATION = re.compile(rb"<\?xml\s[^?<>]*\?>")
_ENCODING = re.compile(rb"encoding\s*=\s*[\"']([\w.-]+)")
_OF_WINDOWS = "windows-1252"
"""Encoding of Western Windows editors that do not write UTF-8"""
_DOCTYPE = re.compile(rb"<!DOCTYPE\s[^\[<>]*(?:\[\s*\]\s*)?>")
_COMMENT_OR_CDATA = re.compile(rb"<!--|<!\[CDATA\[")
_START_TAG = re.compile(rb"<[A-Za-z_](?:[^<>\"']++|\"[^<\"]*+\"|'[^<']*+')*+>")
_ATTRIBUTE = re.compile(rb"""\s([A-Za-z_][\w:.-]*)\s*=\s*("[^"]*"|'[^']*')""")
LONGEST_TAG = 1024 * 1024
"""Bytes that a start tag may have, with all its attributes; the parser takes some eighty times as
much memory"""
MOST_PARTS = 10_000_000
"""Elements and attributes that a document may have; public road networks of 25 MB have a million"""
_HINTS_OF_THE_PARSER = re.compile(
    r", (?:line \d+, column \d+.*|(?:use|try) XML_PARSE_HUGE.*)$", re.DOTALL
)


_TAG = re.compile(rb"<[A-Za-z_/][^<>]*>")
_PREFIX = re.compile(rb"(?:^</?|\s)([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*(?=\s*=|[\s/>])")
_PREFIX_DECLARED = re.compile(rb"\sxmlns:([A-Za-z_][\w.-]*)\s*=")
_ROOT = re.compile(rb"<[A-Za-z_][\w.:-]*")
_XSI = b"http://www.w3.org/2001/XMLSchema-instance"


def parse(path: str | PathLike[str], remarks: list[Remark] | None = None) -> etree._ElementTree:
    """Parse an XML file that may come from anyone.

    Args:
        path: a regular file that is not too large (see `schemas.common.storage`), in any encoding
            that its declaration or byte order mark names.
        remarks: where given, faults outside of the elements are repaired (see `repaired`), each
            with a remark added here.

    Raises:
        InvalidFile: the file is missing, a folder, empty, too large, not well-formed, or declares a
            document type (neither OpenSCENARIO nor OpenDRIVE has one, and entities are how XML
            attacks its readers).
    """
    path = Path(path)
    data = read_bytes(path)
    if not data.strip():
        raise InvalidFile("the file is empty", path=path, line=1)
    if path.suffix.lower() == ".osc" and not data.lstrip().startswith(b"<"):
        raise InvalidFile(
            "this is OpenSCENARIO DSL, which is not read; OpenSCENARIO XML (.xosc) is", path=path
        )
    _check_size(data, path)
    try:
        return parse_bytes(data, path)
    except InvalidFile:
        fixed, repairs = repaired(data, path)
        if remarks is None or not repairs:
            raise
        remarks += repairs
    return parse_bytes(fixed, path)


def rule_of(path: Path) -> str:
    """Rule on sound XML, of OpenDRIVE or of OpenSCENARIO by the suffix of the file."""
    return _WELL_FORMED.format("xodr" if path.suffix.lower() == ".xodr" else "xosc")


def parse_bytes(data: bytes, path: Path) -> etree._ElementTree:
    """Parse the content of a file that was read already (from an archive, say), with the same care.

    Args:
        path: the file's name in errors.

    Raises:
        InvalidFile: not well-formed, or declares a document type.
    """
    _check_size(data, path)
    # UTF-16 has a zero byte beside each ASCII character: without them the pattern fits.
    doctype = _BEFORE_DOCTYPE.match(data if b"\0" not in data[:4] else data.replace(b"\0", b""))
    if doctype:
        raise _doctype_refused(path, doctype.group().count(b"\n") + 1)
    # Without huge_tree libxml2 keeps its own bounds on depth and on the lengths of texts.
    parser = etree.XMLParser(
        resolve_entities=False, load_dtd=False, no_network=True, huge_tree=False
    )
    try:
        tree = etree.parse(
            BytesIO(data), parser, base_url=str(path).encode(errors="backslashreplace").decode()
        )
    except etree.XMLSyntaxError as error:
        if getattr(error, "code", None) == etree.ErrorTypes.ERR_NO_MEMORY:  # its type hints lack it
            raise MemoryError(error.msg) from None
        message = _HINTS_OF_THE_PARSER.sub("", error.msg or "no XML was found")
        raise InvalidFile(f"not well-formed XML: {message}", path=path, line=error.lineno) from None
    except (LookupError, UnicodeError, ValueError) as error:
        raise InvalidFile(f"not readable as XML: {error}", path=path) from None
    # The pattern above reads encodings that extend ASCII; in all others the parser sees it.
    if tree.docinfo.internalDTD is not None:
        raise _doctype_refused(path, None)
    return tree


def _check_size(data: bytes, path: Path) -> None:
    """Refuse content that takes the parser many times its size in memory.

    No tag holds a `<`, so that only stretches without one are looked at; a few looks per megabyte
    find them.
    """
    data = data.replace(b"\0", b"") if b"\0" in data[:4] else data
    # A stretch of LONGEST_TAG bytes without a `<` covers one whole step of half that length.
    half, begin = LONGEST_TAG // 2, 0
    while begin + half < len(data):
        opening = data.rfind(b"<", begin, begin + half)
        if opening >= 0:
            begin = opening + half
            continue
        start, end = data.rfind(b"<", 0, begin), data.find(b"<", begin)
        begin = len(data) if end < 0 else end
        # Comments, CDATA sections, processing instructions and end tags have no attributes.
        if (
            start < 0
            or data[start + 1 : start + 2] in (b"!", b"?", b"/")
            or _START_TAG.match(data, start, start + LONGEST_TAG)
        ):
            continue  # the stretch is text
        message = f"a tag of more than the {LONGEST_TAG} bytes that are read begins here"
        raise InvalidFile(message, path=path, line=data.count(b"\n", 0, start) + 1)
    if len(data) >= 3 * MOST_PARTS:  # what is shorter can't have as many
        # An upper bound that needs no parsing: texts and comments may hold these signs too.
        parts = data.count(b"<") + data.count(b"=")
        if parts > MOST_PARTS:
            raise InvalidFile(
                f"the file has {parts} elements and attributes, at most {MOST_PARTS} are read",
                path=path,
            )


def line_of(element: etree._Element) -> int | None:
    """1-based source line of an element."""
    line: int | None = element.sourceline  # type: ignore[assignment]  # the stubs leave its type open
    return line


def local_name(element: etree._Element) -> str:
    """Name of an element without its namespace; "" for comments and processing instructions."""
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def canonical(element: etree._Element) -> tuple[object, ...]:
    """Return the content of an element for comparison: names, attributes, texts, children. Unlike
    C14N any namespace works."""
    children = (canonical(child) for child in element.iterchildren(etree.Element))
    return (
        str(element.tag),
        frozenset(element.attrib.items()),
        (element.text or "").strip(),
        *children,
    )


def _doctype_refused(path: Path, line: int | None) -> InvalidFile:
    return InvalidFile(
        "a document type (DOCTYPE) is refused, with any entities it declares", path=path, line=line
    )


def repaired(data: bytes, path: Path) -> tuple[bytes, list[Remark]]:
    """The content of a file without the faults that concern nothing in it, every line where it was,
    and what was done.

    These are a byte-order mark that is doubled or not at the beginning, an XML declaration that is
    not at the beginning, a DOCTYPE that declares nothing, `--` in comments, attributes that are
    there twice with the same value, and letters of Windows in what should be UTF-8. Encodings in
    which these have other bytes are left alone.
    """
    remarks: list[Remark] = []
    rule, counted, line = rule_of(path), 0, 1

    def note(position: int, message: str) -> None:
        nonlocal counted, line
        if position >= counted:
            counted, line = position, line + data.count(b"\n", counted, position)
            remarks.append(Remark(rule, message, str(path), line))
        else:
            remarks.append(Remark(rule, message, str(path), data.count(b"\n", 0, position) + 1))

    fixed = data
    mark = data.find(
        _BYTE_ORDER_MARK, len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    )
    start = data.find(b"<")
    if 0 <= mark < start:
        note(mark, "a byte-order mark is not at the beginning; it is left out")
        fixed = fixed.replace(_BYTE_ORDER_MARK, b"")
    declaration = _DECLARATION.search(fixed)
    if declaration and fixed[: declaration.start()].removeprefix(_BYTE_ORDER_MARK):
        note(
            data.find(declaration[0]),
            "the XML declaration is not at the beginning; it is read as if it was",
        )
        before = fixed[: declaration.start()].removeprefix(_BYTE_ORDER_MARK)
        fixed = declaration[0] + before + _blank(declaration[0]) + fixed[declaration.end() :]
    doctype = _DOCTYPE.search(fixed)
    if doctype and _BEFORE_DOCTYPE.match(fixed):
        note(
            data.find(doctype[0]),
            "a document type (DOCTYPE) is not allowed; it declares nothing, and is left out",
        )
        fixed = fixed[: doctype.start()] + _blank(doctype[0]) + fixed[doctype.end() :]
    comments = _without_double_hyphens(fixed)
    if comments != fixed:
        position = next(
            i for i, (old, new) in enumerate(zip(fixed, comments, strict=True)) if old != new
        )
        line = fixed.count(b"\n", 0, position) + 1
        remarks.append(
            Remark(
                rule_of(path),
                "there is '--' in a comment; it does not end the comment",
                str(path),
                line,
            )
        )
    single = _in_utf8(_without_doubled_attributes(comments, note), note)
    return _with_prefixes(single, note), remarks


def _with_prefixes(data: bytes, note: Callable[[int, str], None]) -> bytes:
    """The content with its undeclared prefixes of XML namespaces declared in its root, every line
    where it was."""
    if b"\0" in data[:4]:
        return data
    used: dict[bytes, int] = {}
    for tag in _TAG.finditer(data):
        for match in _PREFIX.finditer(tag[0]):
            used.setdefault(match[1], tag.start())
    declared = {b"xml", b"xmlns", *_PREFIX_DECLARED.findall(data)}
    root = _ROOT.search(data)
    for prefix, position in used.items():
        if prefix in declared or root is None:
            continue
        name = prefix.decode(errors="replace")
        note(position, f"the prefix {name!r} is not declared; it is read as if it was")
        # Only the prefix xsi has a meaning for validation (xsi:noNamespaceSchemaLocation).
        uri = _XSI if prefix == b"xsi" else b"urn:undeclared:" + prefix
        data = data[: root.end()] + b" xmlns:" + prefix + b'="' + uri + b'"' + data[root.end() :]
    return data


def _in_utf8(data: bytes, note: Callable[[int, str], None]) -> bytes:
    """The content in UTF-8 where it claims to be and is not, but can be windows-1252."""
    declaration = _DECLARATION.search(data)
    declared = _ENCODING.search(declaration[0]) if declaration else None
    if b"\0" in data[:4] or (declared and declared[1].lower() not in (b"utf-8", b"utf8")):
        return data
    try:
        data.decode()
    except UnicodeDecodeError as error:
        try:
            fixed = data.decode(_OF_WINDOWS).encode()
        except UnicodeDecodeError:
            return data
        note(error.start, f"this is not UTF-8; the file is read as {_OF_WINDOWS}")
        return fixed
    return data


def _without_double_hyphens(data: bytes) -> bytes:
    """The content, of the same length, without `--` in its comments; CDATA sections as they are."""
    parts, position = [], 0
    while (begin := _COMMENT_OR_CDATA.search(data, position)) is not None:
        is_comment = begin[0] == b"<!--"
        end = data.find(b"-->" if is_comment else b"]]>", begin.end())
        if end < 0:
            break
        text = data[begin.end() : end]
        if is_comment:
            text = text.replace(b"--", b"- ")
            text = text[:-1] + b" " if text.endswith(b"-") else text
        parts += [data[position : begin.end()], text]
        position = end
    return b"".join([*parts, data[position:]])


def _without_doubled_attributes(data: bytes, note: Callable[[int, str], None]) -> bytes:
    """The content, of the same length, without repetitions of an attribute of the same value."""

    def once(tag: re.Match[bytes]) -> bytes:
        text, seen = tag[0], set[tuple[bytes, bytes]]()
        parts, kept = [], 0
        for attribute in _ATTRIBUTE.finditer(text):
            given = attribute[1], attribute[2][1:-1]
            if given in seen:
                note(
                    tag.start() + attribute.start(1),
                    f"the attribute {given[0].decode()!r} is there twice, with one value",
                )
                parts += [text[kept : attribute.start()], _blank(attribute[0])]
                kept = attribute.end()
            seen.add(given)
        return b"".join([*parts, text[kept:]]) if parts else text

    return _START_TAG.sub(once, data)


def _blank(text: bytes) -> bytes:
    """Spaces and line breaks of the same shape."""
    return re.sub(rb"[^\r\n]", b" ", text)
