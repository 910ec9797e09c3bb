"""Figures of reviewers' answers: precision and recall by source, class and set, with intervals."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.judging.draws import BASELINE, BOTH, CLASSES, MODEL, RULES
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object

_VERDICTS = ("right", "wrong", "unclear")
_DONE, _EVENT = "complete", "event"
_TOLERANCE = 2.0
"""Time (s) by which a reviewer's event may be off a finding"""
_SAMPLES = 2000
_Z = 1.959964
SOURCES = {
    "rules": (RULES, BOTH),
    "model": (MODEL, BOTH),
    "both agree": (BOTH,),
    "rules alone": (RULES,),
    "model alone": (MODEL,),
    "plain baseline": (BASELINE,),
}


class Event(NamedTuple):
    """An event that a reviewer entered: class, and time, s."""

    title: str
    time: float


class Answers(NamedTuple):
    """Answers of a reviewer: verdict of each item answered, and events entered by item."""

    verdicts: dict[int, str]
    events: dict[int, list[Event]]


class Case(NamedTuple):
    """A yes or no that counts: source, class, set and site it belongs to, its weight."""

    source: str
    title: str
    set: str
    site: str
    weight: float
    yes: bool


def report(key: Path, answers: Sequence[Path]) -> str:
    """Compare the answers of reviewers with a key, as Markdown.

    Raises:
        InvalidFile: a file is not readable, or an answer is none of those asked for.
    """
    items = read_object(key)["items"]
    of_findings = bool(items and items[0]["finding"])
    named = of_findings and not items[0].get("hidden")
    read = [read_answers(path, len(items), named) for path in answers]
    parts = []
    for path, one in zip(answers, read, strict=True):
        cases = precision_cases(items, one) if of_findings else recall_cases(items, one)
        what = "precision" if of_findings else "recall"
        parts.append(f"## {what}, {path.stem}\n\n{_tables(cases)}")
        if not of_findings:
            parts.append(
                "### findings in the stretches that the reviewer "
                f"listed\n\n{_tables(extra_cases(items, one))}"
            )
    if len(read) == 2 and named:
        parts.append(_agreement(read))
    return "\n".join(parts)


