"""Dry runs: files loaded, compiled and brought to time 0; triage of foreign files by them.

Triage gives one row a file: fine, playing with repairs, testing nothing, or refused and by which
cause. `xosc-check --triage` loads this module by its name, for checking is a floor below running.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import combinations_with_replacement, groupby
from pathlib import Path
from typing import Any

import xosc
from runner.batch.batch import each, lost
from runner.batch.jobs import Job, Outcome, assumed, failure, jobs_of
from runner.judging.result import INCONCLUSIVE
from runner.judging.settings import RunSettings
from runner.view.page import page
from schemas.checks import Problem
from schemas.checks.checker import check_many
from schemas.common.errors import ExitCode, ToolchainError, describe, gravest
from schemas.common.packages import version
from schemas.common.policy import limited
from schemas.common.remarks import BREACH
from schemas.common.terminal.text import many, one_line, shown
from xodr.reader import load as load_road
from xosc.distributions.space import Selection

ALL = 100
"""Number of parameter sets of a file that are rehearsed whatever their values are."""
_TOLD = 20
"""Sets between two reports of progress"""


def rehearse_batch(
    jobs: Iterable[Job | Outcome],
    settings: RunSettings,
    processes: int = 1,
    working: Callable[[int], None] = lambda _: None,
) -> Generator[Outcome]:
    """Load, resolve, compile and begin files; one outcome a file, the gravest of its
    sets. `working` is called with the number of sets so far.

    What a set can break is decided by one of its values or by two that meet, as a rule. Of a file
    with more than `ALL` sets those that follow are rehearsed where two of their values meet for the
    first time (pairwise testing: Kuhn, Wallace, Gallo, Software Fault Interactions and Implications
    for Software Testing, IEEE Transactions on Software Engineering 30, 2004).
    """
    chosen = Pairwise(jobs)
    with closing(
        each(iter(chosen), partial(_compiled, settings=settings), lost, processes)
    ) as outcomes:
        counted = _counted(outcomes, working)
        for _, group in groupby(counted, key=lambda outcome: outcome.job.source):
            yield _rehearsed(group, chosen.sets)


def _counted(outcomes: Iterable[Outcome], working: Callable[[int], None]) -> Iterator[Outcome]:
    for count, outcome in enumerate(outcomes, 1):
        if count % _TOLD == 0:
            working(count)
        yield outcome


class Pairwise:
    """Jobs with a new pair of parameter values, and the first `ALL` jobs of a file.

    Attributes:
        sets: how many sets of each file there have been, those left out among them.
    """

    def __init__(self, jobs: Iterable[Job | Outcome]) -> None:
        self._jobs = jobs
        self.sets: Counter[Path] = Counter()

    def __iter__(self) -> Iterator[Job | Outcome]:
        met: set[tuple[tuple[str, str], tuple[str, str]]] = set()
        source: Path | None = None
        for job in self._jobs:
            if isinstance(job, Outcome):
                self.sets[job.job.source] += 1
                yield job
                continue
            # Pairs are those of one file: values of others decide nothing.
            if job.source != source:
                source = job.source
                met.clear()
            self.sets[source] += 1
            # With replacement: a value by itself is a pair, too.
            pairs = set(combinations_with_replacement(job.parameters.items(), 2))
            if self.sets[source] <= ALL or not pairs <= met:
                met |= pairs
                yield job


def _rehearsed(outcomes: Iterable[Outcome], sets: Counter[Path]) -> Outcome:
    """Combine the outcomes of a file's parameter sets."""
    first, count, failures, remarks = None, 0, list[Outcome](), dict[str, None]()
    for outcome in outcomes:
        count += 1
        first = first or outcome.job
        if outcome.exit_code:
            # One traceback tells the defect: sets of a file mostly fail alike.
            failures.append(replace(outcome, trace="" if failures else outcome.trace))
        remarks |= dict.fromkeys(outcome.remarks)
    assert first is not None
    varied = first.source != first.scenario
    name = first.name.rpartition("~")[0] or first.name if varied else first.name
    job = Job(name, first.source, first.scenario)
    # Sets without a new pair were never worked out: their number is that of the file.
    every = sets[first.source]
    pairwise = f", {count:,} loaded, with every pair of values" if count < every else ""
    if not failures:
        said = f"{many(every, 'parameter set')}{pairwise}" * varied
        return Outcome(job, "loaded", 0, said, status="compiled", remarks=[*remarks])
    worst = gravest(outcome.exit_code for outcome in failures)
    first_worst = next(outcome for outcome in failures if outcome.exit_code == worst)
    share = f"{len(failures)} of {count} parameter sets: " if count > 1 else ""
    remarks = {remark: None for remark in remarks if remark not in first_worst.message}
    return replace(first_worst, job=job, message=share + first_worst.message, remarks=[*remarks])


