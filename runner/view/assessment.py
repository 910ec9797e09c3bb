"""The table of an assessment: each run of a batch held against a protocol, with files, system and
settings for traceability."""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

from runner.batch import inputs
from runner.batch.outputs.folder import RESULT, TRAJECTORIES, load_run
from runner.judging.assessment.profiles import profile
from runner.judging.assessment.protocol import (
    KMH,
    AssessedRun,
    AssessmentProfile,
    FirstContact,
    Judgement,
    ProtocolTest,
)
from runner.judging.settings import RunSettings
from runner.systems.base import split
from runner.view.page import page, write_page
from runner.view.replay.player import REPLAY
from runner.view.report import runs_of
from schemas.common.errors import InvalidFile, ToolchainError, UsageError
from schemas.common.packages import version
from schemas.common.storage import keep, read_object, read_parquet

PAGE, CSV = "assessment.html", "assessment.csv"
"""Names of the two files in the output folder"""
_STYLES = ("base.css", "report.css")
_SCRIPTS = ("dom.js", "axes.js", "assessment.js")
_IDENTITY = "Scenario_ID"
"""Parameter with the short name of a test, as the public Euro NCAP files have it"""


@dataclass(frozen=True)
class RunRow:
    """A run in the table.

    Attributes:
        run: its row in the table of runs.
        test: the test that it is of; None where its file is of none.
        drive: its values and contact.
        judgement: result of the criterion.
        point: test point of the grid; None where it is of none.
    """

    run: Mapping[str, Any]
    test: ProtocolTest | None
    drive: AssessedRun
    judgement: Judgement
    point: tuple[float, ...] | None

    @property
    def available(self) -> float | None:
        """Points of its test point; None without points."""
        return (
            self.test.share(self.point)
            if self.test is not None and self.point is not None
            else None
        )


@dataclass(frozen=True)
class Total:
    """A test over all its runs.

    Attributes:
        test: the test.
        rows: its runs.
        scores: worst score of each test point of the grid that was run; None where one of its runs
            is not assessed.
    """

    test: ProtocolTest
    rows: Sequence[RunRow]
    scores: Mapping[tuple[float, ...], float | None] = field(default_factory=dict)

    @property
    def least(self) -> float:
        """Points if everything that is open fails."""
        return sum(
            self.test.share(point) * score
            for point, score in self.scores.items()
            if score is not None
        )

    @property
    def most(self) -> float:
        """Points if everything that is open passes."""
        lost = (
            self.test.share(point) * (1.0 - score)
            for point, score in self.scores.items()
            if score is not None
        )
        return self.test.points - sum(lost)

    def count(self, result: str) -> int:
        """Number of runs with a result."""
        return sum(row.judgement.result == result for row in self.rows)


def write_assessment(out: Path, name: str, settings: RunSettings) -> tuple[Path, Path]:
    """Write the assessment of a batch as HTML and CSV into its output folder; the same batch gives
    the same bytes.

    Args:
        out: the output folder.
        name: of the profile.
        settings: those of the batch.

    Raises:
        UsageError: there is no such profile, or the folder is not that of a batch.
        InvalidFile: results are damaged.
    """
    protocol = profile(name)
    rows = [_row(run, protocol, out) for run in runs_of(out)]
    totals = [_total(test, [row for row in rows if row.test is test]) for test in protocol.tests]
    digests = _digests(rows, settings)
    write_page(
        out / PAGE,
        page(
            f"{protocol.title} – assessment",
            _STYLES,
            _SCRIPTS,
            _data(protocol, rows, totals, digests, out),
        ),
    )
    keep(_csv(protocol, rows, digests, out).encode("utf-8", "backslashreplace"), out / CSV)
    return out / PAGE, out / CSV


def _row(run: Mapping[str, Any], protocol: AssessmentProfile, out: Path) -> RunRow:
    given = dict(run["parameters"])
    # Variations are named by users: a parameter and the scenario's name tell the test as well.
    stems = (Path(run["file"]).stem, given.get(_IDENTITY, ""), Path(run["scenario"]).stem)
    test = next((found for stem in stems if (found := _test(protocol, stem)) is not None), None)
    drive = AssessedRun(
        _values(Path(run["scenario"]), tuple(sorted(given.items()))),
        _contact(run, out),
        out / run["name"],
        load_run,
    )
    if test is None:
        return RunRow(
            run, None, drive, Judgement(None, "the file is of no test of the protocol"), None
        )
    point = test.point(drive)
    if run["state"] in ("error", "inconclusive"):
        # Without the path: it differs between machines, and the page should not.
        said = str(run["message"]).replace(f"{run['scenario']}:", "line ")
        return RunRow(run, test, drive, Judgement(None, f"{run['state']}: {said}"), point)
    judgement = test.criterion.judge(drive)
    if test.grid and point is None:
        judgement = judgement._replace(reason=f"{judgement.reason}; no test point of the protocol")
    return RunRow(run, test, drive, judgement, point)


