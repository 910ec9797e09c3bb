"""Results of runs for other programs: JSON, event log, JUnit."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lxml import etree

from runner.recording import LogEntry
from schemas.common.packages import version
from schemas.common.storage import keep
from schemas.common.terminal.text import xml_text

if TYPE_CHECKING:
    from runner.batch.jobs import Outcome
    from runner.judging.result import RunResult, Verdict

_SEVERITY = {"speed": "impact_speed", "delta_v": "delta_v", "risk": "fatality_risk"}
"""Measures of a contact by their short names"""


def summary(result: RunResult) -> dict[str, Any]:
    """Run as a few JSON-able values: scenario, end, reasons, and criticality for the ego."""
    network = result.recording.network
    return {
        "scenario": result.scenario.name,
        "files": {
            "scenario": str(result.scenario.absolute()),
            "road": str(network.path.absolute()) if network is not None else None,
        },
        "parameters": result.parameters,
        "status": result.status,
        "verdict": result.verdict.outcome,
        "reasons": list(result.verdict.reasons),
        "causes": [cause._asdict() for cause in result.verdict.causes],
        "criteria": criteria(result.verdict),
        "evidence": evidence(result.verdict),
        "remarks": list(result.remarks),
        "end_time": result.end_time,
        "ego": result.ego,
        "sut": result.sut,
        "sut_parameters": result.sut_parameters,
        "settings": result.settings,
        "entities": {
            track.name: {
                "kind": track.kind,
                "category": track.category,
                "box": track.box._asdict(),
                "mass": track.mass,
            }
            for track in result.recording.tracks.values()
        },
        "actors": result.actors,
        "criticality": result.criticality.summary if result.criticality is not None else None,
        "version": version(),
    }


def impact(result: RunResult) -> dict[str, Any] | None:
    """The first contact of the ego, as `runner.batch.jobs.Outcome` has it; None without one."""
    from runner.judging.measures.measure import Extreme, measures

    found = result.criticality.impact if result.criticality is not None else None
    if found is None:
        return None
    severity = {key: measures()[name].of(result.criticality) for key, name in _SEVERITY.items()}
    numbers = {key: value.value for key, value in severity.items() if isinstance(value, Extreme)}
    where = {
        "time": found.time,
        "other": found.other,
        "side": found.side,
        "point": list(found.point),
    }
    return numbers | where | {"strikes": found.striking}


def criteria(verdict: Verdict) -> list[dict[str, Any]]:
    """Results of criteria as JSON-able values: result, name, entity, value (null where nothing was
    measured), unit, reason."""
    return [
        {
            "result": criterion.state,
            **{key: value for key, value in criterion._asdict().items() if key != "passed"},
        }
        for criterion in verdict.criteria
    ]


def evidence(verdict: Verdict) -> list[dict[str, Any]]:
    """Evidence as JSON-able values: name, value, planned (null without a plan), unit, least, texts
    on deficits."""
    return [{**row._asdict(), "texts": list(row.texts)} for row in verdict.evidence]


def evidence_text(each: Mapping[str, Any]) -> str:
    """The value of a kind of evidence, as `evidence` gives it, in words."""
    value, unit = each["value"], each["unit"]
    # Shares of a plan are told as counts: 1 of 2 says more than 50 %.
    if each["planned"] is not None:
        return f"{value * each['planned'] if unit == 'share' else value:g} of {each['planned']}"
    if unit == "yes":
        return "yes" if value else "no"
    return f"{value:.1%}" if unit == "share" else f"{value:.2f} {unit}"


def evidence_table(verdict: Verdict) -> list[dict[str, Any]]:
    """Evidence for pages: name, value and least value in words, whether it is enough, how it is
    counted."""
    from runner.judging.evidence.rows import ROWS

    return [
        {
            "name": row["name"],
            "value": evidence_text(row),
            "least": least_text(row["least"], row["unit"]),
            "enough": not row["texts"],
            "meaning": ROWS[row["name"]].meaning if row["name"] in ROWS else "",
        }
        for row in evidence(verdict)
    ]


def least_text(least: float, unit: str) -> str:
    """A least value of evidence in words."""
    if unit == "yes":
        return "yes" if least else "either"
    return f"{least:.4g}" if unit == "share" and least == 1 else f"{least:g} {unit}"


def write_json(values: dict[str, Any], path: Path) -> None:
    """Write JSON that every reader takes: infinite numbers become null."""
    text = json.dumps(finite(values), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    path.write_text(
        text, encoding="utf-8", newline="\n", errors="backslashreplace"
    )  # which is how JSON writes bytes in file names


def finite(value: Any) -> Any:
    """Replace infinite numbers by None, which JSON can hold."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return value


