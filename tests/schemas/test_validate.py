"""What the schema rejects is explained: the element, its line, what was expected."""

from __future__ import annotations

import pytest
from lxml import etree

from schemas.common.errors import UsageError
from schemas.validate import at_path
from schemas.versions.registry import SCHEMA_DIR

CASES = {
    "unknown element": (
        "<Init>",
        "<Foo/><Init>",
        "the element Foo is not expected here; expected is Init",
    ),
    "missing attribute": (' author="tests"', "", "missing required attribute 'author'"),
    "unknown attribute": ("<Init>", '<Init foo="1">', "'foo' attribute not allowed"),
    "enumeration": ('conditionEdge="rising"', 'conditionEdge="sideways"', "'rising'"),
    "number": (
        'delay="0"',
        'delay="soon"',
        "a number or a parameter $name or an expression ${…} is expected",
    ),
    "boolean": ('continuous="false"', 'continuous="maybe"', "true or false"),
    "text": ("<Init>", "<Init>hello", "character data"),
    "incomplete": ('<EntityRef entityRef="all"/>', "", "not complete"),
}


@pytest.mark.parametrize(
    "text",
    [
        '<a xmlns="u"><b/><c/><b><d/></b></a>',
        '<p:a xmlns:p="u"><p:b/>text<c/><p:b><d/><!-- d --><d/></p:b></p:a>',
        '<a><b/><c xmlns="u"/><b><\u00e9/><\u00e9/></b></a>',
    ],
    ids=["namespace", "prefix", "mixed"],
)
def test_paths_of_libxml2_lead_to_their_elements(text):
    root = etree.fromstring(text)
    tree, by_name = root.getroottree(), {}
    for element in root.iter(etree.Element):
        assert at_path(tree, tree.getpath(element), by_name) is element
    assert at_path(tree, None, by_name) is root


@pytest.mark.parametrize("old,new,message", CASES.values(), ids=CASES)
def test_violation_is_explained_where_it_is(project, old, new, message):
    line = project.line("scenario", old)
    project.edit("scenario", (old, new))
    problems = [
        problem for problem in project.check("scenario") if problem.rule.endswith("valid_schema")
    ]
    assert message in problems[0].message
    assert problems[0].line in (
        line,
        line - 1,
    )  # what is missing from an element is missing at its start
    assert problems[0].element.startswith("/OpenSCENARIO/")


def test_endless_violations_are_cut_off(project):
    project.edit(
        "scenario", ("<Properties/>", "<Properties>" + "<Property/>" * 500 + "</Properties>")
    )
    found = [
        problem for problem in project.check("scenario") if problem.rule.endswith("valid_schema")
    ]
    assert len(found) == 101
    assert [problem.level for problem in found].count("info") == 1


def test_version_without_schema_is_said_and_never_passed_in_silence(project):
    project.edit("road", ('revMinor="7"', 'revMinor="2"'))
    (problem,) = project.check("road")
    assert (problem.level, problem.line) == ("warning", 3)
    assert "no XSD of OpenDRIVE 1.2 is at hand" in problem.message
    assert SCHEMA_DIR in problem.message


def test_a_road_in_the_namespace_of_asam_is_validated_without_it(project):
    project.edit(
        "road",
        (
            "<OpenDRIVE",
            '<OpenDRIVE xmlns="http://code.asam.net/simulation/standard/opendrive_schema"',
        ),
    )
    (problem,) = project.check("road")
    assert (problem.level, problem.line) == ("warning", 2)
    assert "namespace" in problem.message
    project.edit("road", ("<planView>", "<planVieww/><planView>"))
    assert any(
        problem.level == "error" and "planVieww" in problem.message
        for problem in project.check("road")
    )


def test_rules_run_without_a_schema(project):
    project.edit("road", ('revMinor="7"', 'revMinor="2"'), ('elementId="2"', 'elementId="3"'))
    assert [problem.level for problem in project.check("road")] == ["warning", "error"]


def test_schema_of_xsd_1_1_is_used(project, tmp_path, monkeypatch):
    folder = tmp_path / "xsd"
    folder.mkdir()
    (folder / "core.xsd").write_text(
        '<!-- OpenDRIVE V1.9.0 --><xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">'
        '<xs:element name="OpenDRIVE"><xs:complexType><xs:sequence><xs:any processContents="skip" '
        'maxOccurs="unbounded"/>'
        '</xs:sequence><xs:assert test="count(road) lt '
        '2"/></xs:complexType></xs:element></xs:schema>'
    )
    monkeypatch.setenv(SCHEMA_DIR, str(folder))
    project.edit("road", ('revMinor="7"', 'revMinor="9"'))
    (problem,) = project.check("road")
    assert problem.rule.endswith("valid_schema")
    assert problem.level == "error"


def test_supplied_schema_that_is_broken_is_a_usage_error(project, tmp_path, monkeypatch):
    folder = tmp_path / "xsd"
    folder.mkdir()
    (folder / "core.xsd").write_text(
        '<!-- OpenDRIVE V1.9.0 --><x:schema xmlns:x="http://a"><x:element '
        'name="OpenDRIVE"/></x:schema>'
    )
    monkeypatch.setenv(SCHEMA_DIR, str(folder))
    project.edit("road", ('revMinor="7"', 'revMinor="9"'))
    with pytest.raises(UsageError, match="can't be used"):
        project.check("road")
