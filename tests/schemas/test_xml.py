"""Parsing what anyone may send."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from lxml import etree

from schemas.common import storage
from schemas.common.errors import InvalidFile
from schemas.common.xml import line_of, parse

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE lolz [
 <!ENTITY lol "lol">
 <!ENTITY lol2 "&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;">
 <!ENTITY lol3 "&lol2;&lol2;&lol2;&lol2;&lol2;&lol2;&lol2;&lol2;&lol2;&lol2;">
]>
<OpenSCENARIO a="&lol3;">&lol3;</OpenSCENARIO>
"""
EXTERNAL = (
    b"<!-- a comment --><!DOCTYPE a [<!ENTITY secret SYSTEM "
    b'"file:///etc/passwd">]>\n<a>&secret;</a>'
)
REFUSED = {
    "entity bomb": (BOMB, "DOCTYPE"),
    "external entity": (EXTERNAL, "DOCTYPE"),
    "external subset": (b'<!DOCTYPE a SYSTEM "http://example.com/a.dtd"><a/>', "DOCTYPE"),
    "document type in UTF-16": (
        '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE a [<!ENTITY b "c">]><a/>'.encode(
            "utf-16"
        ),
        "DOCTYPE",
    ),
    "undeclared entity": (b"<a>&nowhere;</a>", "nowhere"),
    "truncated": (b'<a>\n<b c="1"', "not well-formed"),
    "unclosed": (b"<a>\n<b></a>", "not well-formed"),
    "binary": (bytes(range(256)) * 8, "not well-formed"),
    "zeros": (bytes(1000), "not well-formed"),
    "text": (b"hello", "not well-formed"),
    "empty": (b"", "the file is empty"),
    "blank": (b" \n\t\n", "the file is empty"),
    "deep nesting": (b"<a>" * 100_000, "depth"),
    "unknown encoding": (b'<?xml version="1.0" encoding="klingon"?><a/>', "encoding"),
    "wrong encoding": (
        b'<?xml version="1.0" encoding="utf-8"?>\n<a b="\xff\xfe"/>',
        "not well-formed",
    ),
    "huge attribute": (
        b'<a b="' + b"x" * 11_000_000 + b'"/>',
        "a tag of more than the 1048576 bytes",
    ),
}


@pytest.mark.parametrize("content,reason", REFUSED.values(), ids=REFUSED)
def test_attack_or_accident_is_one_clear_error(tmp_path, content, reason):
    file = tmp_path / "bad.xosc"
    file.write_bytes(content)
    with pytest.raises(InvalidFile, match=reason) as caught:
        parse(file)
    assert caught.value.path == str(file)
    assert "\n" not in str(caught.value)


def test_errors_name_the_line(tmp_path):
    file = tmp_path / "bad.xosc"
    file.write_bytes(b"<a>\n\n<b></a>")
    with pytest.raises(InvalidFile) as caught:
        parse(file)
    assert caught.value.line == 3


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1"])
def test_encodings_that_are_declared_are_read(tmp_path, encoding):
    file = tmp_path / "good.xosc"
    declared = encoding.removesuffix("-sig")
    file.write_bytes(
        f'<?xml version="1.0" encoding="{declared}"?>\n<a b="Straße"/>'.encode(encoding)
    )
    assert parse(file).getroot().get("b") == "Straße"


def test_missing_file_folder_and_device_are_refused(tmp_path):
    for path, reason in (
        (tmp_path / "none", "no such file"),
        (tmp_path, "folder"),
        (os.devnull, "regular"),
        ("a\0b", "read"),
    ):
        with pytest.raises(InvalidFile, match=reason):
            parse(path)


def test_huge_file_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(storage, "MAX_BYTES", 10)
    file = tmp_path / "big.xosc"
    file.write_bytes(b"<a>" + b" " * 20 + b"</a>")
    with pytest.raises(InvalidFile, match="at most 10 are read"):
        parse(file)


def test_lines_are_right_beyond_65535(tmp_path):
    file = tmp_path / "long.xosc"
    file.write_bytes(b"<a>\n" + b"<b/>\n" * 70_000 + b"<c/></a>")
    assert line_of(parse(file).getroot()[-1]) == 70_002


def test_many_comments_before_the_root_are_no_burden(tmp_path):
    file = tmp_path / "comments.xosc"
    file.write_bytes(b"<!-- - -->\n" * 50_000 + b"<a/>")
    assert parse(file).getroot().tag == "a"


def test_a_shortage_of_memory_of_the_parser_is_no_invalid_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def short(*_: object, **__: object) -> None:
        raise etree.XMLSyntaxError("Memory allocation failed", etree.ErrorTypes.ERR_NO_MEMORY, 1, 1)

    path = tmp_path / "a.xml"
    path.write_text("<a/>")
    monkeypatch.setattr(etree, "parse", short)
    with pytest.raises(MemoryError):
        parse(path)
