"""Figures of studies in documents say where they come from; those with result files are theirs.

A section of a page of results that has figures says one of two things:

- ``From `studies/results/…csv`.``: each row of its tables is a row of these files, cell by cell,
  and each decimal, percentage and count of a whole of its text is in them.
- ``Measured DATE by `COMMAND`; rests on …``: the command is one that exists. It may be named as
  "the command below", "the commands above" or "of the table" if the section, or one that precedes
  it, has it. Sections of this kind are listed in `UNFILED`.

The first paragraph of a page repeats figures of its sections. Other pages have none.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from datetime import date
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, cast

import pytest
import typer

from studies.publication.results import read_journal
from tests.commands import SCRIPTS

ROOT = Path(__file__).parents[2]
CARDS = sorted((ROOT / "recognition" / "models").glob("*/README.md"))
PAGES = [ROOT / "docs" / f"{name}-results.md" for name in ("recognition", "generation")] + CARDS
WRITTEN = ("README.md", "docs/*.md", "docs/tutorials/*.md", "docs/extending/*.md")
JOURNALS = sorted((ROOT / "studies" / "results" / "generation").glob("*/stages.csv"))
OTHERS = sorted(
    {page for pattern in WRITTEN for page in ROOT.glob(pattern)}
    - {*PAGES, ROOT / "docs" / "publication.md"}
)
_FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_CODE = re.compile(r"`[^`]*`")
_LINK = re.compile(r"\]\([^)]*\)")
_DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.]*\d)")
_FIGURE = re.compile(r"(?<![\w.])\d+\.\d{2,}\b|\b\d+(\.\d+)? ?%|\b\d+ of \d+\b")
_FROM = re.compile(r"[Ff]rom\s+((?:`studies/results/[\w/.-]+\.csv`(?:,\s+|\s+and\s+)?)+)")
_MEASURED = re.compile(
    r"Measured\s(\d{4}-\d\d-\d\d)\sby\s(`[^`]+`|the\s(?:same\s)?commands?[^;]*)[^;]*;\srests\s+on\s\S+"
)
_COMMAND = re.compile(
    r"python -m (?:studies|benchmarks)[\w.]* [^`\n|]*|xosc-(?!toolchain)\w+ [^`\n|]*"
)
_JOINED = re.compile(r"\\\n\s*")
"""A line that goes on in the next one"""
_OF_STUDIES = re.compile(
    r"(?:macro-F1|AUROC|OSCR|R_risk|[Rr]ecall\w*|ACC_\w+)[ (]{1,2}(?:of |is )?0\.\d{2}|\d\.\d+ ± \d"
)
_SETTINGS = "How it decides"
"""Section of a card that has settings of the model, no results"""
_VERDICTS = "tests/docs/test_verdicts.py counts the reviewers' verdicts"
_ELSEWHERE = "rests on recordings that are not in the repository; the card and the page agree"
_LONG = "takes more than ten minutes of a processor; to be made again with `--results`"
UNFILED = {
    "recognition-results": {
        "The shipped model on other sites": ("2026-11-26", _ELSEWHERE),
        "Precision and recall on sites never seen": ("2026-11-26", _VERDICTS),
        "By sensor and kind of road": ("2026-11-29", _VERDICTS),
    },
    "generation-results": {
        "Other bases and scenarios": ("2026-11-26", _LONG),
        "How often, and whether the estimate holds": ("2026-11-22 2026-11-26", _LONG),
        "Parts of the method": ("2026-11-22 2026-11-29", _LONG),
    },
    "cpu": {
        "TRFE model": ("2026-11-26", "training takes hours; counts are compared with the model"),
        "Sites that it has not seen": ("2026-11-26", _ELSEWHERE),
    },
}
"""Sections of pages of results whose figures no result file has: the days on which they were
measured, and why none has them or what they are compared with"""


class Section(NamedTuple):
    """Text below a heading, up to the next one; the first has that of the page."""

    title: str
    text: str

    @property
    def prose(self) -> str:
        """Without code and targets of links."""
        return _LINK.sub("]", _CODE.sub("", _FENCE.sub("", self.text)))


def sections(page: Path) -> list[Section]:
    text, fences = page.read_text(encoding="utf-8"), list[str]()

    def kept(fence: re.Match[str]) -> str:
        fences.append(fence[0])
        return f"\0{len(fences) - 1}\0"

    parts = re.split(r"^#+ (.*)\n", _FENCE.sub(kept, text), flags=re.MULTILINE)[1:]
    shown = [re.sub("\0(\\d+)\0", lambda one: fences[int(one[1])], part) for part in parts]
    return [Section(*pair) for pair in zip(shown[::2], shown[1::2], strict=True)]


def rows(text: str) -> Iterator[list[str]]:
    """Rows of the tables of a text, without emphasis; headers too, rules not."""
    for line in text.splitlines():
        if line.startswith("|") and not re.fullmatch(r"[|\s:-]+", line):
            yield [cell.strip().strip("*") for cell in line.strip("|").split("|")]


def complaints(section: Section, named: str) -> list[str]:
    """Reasons why a section's figures can't be relied on; `named` is the text in which its command
    may stand."""
    if not _FIGURE.search(section.prose):
        return []
    files = _FROM.search(section.text)
    if files is not None:
        return stale(section, [ROOT / name for name in re.findall("`(.*?)`", files[1])])
    measured = list(_MEASURED.finditer(section.text))
    if not measured:
        return ["figures without `From …` or `Measured … by …; rests on …`"]
    found = []
    for one in measured:
        if date.fromisoformat(one[1]) > date.today():
            found.append(f"measured on a day to come: {one[1]}")
        more = " ".join(re.findall("`(.*?)`", one[0]))
        commands = [more]
        if one[2].startswith("the "):
            commands = [f"{each} {more}" for each in _COMMAND.findall(_JOINED.sub(" ", named))]
        if not commands:
            found.append("no command")
        found += [wrong for command in commands for wrong in unknown(command)]
    return found


def stale(section: Section, files: list[Path]) -> list[str]:
    """Cells and decimals of a section that its result files do not have."""
    tables = [list(csv.reader(path.open(encoding="utf-8", newline=""))) for path in files]
    columns = {
        (row[0].strip("'*"), head): cell.strip("'")
        for header, *body in tables
        for row in body
        for head, cell in zip(header, row, strict=True)
    }
    found, header = [], list[str]()
    for row in rows(section.text):
        if not row[0] or any((row[0], head) in columns for head in header[1:]):
            for head, cell in zip(header[1:], row[1:], strict=True):
                if columns.get((row[0], head)) != cell:
                    found.append(f"{row[0]}, {head}: {cell}, not {columns.get((row[0], head))}")
        elif header and len(row) == len(header):
            found.append(f"no such row: {row[0]}")
        if not header:
            header = row
    cells = {number for table in tables for row in table for cell in row for number in _said(cell)}
    text = re.sub(r"^\|.*$", "", section.prose, flags=re.MULTILINE)
    return found + [f"not in the files: {one}" for one in _said(text) if one not in cells]


def _said(text: str) -> list[str]:
    """Decimals, percentages and counts of a whole that a text has, as `0.5`, `7%` and `3 of 4`."""
    counts = [
        one.replace(" %", "%") for one in re.findall(r"\b\d+(?:\.\d+)? ?%|\b\d+ of \d+\b", text)
    ]
    return [*_DECIMAL.findall(text), *counts]


def unknown(command: str) -> list[str]:
    """Complaints about a command that does not exist, or has not the options that are given."""
    words = re.sub(r"\s+", " ", command).strip().split(" ")
    name = words[2] if words[0] == "python" else words[0]
    if name in SCRIPTS:
        return []
    if find_spec(name) is None:
        return [f"there is no module {name}"]
    if not name.startswith("studies"):
        return []
    app = typer.main.get_command(import_module(f"{name}.__main__").app)
    commands = cast(Any, app).commands
    if words[3] not in commands:
        return [f"{name} has no command {words[3]}"]
    options = {
        option
        for parameter in commands[words[3]].params
        for option in (*parameter.opts, *parameter.secondary_opts)
    }
    given = [word.partition("=")[0] for word in words if word.startswith("--")]
    return [f"{words[3]} has no option {one}" for one in given if one not in options]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name + "/" + page.name)
def test_figures_are_those_of_result_files_or_say_how_they_were_measured(page: Path) -> None:
    first, *others = sections(page)
    if page in CARDS:
        every = [first, *(one for one in others if one.title != _SETTINGS)]
        first, others = Section(first.title, ""), every
    named, found = "", list[str]()
    for section in others:
        # A section without a command of its own speaks of those of the section before it.
        named = section.text if _COMMAND.search(section.text) else named
        found += [f"{section.title}: {one}" for one in complaints(section, named)]
    body = " ".join(section.prose for section in others)
    found += [
        f"{first.title}: {one} is in no section"
        for one in _DECIMAL.findall(first.prose)
        if one not in body
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.parent.name + "/" + page.name)
def test_figures_without_a_result_file_are_listed_with_their_day(page: Path) -> None:
    first, *others = sections(page)
    found = {
        section.title: {one[1] for one in _MEASURED.finditer(section.text)}
        for section in ([first, *others] if page in CARDS else others)
        if section.title != _SETTINGS
        and _FIGURE.search(section.prose)
        and not _FROM.search(section.text)
    }
    listed = UNFILED[page.parent.name if page in CARDS else page.stem]
    assert found == {title: set(days.split()) for title, (days, _) in listed.items()}


@pytest.mark.parametrize("journal", JOURNALS, ids=lambda path: path.parent.name)
def test_result_files_of_generation_are_shown_and_their_command_exists(journal: Path) -> None:
    (made,) = read_journal(journal.parent).values()
    assert made.stage == journal.parent.name and not unknown(f"python -m {made.command}")
    page = (ROOT / "docs" / "generation-results.md").read_text(encoding="utf-8")
    assert f"`studies/results/generation/{made.stage}/" in page


@pytest.mark.parametrize("page", OTHERS, ids=lambda page: page.name)
def test_figures_of_studies_stand_on_pages_of_results_alone(page: Path) -> None:
    found = [
        f"{section.title}: {one[0]}"
        for section in sections(page)
        for one in _OF_STUDIES.finditer(section.prose)
    ]
    assert not found, "\n".join(found)


def other_sites(card: str, page: str) -> list[str]:
    """Counts of classes that do not sum to those of their site, and shares of the page that are not
    those of the card."""
    header, *classes, every = rows(card)
    shares = {row[0].partition(" (")[0]: row for row in rows(page)}
    found = []
    for column, site in enumerate(header[1:], 1):
        counts = [re.fullmatch(r"(\d+) of (\d+)", row[column]) for row in (*classes, every)]
        *parts, (good, of) = [(int(one[1]), int(one[2])) for one in counts if one is not None]
        if (good, of) != tuple(map(sum, zip(*parts, strict=True))):
            found.append(f"{site}: {good} of {of} is not the sum of {parts}")
        if shares[site][1:3] != [str(of), f"{good / of:.1%}"]:
            found.append(f"{site}: {shares[site][1:3]}, not {good} of {of}")
    return found


def test_the_card_and_the_page_agree_on_other_sites() -> None:
    card, page = (
        next(one.text for one in sections(path) if one.title == title)
        for path, title in (
            (CARDS[0], "Sites that it has not seen"),
            (PAGES[0], "The shipped model on other sites"),
        )
    )
    assert not other_sites(card, page)
    for old, new in (("45 of 53", "46 of 53"), ("122 of 210", "121 of 210")):
        assert other_sites(card.replace(old, new), page)
    assert other_sites(card, page.replace("76.8%", "77.8%"))


RESULT = """From `studies/results/full/shipped/clustering.csv`.

