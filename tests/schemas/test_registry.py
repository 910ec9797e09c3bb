"""Versions of files, and XSDs for them."""

from __future__ import annotations

import pytest
from lxml import etree

from schemas.common.errors import InvalidFile, UsageError
from schemas.versions.registry import (
    OPENDRIVE,
    OPENSCENARIO,
    SCHEMA_DIR,
    FileType,
    available_schemas,
    detect,
    schema_for,
)


def document(text: str) -> etree._ElementTree:
    return etree.ElementTree(etree.fromstring(text))


@pytest.mark.parametrize(
    "text,expected",
    [
        (
            '<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/></OpenSCENARIO>',
            FileType(OPENSCENARIO, (1, 0), "scenario"),
        ),
        (
            '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3"/><Catalog/></OpenSCENARIO>',
            FileType(OPENSCENARIO, (1, 3), "catalog"),
        ),
        (
            (
                '<OpenSCENARIO><FileHeader revMajor="1" '
                'revMinor="1"/><ParameterValueDistribution/></OpenSCENARIO>'
            ),
            FileType(OPENSCENARIO, (1, 1), "distribution"),
        ),
        (
            '<OpenDRIVE><!-- --><header revMajor="1" revMinor="4"/></OpenDRIVE>',
            FileType(OPENDRIVE, (1, 4), "road"),
        ),
        (
            '<OpenDRIVE xmlns="http://a"><header revMajor=" 1" revMinor="5"/></OpenDRIVE>',
            FileType(OPENDRIVE, (1, 5), "road"),
        ),
    ],
)
def test_standard_version_and_kind_are_detected(text, expected):
    assert detect(document(text)) == expected


@pytest.mark.parametrize(
    "text,reason",
    [
        ("<html/>", "root element"),
        ("<OpenSCENARIO/>", "FileHeader"),
        ('<OpenSCENARIO><FileHeader revMajor="1"/></OpenSCENARIO>', "revMinor"),
        ('<OpenDRIVE><header revMajor="1" revMinor="-4"/></OpenDRIVE>', "revMinor"),
        ('<OpenDRIVE><header revMajor="NaN" revMinor="99999999999"/></OpenDRIVE>', "revMajor"),
    ],
)
def test_anything_else_is_refused(text, reason):
    with pytest.raises(InvalidFile, match=reason):
        detect(document(text))


@pytest.mark.parametrize("minor,patch", [(0, 0), (1, 0), (2, 0), (3, 1), (4, 0)])
def test_every_version_of_openscenario_has_a_schema(minor, patch):
    schema = schema_for(OPENSCENARIO, (1, minor))
    assert schema is not None
    assert schema.version == (1, minor, patch)


def test_opendrive_1_7_has_an_official_schema_and_1_4_has_none(monkeypatch):
    monkeypatch.delenv(SCHEMA_DIR, raising=False)
    assert schema_for(OPENDRIVE, (1, 7)) is not None
    assert [schema.standard for schema in available_schemas()].count(OPENDRIVE) >= 1
    assert schema_for(OPENDRIVE, (0, 9)) is None


XSD = """<?xml version="1.0"?>
<!-- ASAM {name} V{version} -->
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">{extra}
  <xs:element name="{name}"><xs:complexType/></xs:element>
</xs:schema>
"""


def test_schema_dir_supplies_versions_and_wins(tmp_path, monkeypatch):
    folder = tmp_path / "deep" / "inside"
    folder.mkdir(parents=True)
    (folder / "a.xsd").write_text(XSD.format(name=OPENDRIVE, version="1.4.0", extra=""))
    (folder / "b.xsd").write_text(XSD.format(name=OPENDRIVE, version="1.6.0", extra=""))
    (folder / "c.xsd").write_text(XSD.format(name=OPENDRIVE, version="1.6.1", extra=""))
    (folder / "d.xsd").write_text(XSD.format(name=OPENSCENARIO, version="1.3.0", extra=""))
    (folder / "part.xsd").write_text('<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"/>')
    (folder / "binary.xsd").write_bytes(bytes(range(256)))
    monkeypatch.setenv(SCHEMA_DIR, str(tmp_path))
    found = {
        (standard, minor): schema_for(standard, (1, minor))
        for standard, minor in ((OPENDRIVE, 4), (OPENDRIVE, 6), (OPENSCENARIO, 3))
    }
    assert {key: schema.path.name for key, schema in found.items() if schema} == {
        (OPENDRIVE, 4): "a.xsd",
        (OPENDRIVE, 6): "c.xsd",
        (OPENSCENARIO, 3): "d.xsd",
    }
    assert schema_for(OPENDRIVE, (1, 7)) is not None


def test_schema_that_needs_xsd_1_1_is_recognised_by_its_parts(tmp_path, monkeypatch):
    (tmp_path / "part.xsd").write_text(
        '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema"><xs:assert '
        'test="true()"/></xs:schema>'
    )
    (tmp_path / "core.xsd").write_text(
        XSD.format(name=OPENDRIVE, version="1.8.0", extra='<xs:include schemaLocation="part.xsd"/>')
    )
    monkeypatch.setenv(SCHEMA_DIR, str(tmp_path))
    schema = schema_for(OPENDRIVE, (1, 8))
    assert schema is not None
    assert schema.xsd_1_1


def test_schema_dir_that_is_no_folder_is_a_usage_error(tmp_path, monkeypatch):
    monkeypatch.setenv(SCHEMA_DIR, str(tmp_path / "none"))
    with pytest.raises(UsageError, match=SCHEMA_DIR):
        schema_for(OPENDRIVE, (1, 7))
