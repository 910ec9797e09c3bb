"""Reports, read back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lxml import etree

from schemas import Problem
from schemas.checks import LIMITS
from schemas.checks.registry import all_rules
from schemas.checks.report import FORMATS, summary

ERROR = Problem(
    "asam.net:xosc:1.0.0:xml.valid_schema",
    "error",
    "<bad> & worse",
    "dir/a b.xosc",
    7,
    "/OpenSCENARIO/Init",
)
WARNING = Problem(
    "xosc.toolchain:xosc:1.0.0:scenario_logic.condition_is_not_constant",
    "warning",
    "never",
    "dir/a b.xosc",
    9,
    "/x",
)
MISSING = Problem(
    "asam.net:xodr:1.0.0:xml.valid_xml_document", "error", "no such\x00file\x1b", "c.xodr"
)
RESULTS = [
    (Path("dir/a b.xosc"), [ERROR, WARNING]),
    (Path("sound.xosc"), []),
    (Path("c.xodr"), [MISSING]),
]


def test_text_has_a_line_a_problem_and_a_summary():
    lines = FORMATS["text"](RESULTS).splitlines()
    assert lines[0] == "dir/a b.xosc:7: error: <bad> & worse [asam.net:xosc:1.0.0:xml.valid_schema]"
    assert len(lines) == 4
    assert (
        lines[-1] == summary(RESULTS) == "3 files checked, 1 accepted: 2 errors, 1 warning, 0 info"
    )


def test_json_holds_everything():
    report = json.loads(FORMATS["json"](RESULTS))
    assert [file["accepted"] for file in report["files"]] == [False, True, False]
    assert report["files"][0]["problems"][0] == {
        "rule": ERROR.rule,
        "level": "error",
        "message": "<bad> & worse",
        "line": 7,
        "element": "/OpenSCENARIO/Init",
    }


def test_junit_fails_files_with_errors():
    root = etree.fromstring(FORMATS["junit"](RESULTS))
    suite = root.find("testsuite")
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("3", "2", "0")
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases] == ["a b.xosc", "sound.xosc", "c.xodr"]
    assert [case.find("failure") is not None for case in cases] == [True, False, True]
    assert "warning: never" in cases[0].findtext("system-out")


def test_xqar_has_a_bundle_a_file_and_a_checker_a_rule():
    root = etree.fromstring(FORMATS["xqar"](RESULTS))
    assert root.tag == "CheckerResults"
    first, second, third = root.findall("CheckerBundle")
    assert first.find("Param").attrib == {"name": "InputFile", "value": "dir/a b.xosc"}
    rules = {each.get("ruleUID") for each in first.iter("AddressedRule")}
    assert rules == {rule.uid for rule in all_rules() if rule.uid.split(":")[1] == "xosc"}
    issues = list(first.iter("Issue"))
    assert [(issue.get("ruleUID"), issue.get("level")) for issue in issues] == [
        (ERROR.rule, "1"),
        (WARNING.rule, "2"),
    ]
    assert len({issue.get("issueId") for issue in issues}) == 2
    for issue in issues:
        addressed = issue.getparent().find("AddressedRule").get("ruleUID")
        assert addressed == issue.get("ruleUID")
    assert issues[0].find("Locations/FileLocation").get("row") == "7"
    assert issues[0].find("Locations/XMLLocation").get("xpath") == "/OpenSCENARIO/Init"
    assert list(second.iter("Issue")) == []
    assert [issue.find("Locations") for issue in third.iter("Issue")] == [None]


def test_sarif_is_version_2_1_0_with_rules_and_places():
    report = json.loads(FORMATS["sarif"](RESULTS))
    assert report["version"] == "2.1.0"
    (run,) = report["runs"]
    rules = run["tool"]["driver"]["rules"]
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
    assert [result["level"] for result in run["results"]] == ["error", "warning", "error"]
    place = run["results"][0]["locations"][0]
    assert place["physicalLocation"] == {
        "artifactLocation": {"uri": "dir/a%20b.xosc"},
        "region": {"startLine": 7},
    }
    assert place["logicalLocations"][0]["fullyQualifiedName"] == "/OpenSCENARIO/Init"


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_beyond_the_limits_is_in_each_report(name):
    problem = Problem(LIMITS, "error", "it takes longer than 3 s", "a.xodr")
    assert "it takes longer than 3 s" in FORMATS[name]([(Path("a.xodr"), [problem])])


@pytest.mark.parametrize("name", FORMATS)
def test_nothing_checked_is_a_report_as_well(name):
    assert FORMATS[name]([])