| method | ACC_cluster |
|---|---|
| **TRFE** | 0.746 ± 0.012 |
"""


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (RESULT, ""),
        (RESULT.replace("746", "747"), "TRFE, ACC_cluster: 0.747 ± 0.012, not 0.746 ± 0.012"),
        (RESULT.replace("TRFE", "TRFX"), "no such row: TRFX"),
        (RESULT.replace("ACC_cluster", "accuracy"), "no such row: TRFE"),
        (RESULT + "It is 0.999.", "not in the files: 0.999"),
        ("It is 0.99.", "figures without"),
        ("It is 0.99. Measured 2026-11-26 by `python -m studies.generation plays x`.", "without"),
        (
            "0.99. Measured 2026-11-26 by `python -m studies.generation plys`; rests on x.",
            "no command plys",
        ),
        (
            (
                "0.99. Measured 2026-11-26 by `python -m studies.generation plays "
                "--draw 3`; rests on x."
            ),
            "plays has no option --draw",
        ),
        (
            "0.99. Measured 2999-01-01 by `python -m studies.generation plays x`; rests on x.",
            "a day to come",
        ),
        ("0.99. Measured 2026-11-26 by the command below; rests on x.", "no command"),
    ],
)
def test_stale_figures_and_missing_sources_are_complained_of(text: str, complaint: str) -> None:
    found = complaints(Section("x", text), text)
    assert complaint in "\n".join(found) if complaint else not found