def _compiled(job: Job, settings: RunSettings) -> Outcome:
    from runner.judging.evidence.rows import causes_of
    from runner.judging.execution import prepare

    try:
        assumptions = assumed(job, settings.strict)
        with limited():
            prepared = prepare(job.scenario, job.parameters, settings)
            begun = prepared.rehearse(settings)
    except Exception as error:  # a defect of ours is an outcome too, the other files go on
        return failure(job, error)
    causes = tuple(dict.fromkeys((*causes_of(assumptions), *begun.causes)))
    told = dict.fromkeys(cause.text for cause in causes)
    remarks = [
        one_line(remark)
        for remark in (*map(str, assumptions), *begun.remarks)
        if remark not in told
    ]
    if not causes:
        return Outcome(job, "loaded", ExitCode.PASSED, status="compiled", remarks=remarks)
    message, names = (
        one_line("; ".join(shown([*told]))),
        [*dict.fromkeys(cause.name for cause in causes)],
    )
    return Outcome(
        job, INCONCLUSIVE, ExitCode.INCONCLUSIVE, message, "compiled", remarks=remarks, causes=names
    )


FINE, REPAIRED, NOTHING, REFUSED = "fine", "plays with repairs", "tests nothing", "refused"
GROUPS = {
    FINE: "accepted by the rules, and loaded as it is",
    REPAIRED: "breaks its standard, and is loaded all the same: what is assumed is named",
    NOTHING: "loads, but a run of it is inconclusive: its scene does not take place",
    REFUSED: "is not loaded",
}
"""Groups of files with their meaning, the best first"""
_SETS = 20
"""Parameter sets of a variation file that are tried, drawn by a fixed seed"""
_PLACE = re.compile(
    r"^(?:\d+ of \d+ parameter sets: )?(?:(?P<path>\S.*?\.xo(?:sc|dr))(?::(?P<line>\d+))?: )?"
)
"""Beginning of a message: number of parameter sets, file and line"""
_VARYING = re.compile(r"(?:/|\b[A-Za-z]:\\)\S+|'[^']*'|-?\b\d+(?:\.\d+)?\b")
"""Paths, names and numbers in which messages of one cause differ"""
_REST = re.compile(r"; |: (?=put it)| \[[\w.-]+:xo(?:sc|dr):")
"""Beginning of the remedy of a fault, or of the uid of its rule"""
_SCRIPTS = ("dom.js", "triage.js")
_STYLES = ("base.css", "report.css")


@dataclass(frozen=True)
class TriagedFile:
    """A file with its group.

    Attributes:
        path: the file.
        kind: scenario, distribution, catalog, road, or file where it is none of these.
        group: one of `GROUPS`.
        cause: the message without names and numbers; empty for a fine file.
        line: line of the first fault; None where it is not known, or in another file.
        message: first fault or repair; empty for a fine file.
        repairs: number of repairs.
        errors, warnings: problems that `xosc-check` finds.
    """

    path: str
    kind: str
    group: str
    cause: str = ""
    line: int | None = None
    message: str = ""
    repairs: int = 0
    errors: int = 0
    warnings: int = 0

    def __str__(self) -> str:
        place = self.path if self.line is None else f"{self.path}:{self.line}"
        more = f" (and {many(self.repairs - 1, 'more repair')})" if self.repairs > 1 else ""
        return one_line(f"{place}: {_REST.split(self.message)[0]}{more}" if self.message else place)


def triage(
    paths: Sequence[Path], catalog_path: Sequence[str] = (), road_path: Sequence[str] = ()
) -> Iterator[TriagedFile]:
    """Check and load each file, yield it with its group; of a variation file up to 20 parameter
    sets are tried.

    Args:
        paths: scenarios, variation files, catalogues and road networks.
        catalog_path, road_path: folders to look for catalogues and roads in.
    """
    folder = os.path.commonpath([path.absolute().parent for path in paths]) if paths else ""
    settings = RunSettings(sut=None, road_path=tuple(road_path), catalog_path=tuple(catalog_path))
    for path, problems in check_many(paths, catalog_path, road_path):
        yield _triaged(path, os.path.relpath(path.absolute(), folder), problems, settings)


