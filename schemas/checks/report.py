"""Reports of a check: text for people, JSON for scripts, JUnit for CI, xqar for ASAM's tools, SARIF
for code hosts."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lxml import etree

from schemas.checks import LEVELS, LIMITS, Problem
from schemas.checks.osi import OsiRule, all_osi_rules
from schemas.checks.registry import RegisteredRule, all_rules
from schemas.common.packages import version
from schemas.common.terminal.text import one_line, sarif_text, xml_text
from schemas.osi.traces import SUFFIXES

TOOL = "xosc-check"

Results = Sequence[tuple[Path, Sequence[Problem]]]
"""The checked files with their problems, in the order of checking."""

_STANDARDS = {".xodr": "xodr", **dict.fromkeys(SUFFIXES, "osi")}
"""Standards of files without a problem by their endings; all others are scenarios"""
_XQAR_LEVELS = {"error": "1", "warning": "2", "info": "3"}
_SARIF_LEVELS = {"error": "error", "warning": "warning", "info": "note"}
_LIMITED = "A file must be checked within the limits of time and memory."
_SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def summary(results: Results) -> str:
    """One line: files checked, files sound, problems by level."""
    counts = Counter(problem.level for _, problems in results for problem in problems)
    accepted = sum(
        not any(problem.level == "error" for problem in problems) for _, problems in results
    )
    levels = ", ".join(
        f"{counts[level]} {level}{'s' * (counts[level] != 1 and level != 'info')}"
        for level in LEVELS
    )
    return f"{len(results)} file{'s' * (len(results) != 1)} checked, {accepted} accepted: {levels}"


def text(results: Results) -> str:
    """One line a problem, `file:line: level: message [rule]`, then the summary."""
    # One line each, whatever a file's names hold: line breaks in them could forge further reports.
    lines = [
        one_line(f"{problem} [{problem.rule}]") for _, problems in results for problem in problems
    ]
    return "\n".join([*lines, summary(results)]) + "\n"


def as_json(results: Results) -> str:
    """An object with the tool, its version, and per file whether it is accepted
    and its problems.
    """
    files = [
        {
            "path": str(path),
            "accepted": not any(problem.level == "error" for problem in problems),
            "problems": [
                {
                    "rule": p.rule,
                    "level": p.level,
                    "message": p.message,
                    "line": p.line,
                    "element": p.element,
                }
                for p in problems
            ],
        }
        for path, problems in results
    ]
    return (
        json.dumps(
            {"tool": TOOL, "version": version(), "files": files}, indent=2, ensure_ascii=False
        )
        + "\n"
    )


def junit(results: Results) -> str:
    """A test suite with one case a file: it fails on errors; warnings and infos are its output."""
    failures = sum(any(problem.level == "error" for problem in problems) for _, problems in results)
    # No errors by JUnit's meaning: a defect of the checker is a problem of the file in this report.
    totals = {"tests": str(len(results)), "failures": str(failures), "errors": "0"}
    root = etree.Element("testsuites", {"name": TOOL, **totals})
    suite = etree.SubElement(root, "testsuite", {"name": TOOL, **totals, "skipped": "0"})
    for path, problems in results:
        case = etree.SubElement(
            suite,
            "testcase",
            {"classname": xml_text(str(path.parent)), "name": xml_text(path.name)},
        )
        errors = [problem for problem in problems if problem.level == "error"]
        if errors:
            # CI pages show this alone; the text below has them all.
            message = errors[0].message if len(errors) == 1 else f"{len(errors)} errors"
            failure = etree.SubElement(
                case, "failure", {"type": errors[0].rule, "message": xml_text(message)}
            )
            failure.text = xml_text("\n".join(one_line(str(error)) for error in errors))
        others = [problem for problem in problems if problem.level != "error"]
        if others:
            etree.SubElement(case, "system-out").text = xml_text(
                "\n".join(one_line(str(finding)) for finding in others)
            )
    return _serialised(root)


def xqar(results: Results) -> str:
    """ASAM's quality checker result format: one checker bundle a file, one checker a rule."""
    root = etree.Element("CheckerResults", {"version": "1.0.0"})
    for path, problems in results:
        attributes = {
            "name": TOOL,
            "version": version(),
            "description": "Official schemas and semantic rules of OpenSCENARIO and OpenDRIVE",
            "build_date": "",
            "summary": xml_text(summary([(path, problems)])),
        }
        bundle = etree.SubElement(root, "CheckerBundle", attributes)
        etree.SubElement(bundle, "Param", {"name": "InputFile", "value": xml_text(str(path))})
        # A file with problems tells its standard by their rules; a sound one only by its ending.
        standards = {problem.rule.split(":")[1] for problem in problems}
        standard = min(standards, default=_STANDARDS.get(path.suffix.lower(), "xosc"))
        # Numbered over the whole bundle, by object: two problems may be equal.
        numbers = {id(problem): str(number) for number, problem in enumerate(problems)}
        # Each rule, those without an issue too: by them the format says what was checked.
        for uid, description in _rules(standard):
            own = [problem for problem in problems if problem.rule == uid]
            if uid == LIMITS and not own:
                continue
            _xqar_checker(
                bundle,
                uid,
                description,
                own,
                numbers,
            )
    return _serialised(root)


