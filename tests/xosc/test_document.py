"""Reading, caching and writing documents."""

from __future__ import annotations

import os

import pytest

import xosc
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from xosc.document.node import LINE, SOURCE

DISTRIBUTION = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-05-31T12:00:00" description="" author=""/>
<ParameterValueDistribution><ScenarioFile filepath="a.xosc"/><Deterministic/></ParameterValueDistribution></OpenSCENARIO>"""


@pytest.mark.parametrize("minor", range(4))
def test_every_version_is_read(scenario, minor):
    document = xosc.load(scenario(minor=minor))
    assert (document.version, document.kind) == ((1, minor), "scenario")
    assert document.node.need("FileHeader").line == 3


def test_kinds_are_told_apart(catalog, tmp_path):
    path = tmp_path / "distribution.xosc"
    path.write_text(DISTRIBUTION)
    assert xosc.load(path).kind == "distribution"
    assert xosc.load(catalog("catalog.xosc", "")).kind == "catalog"


@pytest.mark.parametrize(("major", "minor"), [(0, 9), (2, 0)])
def test_other_versions_are_refused_by_name(tmp_path, major, minor):
    path = tmp_path / "old.xosc"
    path.write_text(
        f'<OpenSCENARIO><FileHeader revMajor="{major}" revMinor="{minor}"/></OpenSCENARIO>'
    )
    with pytest.raises(Unsupported, match=rf"OpenSCENARIO {major}\.{minor}"):
        xosc.load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "empty"),
        ("no xml", "not well-formed"),
        ("<OpenSCENARIO/>", "FileHeader"),
        ('<OpenDRIVE><header revMajor="1" revMinor="4"/></OpenDRIVE>', "this is OpenDRIVE"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><OpenSCENARIO/>', "DOCTYPE"),
    ],
)
def test_what_is_no_openscenario_is_an_invalid_file(tmp_path, content, message):
    path = tmp_path / "bad.xosc"
    path.write_text(content)
    with pytest.raises(InvalidFile, match=message):
        xosc.load(path)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(InvalidFile, match=r"nowhere\.xosc"):
        xosc.load(tmp_path / "nowhere.xosc")


def test_byte_order_mark_comments_and_xsi_attributes_are_accepted(scenario):
    path = scenario()
    text = path.read_text().replace(
        "<OpenSCENARIO>",
        '<!-- licence --><OpenSCENARIO xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:noNamespaceSchemaLocation="OpenSCENARIO.xsd">',
    )
    path.write_text(text, encoding="utf-8-sig")
    resolved = xosc.resolve(xosc.load(path))
    copy = path.with_name("copy.xosc")
    xosc.write(resolved, copy)
    assert "<!-- licence -->" in copy.read_text()
    assert 'xsi:noNamespaceSchemaLocation="OpenSCENARIO.xsd"' in copy.read_text()


def test_documents_are_cached_until_the_file_changes(scenario):
    path = scenario()
    first = xosc.load(path)
    assert xosc.load(path) is first
    os.utime(path, ns=(1, 1))
    assert xosc.load(path) is not first


def test_a_file_cannot_pretend_to_come_from_a_catalogue(scenario):
    path = scenario(
        entities=f'<x xmlns:t="{SOURCE[1:].split("}")[0]}" t:source="/etc/passwd" t:line="many"/>'
    )
    node = xosc.load(path).node.need("Entities", "x")
    assert (node.path, node.line, node.element.get(LINE)) == (path, 8, None)


def test_writing_gives_the_same_bytes_without_our_attributes(scenario, catalog, tmp_path):
    catalog("cars/cars.xosc", '<Vehicle name="car"/>', name="Cars")
    path = scenario(
        locations='<VehicleCatalog><Directory path="cars"/></VehicleCatalog>',
        entities='<ScenarioObject name="Ägo"><CatalogReference catalogName="Cars" '
        'entryName="car"/></ScenarioObject>',
    )
    resolved = xosc.resolve(xosc.load(path))
    first, second = tmp_path / "first.xosc", tmp_path / "second.xosc"
    xosc.write(resolved, first)
    xosc.write(xosc.load(first), second)
    assert first.read_bytes() == second.read_bytes()
    assert "urn:xosc-toolchain" not in first.read_text("utf-8")
    assert '    <ScenarioObject name="Ägo">\n      <Vehicle name="car"/>' in first.read_text(
        "utf-8"
    )


def test_an_unwritable_file_is_a_usage_error(scenario, tmp_path):
    with pytest.raises(UsageError, match="the file can't be written"):
        (tmp_path / "file").write_text("")
        xosc.write(xosc.load(scenario()), tmp_path / "file" / "folder.xosc")


def test_elements_with_names_that_xpath_does_not_take_are_read(scenario):
    path = scenario(storyboard='<a:b xmlns:a="urn:&apos;x"/><\u00e4\u0301 b="${"/>')
    assert xosc.load(path).kind == "scenario"
