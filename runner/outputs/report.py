"""Results of runs for other programs: JSON, event log, JUnit."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lxml import etree

from runner.interpreter.event_log import LogEntry
from schemas.packages import version

if TYPE_CHECKING:
    from runner.batch.jobs import Outcome
    from runner.interpreter.result import RunResult, Verdict


def summary(result: RunResult) -> dict[str, Any]:
    """A run in a few JSON-able values: what ran, how it ended, why, and how critical it was for the ego."""
    network = result.recording.network
    return {
        "scenario": result.scenario.name,
        "files": {
            "scenario": str(result.scenario.absolute()),
            "road": str(network.path.absolute()) if network is not None else None,
        },
        "parameters": result.parameters,
        "status": result.status,
        "verdict": "passed" if result.verdict.passed else "failed",
        "reasons": list(result.verdict.reasons),
        "criteria": criteria(result.verdict),
        "remarks": list(result.remarks),
        "end_time": result.end_time,
        "ego": result.ego,
        "sut": result.sut,
        "sut_parameters": result.sut_parameters,
        "settings": result.settings,
        "entities": {
            track.name: {"kind": track.kind, "category": track.category, "box": track.box._asdict()}
            for track in result.recording.tracks.values()
        },
        "actors": result.actors,
        "criticality": result.criticality.summary if result.criticality is not None else None,
        "version": version(),
    }


def criteria(verdict: Verdict) -> list[dict[str, Any]]:
    """Results of criteria as JSON-able values: result, name, entity, value (null where nothing was measured), unit, reason."""
    return [
        {"result": each.state, **{key: value for key, value in each._asdict().items() if key != "passed"}}
        for each in verdict.criteria
    ]


def write_json(values: dict[str, Any], path: Path) -> None:
    """Write JSON that every reader takes: infinite numbers become null."""
    text = json.dumps(finite(values), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    path.write_text(
        text, encoding="utf-8", newline="\n", errors="backslashreplace"
    )  # which is how JSON writes bytes in file names


def finite(value: Any) -> Any:
    """The same values with infinite numbers as None, which JSON can hold."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return value


def write_events(events: Iterable[LogEntry], path: Path) -> None:
    """Write the event log, one JSON object a line: time, kind, subject, and the reason or detail as text."""
    with path.open("w", encoding="utf-8", errors="backslashreplace") as file:
        for entry in events:
            file.write(json.dumps(finite(entry._asdict()), ensure_ascii=False, allow_nan=False) + "\n")


def write_junit(outcomes: Iterable[Outcome], path: Path) -> None:
    """Write a JUnit file: one test case a run; a failed verdict is a failure, a defect of file or run an error.

    Results of criteria are properties of their test case, remarks its standard output.
    """
    suites = etree.Element("testsuites", name="xosc-run")
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(str(outcome.job.source), []).append(outcome)
    for source, members in groups.items():
        counts = {state: str(sum(o.state == state for o in members)) for state in ("failed", "error")}
        suite = etree.SubElement(
            suites,
            "testsuite",
            name=_printable(source),
            tests=str(len(members)),
            failures=counts["failed"],
            errors=counts["error"],
        )
        for outcome in members:
            case = etree.SubElement(suite, "testcase", classname=_printable(Path(source).stem))
            case.set("name", _printable(outcome.job.title))
            case.set("time", f"{outcome.end_time or 0.0:.3f}")
            _add_criteria(case, outcome.criteria)
            if outcome.state in ("failed", "error"):
                tag = "failure" if outcome.state == "failed" else "error"
                detail = etree.SubElement(case, tag, message=_printable(outcome.message))
                detail.text = _printable(outcome.message)
            if outcome.remarks:
                etree.SubElement(case, "system-out").text = _printable("\n".join(outcome.remarks))
    path.write_bytes(etree.tostring(suites, pretty_print=True, xml_declaration=True, encoding="UTF-8"))


def _add_criteria(case: etree._Element, results: list[dict[str, Any]]) -> None:
    properties = etree.SubElement(case, "properties") if results else case
    for result in results:
        name = " ".join(text for text in (f"criteria_{result['name']}", result["entity"]) if text)
        etree.SubElement(
            properties, "property", name=_printable(name), value=_printable(f"{result['result']}: {result['reason']}")
        )


def _printable(text: str) -> str:
    """Text without the characters that XML 1.0 can't hold."""
    return "".join(
        c if c in "\t\n" or (c >= " " and c not in "\ufffe\uffff" and not "\ud800" <= c <= "\udfff") else "?" for c in text
    )