def _test(protocol: AssessmentProfile, stem: str) -> ProtocolTest | None:
    """The test of a file's name, or with that short name."""
    return next(
        (test for test in protocol.tests if test.name == stem or re.search(test.files, stem)), None
    )


@cache
def _declared(scenario: Path, given: tuple[tuple[str, str], ...]) -> dict[str, str]:
    import xosc
    from xosc.resolve.parameters import Assignment, ParameterScope

    holder = xosc.load(scenario).node.find("ParameterDeclarations")
    declared = holder.children("ParameterDeclaration") if holder is not None else []
    known = {node.get("name") for node in declared}
    # Values of a distribution may name parameters that the scenario lacks.
    assigned = {name: Assignment(value, UsageError, True) for name, value in given if name in known}
    return {
        parameter.name: parameter.text
        for parameter in ParameterScope(declared, assigned=assigned).own.values()
    }


def _values(scenario: Path, given: tuple[tuple[str, str], ...]) -> dict[str, float | str]:
    """Values of all parameters of a run; only the given ones if the file is gone or damaged."""
    try:
        texts = _declared(scenario, given) | dict(given)
    except (ToolchainError, OSError):
        texts = dict(given)
    return {name: _number(text) for name, text in texts.items()}


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _contact(run: Mapping[str, Any], out: Path) -> FirstContact | None:
    """The first contact of the ego, with its speed at that instant; None without one."""
    other, time, relative = (
        run.get("impact_speed_other"),
        run.get("impact_speed_time"),
        run.get("impact_speed"),
    )
    if other is None or time is None or relative is None:
        return None
    ego = read_object(out / run["name"] / RESULT).get("ego")
    import pyarrow as pa

    path = out / run["name"] / TRAJECTORIES
    try:
        rows = read_parquet(path, ("time", "entity", "speed")).to_pylist()
    except (OSError, ValueError, pa.ArrowException) as error:
        raise InvalidFile(f"the results of a run can't be read: {error}", path=path) from None
    # The impact may lie between two rows: the nearest one counts.
    own = min(
        (row for row in rows if row["entity"] == ego), key=lambda row: abs(row["time"] - time)
    )["speed"]
    return FirstContact(other, time, relative * KMH, abs(own) * KMH)


def _total(test: ProtocolTest, rows: Sequence[RunRow]) -> Total:
    scores: dict[tuple[float, ...], float | None] = {}
    for row in rows:
        if row.point is not None:
            # Repeated points count once, by the worst run, and not at all where one is open.
            found = [row.judgement.score, *([scores[row.point]] if row.point in scores else [])]
            scores[row.point] = (
                None if None in found else min(score for score in found if score is not None)
            )
    return Total(test, rows, scores)


def _digests(rows: Sequence[RunRow], settings: RunSettings) -> dict[str, str]:
    """SHA-256 of all inputs, by path; empty for a missing file."""
    paths: dict[str, None] = {}
    for row in rows:
        scenario = Path(row.run["scenario"])
        try:
            referred = inputs.referred_by(scenario, settings, dict(row.run["parameters"]))
        except (ToolchainError, OSError):
            referred = ()
        paths |= dict.fromkeys(str(path) for path in (Path(row.run["file"]), scenario, *referred))
    return {path: _sha256(Path(path)) for path in sorted(paths)}


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def _outcome(row: RunRow) -> str:
    """Outcome of the run, in a few words."""
    if row.run["state"] in ("error", "inconclusive"):
        return str(row.run["state"])
    return "no contact" if row.drive.contact is None else f"contact with {row.drive.contact.other}"


def _cells(protocol: AssessmentProfile, row: RunRow) -> list[float | str | None]:
    """Values of the profile's columns; of a parameter that the scenario does not have None."""
    return [
        next(
            (row.drive.values[name] for name in column.parameters if name in row.drive.values), None
        )
        for column in protocol.columns
    ]


def _others(protocol: AssessmentProfile, row: RunRow) -> str:
    """Parameters that were given and are in no column."""
    shown = {name for column in protocol.columns for name in column.parameters} | {_IDENTITY}
    return ", ".join(
        f"{name}={value}" for name, value in row.run["parameters"] if name not in shown
    )