def write_events(events: Iterable[LogEntry], path: Path) -> None:
    """Write the event log, one JSON object a line: time, kind, subject, and the reason or detail as
    text."""
    # `backslashreplace`: names of files may hold bytes that are no UTF-8.
    with path.open("w", encoding="utf-8", errors="backslashreplace") as file:
        for entry in events:
            file.write(
                json.dumps(finite(entry._asdict()), ensure_ascii=False, allow_nan=False) + "\n"
            )


def write_junit(outcomes: Iterable[Outcome], path: Path, inconclusive: str = "skipped") -> None:
    """Write a JUnit file, whole or not at all: a test case a run; a failed verdict is a failure, a
    defect an error.

    An inconclusive run is skipped, or an error, as `inconclusive` says, and so is what a dry run
    has only loaded. The state, evidence and results of criteria are properties of a test case,
    remarks its standard output.
    """
    suites = etree.Element("testsuites", name="xosc-run")
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        # A suite a file, as readers of JUnit group by it.
        groups.setdefault(str(outcome.job.source), []).append(outcome)
    for source, members in groups.items():
        kinds = {
            "failed": "failure",
            "error": "error",
            "inconclusive": inconclusive,
            "loaded": "skipped",
        }
        tags = [kinds.get(member.state) for member in members]
        suite = etree.SubElement(
            suites,
            "testsuite",
            name=xml_text(source),
            tests=str(len(members)),
            failures=str(tags.count("failure")),
            errors=str(tags.count("error")),
            skipped=str(tags.count("skipped")),
        )
        for outcome, tag in zip(members, tags, strict=True):
            case = etree.SubElement(suite, "testcase", classname=xml_text(Path(source).stem))
            case.set("name", xml_text(outcome.job.title))
            case.set("time", f"{outcome.end_time or 0.0:.3f}")
            _add_properties(case, outcome)
            if tag is not None:
                loaded = f"loaded, not run (--dry-run){outcome.message and ': '}{outcome.message}"
                # XML allows few control characters, which messages of other libraries may hold.
                message = xml_text(loaded if outcome.state == "loaded" else outcome.message)
                detail = etree.SubElement(case, tag, message=message)
                if outcome.state in ("inconclusive", "loaded"):
                    detail.set("type", outcome.state)
                detail.text = message
            if outcome.remarks:
                etree.SubElement(case, "system-out").text = xml_text("\n".join(outcome.remarks))
    keep(etree.tostring(suites, pretty_print=True, xml_declaration=True, encoding="UTF-8"), path)


def _add_properties(case: etree._Element, outcome: Outcome) -> None:
    """State, evidence and results of criteria."""
    properties = etree.SubElement(case, "properties")
    found = {"state": outcome.state}
    for row in outcome.evidence:
        found[f"evidence_{row['name']}"] = evidence_text(row)
    for result in outcome.criteria:
        name = " ".join(text for text in (f"criteria_{result['name']}", result["entity"]) if text)
        found[name] = f"{result['result']}: {result['reason']}"
    for name, value in found.items():
        etree.SubElement(properties, "property", name=xml_text(name), value=xml_text(value))