def read_answers(path: Path, count: int, of_findings: bool) -> Answers:
    """Read a table of answers.

    Raises:
        InvalidFile: a column is absent, or a row has an unknown item, answer, class or time.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InvalidFile(f"answers can't be read: {error}", path=path) from None
    verdicts: dict[int, str] = {}
    events: dict[int, list[Event]] = defaultdict(list)
    allowed = _VERDICTS if of_findings else (_DONE, "unclear")
    for line, row in enumerate(rows, 2):
        item, answer, title, time = (
            (row.get(name) or "").strip() for name in ("item", "answer", "class", "time")
        )
        if not answer:
            continue
        if not item.isdecimal() or int(item) >= count:
            raise InvalidFile(f"item {item!r} is none of 0 to {count - 1}", path=path, line=line)
        if answer == _EVENT:
            events[int(item)].append(_event(title, time, path, line))
        elif answer in allowed:
            verdicts[int(item)] = answer
        else:
            raise InvalidFile(
                f"answer {answer!r} is none of {', '.join((*allowed, _EVENT))}",
                path=path,
                line=line,
            )
    if not verdicts:
        raise InvalidFile("there is no answer", path=path)
    return Answers(verdicts, dict(events))


def _event(title: str, time: str, path: Path, line: int) -> Event:
    if title not in CLASSES:
        raise InvalidFile(f"class {title!r} is none of {', '.join(CLASSES)}", path=path, line=line)
    try:
        return Event(title, float(time))
    except ValueError:
        raise InvalidFile(f"time {time!r} is no number of seconds", path=path, line=line) from None


def precision_cases(items: Sequence[Mapping[str, Any]], answers: Answers) -> list[Case]:
    """Return whether each judged finding is right; unclear counts as wrong. A finding with
    a hidden class is right if the reviewer names that class."""
    cases = []
    for number, verdict in sorted(answers.verdicts.items()):
        item, finding = items[number], items[number]["finding"]
        where = item["set"], item["site"], item["weight"]
        if item.get("hidden"):
            said = {event.title for event in answers.events.get(number, [])}
            verdict = "right" if finding["title"] in said else "wrong"
        cases += [
            Case(name, finding["title"], *where, verdict == "right")
            for name in _names(finding["source"])
        ]
    return cases


def recall_cases(items: Sequence[Mapping[str, Any]], answers: Answers) -> list[Case]:
    """Return whether each event that the reviewer lists is found, by each source."""
    cases = []
    for number in _complete(answers):
        item = items[number]
        for event in answers.events.get(number, []):
            near = {one["source"] for one in item["found"] if matches(event, one)}
            for name, of in SOURCES.items():
                cases.append(
                    Case(name, event.title, item["set"], item["site"], 1.0, bool(near & set(of)))
                )
    return cases


def extra_cases(items: Sequence[Mapping[str, Any]], answers: Answers) -> list[Case]:
    """Return whether each finding in a stretch is among the events that the
    reviewer lists there.
    """
    cases = []
    for number in _complete(answers):
        item = items[number]
        for one in item["found"]:
            right = any(matches(event, one) for event in answers.events.get(number, []))
            if item["start"] <= one["time"] <= item["end"]:
                cases += [
                    Case(name, one["title"], item["set"], item["site"], 1.0, right)
                    for name in _names(one["source"])
                ]
    return cases


def matches(event: Event, finding: Mapping[str, Any]) -> bool:
    """Whether a finding is of the event's class, and its window within the tolerance of the event's
    time."""
    inside = finding["start"] - _TOLERANCE <= event.time <= finding["end"] + _TOLERANCE
    return bool(event.title == finding["title"] and inside)


def _complete(answers: Answers) -> list[int]:
    return sorted(number for number, verdict in answers.verdicts.items() if verdict == _DONE)


def _names(source: str) -> list[str]:
    return [name for name, of in SOURCES.items() if source in of]


def _tables(cases: Sequence[Case]) -> str:
    lines = [
        "| source | yes | share, 95 % (Wilson) | weighted, 95 % (sites) |",
        "|---|---|---|---|",
    ]
    lines += [_row(name, [case for case in cases if case.source == name]) for name in SOURCES]
    headline = [case for case in cases if case.source in ("rules", "model")]
    for title, kind in ("class", "title"), ("set", "set"):
        lines += ["", f"| {title} | rules | model |", "|---|---|---|"]
        for value in sorted({getattr(case, kind) for case in headline}):
            pair = [
                [c for c in headline if getattr(c, kind) == value and c.source == name]
                for name in ("rules", "model")
            ]
            lines.append(f"| {value} | " + " | ".join(_short(each) for each in pair) + " |")
    return "\n".join(lines) + "\n"


def _short(cases: Sequence[Case]) -> str:
    return f"{sum(case.yes for case in cases)} of {len(cases)}" if cases else "–"


def _row(name: str, cases: Sequence[Case]) -> str:
    if not cases:
        return f"| {name} | – | – | – |"
    yes, (low, high) = (
        sum(case.yes for case in cases),
        interval(sum(case.yes for case in cases), len(cases)),
    )
    share = f"{yes / len(cases):.0%} ({low:.0%} to {high:.0%})"
    low, high = bootstrap(cases)
    return (
        f"| {name} | {yes} of {len(cases)} | {share} | {weighted(cases):.0%} ({low:.0%} to "
        f"{high:.0%}) |"
    )


def weighted(cases: Iterable[Case]) -> float:
    """Share of yes, each case counted with its weight."""
    listed = list(cases)
    return sum(case.weight * case.yes for case in listed) / sum(case.weight for case in listed)


def bootstrap(cases: Sequence[Case], seed: int = 0) -> tuple[float, float]:
    """Return the 95 % interval of the weighted share over sites drawn anew with replacement."""
    of_site: dict[str, list[Case]] = defaultdict(list)
    for case in cases:
        of_site[case.site].append(case)
    sites = [of_site[site] for site in sorted(of_site)]
    yes = np.array([sum(case.weight * case.yes for case in each) for each in sites])
    all_of = np.array([sum(case.weight for case in each) for each in sites])
    drawn = np.random.default_rng(seed).integers(len(sites), size=(_SAMPLES, len(sites)))
    low, high = np.quantile(yes[drawn].sum(axis=1) / all_of[drawn].sum(axis=1), [0.025, 0.975])
    return float(low), float(high)


def _agreement(read: Sequence[Answers]) -> str:
    first, second = (one.verdicts for one in read)
    both = sorted(first.keys() & second.keys())
    same = sum((first[number] == "right") == (second[number] == "right") for number in both)
    return (
        f"## agreement\n\nOf {len(both)} items that both judged, they agree on {same} "
        f"({same / max(len(both), 1):.0%}).\n"
    )


def interval(yes: int, number: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share."""
    share, spread = yes / number, _Z**2 / number
    middle, half = (
        share + 0.5 * spread,
        _Z * np.sqrt(share * (1.0 - share) / number + 0.25 * spread / number),
    )
    return float((middle - half) / (1.0 + spread)), float((middle + half) / (1.0 + spread))