def _xqar_checker(
    bundle: etree._Element,
    uid: str,
    description: str,
    problems: Sequence[Problem],
    numbers: dict[int, str],
) -> None:
    checker_id = "check_" + uid.replace(":", "_").replace(".", "_")
    attributes = {
        "checkerId": checker_id,
        "description": description,
        "status": "completed",
        "summary": f"{len(problems)} issue(s) found" if problems else "",
    }
    checker = etree.SubElement(bundle, "Checker", attributes)
    etree.SubElement(checker, "AddressedRule", {"ruleUID": uid})
    for problem in problems:
        message = xml_text(problem.message)
        attributes = {
            "issueId": numbers[id(problem)],
            "description": message,
            "level": _XQAR_LEVELS[problem.level],
            "ruleUID": uid,
        }
        issue = etree.SubElement(checker, "Issue", attributes)
        if problem.line is not None or problem.element is not None:
            locations = etree.SubElement(issue, "Locations", {"description": message})
            if problem.line is not None:
                etree.SubElement(
                    locations, "FileLocation", {"row": str(problem.line), "column": "0"}
                )
            if problem.element is not None:
                etree.SubElement(locations, "XMLLocation", {"xpath": problem.element})


def sarif(results: Results) -> str:
    """SARIF 2.1.0, which code hosts show beside the lines."""
    rules = _rules(None)
    indices = {uid: index for index, (uid, _) in enumerate(rules)}
    driver = {
        "name": TOOL,
        "version": version(),
        "rules": [
            {"id": uid, "shortDescription": {"text": description}} for uid, description in rules
        ],
    }
    reported = [
        _sarif_result(problem, indices[problem.rule])
        for _, problems in results
        for problem in problems
    ]
    run = {"tool": {"driver": driver}, "columnKind": "utf16CodeUnits", "results": reported}
    return (
        json.dumps(
            {"$schema": _SARIF_SCHEMA, "version": "2.1.0", "runs": [run]},
            indent=2,
            ensure_ascii=False,
        )
        + "\n"
    )


def _sarif_result(problem: Problem, index: int) -> dict[str, Any]:
    path = Path(problem.path)
    # Relative paths stay relative, as code hosts look them up in the repository.
    uri = path.as_uri() if path.is_absolute() else quote(path.as_posix(), errors="replace")
    location: dict[str, Any] = {"physicalLocation": {"artifactLocation": {"uri": uri}}}
    if problem.line is not None:
        location["physicalLocation"]["region"] = {"startLine": problem.line}
    if problem.element is not None:
        # The path in the document stays right when lines shift between two revisions.
        location["logicalLocations"] = [{"fullyQualifiedName": problem.element, "kind": "element"}]
    return {
        "ruleId": problem.rule,
        "ruleIndex": index,
        "level": _SARIF_LEVELS[problem.level],
        "message": {"text": sarif_text(problem.message)},
        "locations": [location],
    }


def _rules(standard: str | None) -> list[tuple[str, str]]:
    """Uid and description of the rules of a standard, "xosc", "xodr" or "osi"; of all where it is
    None."""
    rules: list[RegisteredRule | OsiRule] = [*all_rules(), *all_osi_rules()]
    # Limits are no rule, but problems under their uid have to find a place in each report.
    described = [(LIMITS, _LIMITED), *((rule.uid, rule.description) for rule in rules)]
    return [
        (uid, description)
        for uid, description in described
        if standard in (None, uid.split(":")[1])
    ]


def _serialised(root: etree._Element) -> str:
    return str(etree.tostring(root, encoding="unicode", pretty_print=True))


FORMATS = {"text": text, "json": as_json, "junit": junit, "xqar": xqar, "sarif": sarif}
"""Report formats by the names that the command line knows."""


def listing(rules: Sequence[RegisteredRule | OsiRule]) -> str:
    """The rules, one line each: level, uid, description."""
    return "".join(f"{rule.level:<8}{rule.uid}\n        {rule.description}\n" for rule in rules)