def _data(
    protocol: AssessmentProfile,
    rows: Sequence[RunRow],
    totals: Sequence[Total],
    digests: Mapping[str, str],
    out: Path,
) -> dict[str, Any]:
    """Data of the page."""
    return {
        "title": protocol.title,
        "batch": out.resolve().name,
        "sources": protocol.sources,
        "assumptions": protocol.assumptions,
        "columns": [column.title for column in protocol.columns],
        "tests": [_summary(total) for total in totals],
        "absent": [
            {"name": absence.name, "points": absence.points, "reason": absence.reason}
            for absence in protocol.absent
        ],
        "rows": [
            {
                "test": row.test.name if row.test is not None else None,
                "name": row.run["name"],
                "cells": _cells(protocol, row),
                "others": _others(protocol, row),
                "seed": row.run["seed"],
                "outcome": _outcome(row),
                "state": row.run["state"],
                "result": row.judgement.result,
                "colour": row.judgement.colour,
                "reason": row.judgement.reason,
                "point": row.point,
                "available": row.available,
                "points": _points(row),
                "file": row.run["file"],
                "replay": f"{row.run['name']}/{REPLAY}"
                if (out / row.run["name"] / REPLAY).is_file()
                else None,
            }
            for row in rows
        ],
        "trace": _trace(rows, out),
        "files": [{"path": path, "sha256": digest} for path, digest in digests.items()],
    }


def _points(row: RunRow) -> float | None:
    return (
        None
        if row.available is None or row.judgement.score is None
        else row.available * row.judgement.score
    )


def _summary(total: Total) -> dict[str, Any]:
    test = total.test
    return {
        "name": test.name,
        "title": test.title,
        "clause": test.clause,
        "criterion": test.criterion.text,
        "remark": test.remark or getattr(test.criterion, "reason", ""),
        "runs": len(total.rows),
        "results": {
            result: total.count(result)
            for result in ("met", "partly met", "not met", "not assessed")
        },
        "grid": {name: list(weights) for name, weights in test.grid.items()},
        "size": test.size,
        "covered": len(total.scores),
        "points": test.points,
        "least": total.least,
        "most": total.most,
    }


def _trace(rows: Sequence[RunRow], out: Path) -> dict[str, str]:
    """Tool, system under test and settings; the system's parameters as stated by runs."""
    results = (out / row.run["name"] / RESULT for row in rows if row.run["state"] != "error")
    # Runs state the parameters as they were in force, the batch only those that were given.
    first = next((read_object(path) for path in results if path.is_file()), {})
    settings = read_object(out / "batch.json")
    stated = first.get("sut_parameters") or split(str(settings.get("sut")))[1]
    return {
        "tool": f"xosc-toolchain {version()}",
        "toolchain's code (BLAKE2b)": inputs.program(inputs.OURS),
        "system under test": str(settings.get("sut")),
        "its parameters": ", ".join(f"{name}={value}" for name, value in stated.items())
        or "none stated",
        **{name: str(value) for name, value in settings.items() if name != "sut"},
    }


def _csv(
    protocol: AssessmentProfile, rows: Sequence[RunRow], digests: Mapping[str, str], out: Path
) -> str:
    """One line a run, with the file's digest, tool and system in each."""
    trace = _trace(rows, out)
    heads = [
        "protocol",
        "test",
        "clause",
        "run",
        *(column.title for column in protocol.columns),
        "other parameters",
        "seed",
    ]
    heads += [
        "outcome",
        "time of contact (s)",
        "relative impact speed (km/h)",
        "ego impact speed (km/h)",
        "criterion",
        "result",
    ]
    heads += [
        "colour",
        "points available",
        "points",
        "reason",
        "file",
        "sha256",
        "scenario",
        "scenario sha256",
    ]
    heads += ["tool", "system under test"]
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    for row in rows:
        test, contact = row.test, row.drive.contact
        measured = (
            ("", "", "")
            if contact is None
            else (f"{contact.time:.2f}", f"{contact.relative:.2f}", f"{contact.own:.2f}")
        )
        cells = [
            "" if cell is None else f"{cell:g}" if isinstance(cell, float) else cell
            for cell in _cells(protocol, row)
        ]
        points = [
            "" if value is None else f"{value:.4f}" for value in (row.available, _points(row))
        ]
        files = [
            text
            for path in (row.run["file"], row.run["scenario"])
            for text in (path, digests.get(path, ""))
        ]
        writer.writerow(
            [
                protocol.title, test.name if test else "", test.clause if test else "",
                row.run["name"], *cells,
                _others(protocol, row), row.run["seed"], _outcome(row), *measured,
                test.criterion.text if test else "",
                row.judgement.result, row.judgement.colour, *points, row.judgement.reason, *files,
                trace["tool"],
                trace["system under test"],
            ]
        )  # fmt: skip
    return text.getvalue()