def _triaged(
    path: Path, name: str, problems: Sequence[Problem], settings: RunSettings
) -> TriagedFile:
    levels = Counter(problem.level for problem in problems)
    kind, group, told, repairs = _loaded(path, settings)
    first = next((problem for problem in problems if problem.level == "error"), None)
    # The rules are stricter than loading: what breaks one plays with a repair.
    if group == FINE and first is not None:
        group, told = REPAIRED, str(first)
    found = _PLACE.match(told)
    assert found is not None
    line, message, cause = None, told[found.end() :], ""
    if found["path"] is not None:
        elsewhere = os.path.relpath(found["path"]) != os.path.relpath(path)
        place = os.path.relpath(found["path"], path.absolute().parent)
        # A line of another file would point to the wrong place here.
        line = int(found["line"]) if found["line"] and not elsewhere else None
        cause = f"in {Path(place).name}: " if elsewhere and group == REPAIRED else ""
        message = (
            f"in {place}{':' + found['line'] if found['line'] else ''}: {message}"
            if elsewhere
            else message
        )
    cause += _VARYING.sub("…", _REST.split(told[found.end() :])[0])
    return TriagedFile(
        name, kind, group, cause, line, message, repairs, levels["error"], levels["warning"]
    )


def _loaded(path: Path, settings: RunSettings) -> tuple[str, str, str, int]:
    """Kind, group, first fault or repair, and number of repairs of a file."""
    kind = "road" if path.suffix.lower() == ".xodr" else "file"
    try:
        if kind == "road":
            remarks: Iterable[object] = load_road(path).remarks
        else:
            document = xosc.load(path)
            kind, remarks = document.kind, document.remarks
    except ToolchainError as error:
        return kind, REFUSED, describe(error)[0], 0
    except Exception as error:  # a defect of ours is a row too, the other files go on
        return kind, REFUSED, f"internal error: {describe(error)[0]}", 0
    if kind in ("scenario", "distribution"):
        # One file gives one outcome, the gravest of its sets.
        (outcome,) = rehearse_batch(jobs_of([path], {}, True, Selection(sample=_SETS)), settings)
        return kind, *_played(outcome)
    repairs = _repairs(remarks)
    return kind, REPAIRED if repairs else FINE, next(iter(repairs), ""), len(repairs)


def _played(outcome: Outcome) -> tuple[str, str, int]:
    """Group, first fault or repair, and number of repairs of a file that was rehearsed."""
    repairs = _repairs(outcome.remarks)
    if outcome.state != "loaded":
        return REFUSED if outcome.state == "error" else NOTHING, outcome.message, len(repairs)
    return REPAIRED if repairs else FINE, next(iter(repairs), ""), len(repairs)


def _repairs(remarks: Iterable[object]) -> list[str]:
    """The remarks on breaches of a rule, each once."""
    return [text for text in dict.fromkeys(map(str, remarks)) if BREACH.search(text)]


def summary(files: Sequence[TriagedFile]) -> str:
    """One line: files by group."""
    counts = Counter(file.group for file in files)
    return f"{many(len(files), 'file')}, " + ", ".join(
        f"{group}: {counts[group]}" for group in GROUPS if counts[group]
    )


def causes(files: Sequence[TriagedFile]) -> list[tuple[str, list[TriagedFile]]]:
    """Files by cause, the most frequent cause first."""
    found: dict[str, list[TriagedFile]] = {}
    for file in files:
        found.setdefault(file.cause, []).append(file)
    return sorted(found.items(), key=lambda item: (-len(item[1]), item[0]))


def text(files: Sequence[TriagedFile]) -> str:
    """Groups with a line a file, sorted by cause; then the summary."""
    lines = []
    for group, meaning in GROUPS.items():
        members = [file for file in files if file.group == group]
        if members:
            lines += [f"{group.upper()}, {many(len(members), 'file')} ({meaning})"]
        for cause, those in causes(members):
            lines += (
                [one_line(f"  {cause}: {many(len(those), 'file')}{_remedy(those[0])}")]
                if cause
                else []
            )
            lines += [f"    {file}" for file in those]
    return "\n".join([*lines, summary(files)]) + "\n"


def _remedy(file: TriagedFile) -> str:
    """Second part of a message: assumption or remedy."""
    rest = _REST.split(BREACH.sub("", file.message), 1)[1:]
    return f" ({rest[0].strip()})" if rest and rest[0].strip() else ""


def as_json(files: Sequence[TriagedFile]) -> str:
    """Object with the tool, its version, and the files with their findings."""
    values = {"tool": "xosc-check", "version": version(), "files": [asdict(file) for file in files]}
    return json.dumps(values, indent=2, ensure_ascii=False) + "\n"


def html(files: Sequence[TriagedFile]) -> str:
    """A page with the groups, a row a file."""
    data: dict[str, Any] = {
        "summary": summary(files),
        "groups": [
            {
                "name": group,
                "meaning": meaning,
                "causes": [
                    {"cause": cause, "files": [asdict(file) for file in those]}
                    for cause, those in causes([file for file in files if file.group == group])
                ],
            }
            for group, meaning in GROUPS.items()
        ],
    }
    return page("Triage", _STYLES, _SCRIPTS, data)


FORMATS = {"text": text, "json": as_json, "html": html}
"""Reports by format"""
