"""The style of words: messages name the fault and the remedy in one short sentence; docstrings
begin with a verb or a noun.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation", "studies")
CALLS = {
    "invalid",
    "unsupported",
    "remark",
    "UsageError",
    "InvalidFile",
    "Unsupported",
    "Finding",
    "Rule",
    "Omission",
}
"""What makes a message, or is given one."""
VALUE = "…"
"""Stands for a value in a text."""
NAMES = re.compile(r"([A-Z][a-z]*[A-Z]\w*|[A-Z]{3,}\w*)('s)?\b|No-Maneuver")
"""Names of others, of elements and of files that a message may begin with."""
BANNED = re.compile(
    r"\b(told|wish|nobody|somebody|anybody|furniture|for want of|can "
    r"not|cannot|please|sorry|oops)\b|!$",
    re.I,
)


def _text(node: ast.expr) -> str:
    """A text with its values left out; empty where it is none."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(
            str(each.value) if isinstance(each, ast.Constant) else VALUE for each in node.values
        )
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return (_text(node.left) or VALUE) + (_text(node.right) or VALUE)
    return ""


def messages(module: Path) -> Iterator[tuple[int, str]]:
    """Line and text of the sentences that a module says."""
    source = module.read_text("utf-8")
    for node in ast.walk(ast.parse(source)) if any(each in source for each in CALLS) else ():
        called = node.func if isinstance(node, ast.Call) else None
        if (
            isinstance(called, ast.Name | ast.Attribute)
            and (called.id if isinstance(called, ast.Name) else called.attr) in CALLS
        ):
            assert isinstance(node, ast.Call)
            for given in [*node.args, *(keyword.value for keyword in node.keywords)]:
                text = _text(given)
                if " " in text.strip() and not text.startswith(("/", "//")):
                    yield node.lineno, text


def faults(text: str) -> list[str]:
    """What is not in style."""
    found = []
    if text[0].isupper() and not NAMES.match(text):
        found.append("begins with a capital")
    if text.endswith(".") and not text.endswith("…."):
        found.append("ends with a full stop")
    if "  " in text or "\n" in text:
        found.append("is not one line of single spaces")
    return found + [f"says {word.group()!r}" for word in BANNED.finditer(text)]


MODULES = [module for package in PACKAGES for module in sorted((ROOT / package).rglob("*.py"))]


WRITTEN = (*PACKAGES, "benchmarks", "docs")
OPENING = re.compile(
    r"(What|Who|Whom|Whose|How|Where|Of which|Those|That of|The one|One that|One "
    r"who|Whoever|Nobody|Somebody|Everybody|As many|"
    r"Around|Why|Which|When|For files|For people|Some of|Until when)\b"
)
"""Beginnings of docstrings that make a reader work out the noun that is meant."""
PEOPLE = re.compile(
    r"\b(nobody|somebody|everybody|anybody|whoever|whom|one who|those who|in "
    r"vain|for ever|is told)\b",
    re.I,
)
"""Words for persons, where the field has a noun: entity, vehicle, ego, actor, partner, follower."""
OBLIQUE = re.compile(
    r"what came of|says otherwise|goes with|comes into|what is to be|^so many|leave alone", re.I
)
"""Phrases of docstrings in the place of a noun: outcomes, differences, a number of."""


def docstrings(module: Path) -> Iterator[tuple[int, str]]:
    """Line and text of the docstrings of a module, of its classes and functions, and of its
    constants and attributes.
    """
    for node in ast.walk(ast.parse(module.read_text("utf-8"))):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield node.lineno, node.value.value


def unclear(text: str) -> list[str]:
    """Return the faults of a docstring."""
    opening = (
        [f"begins with {OPENING.match(text.strip()).group()!r}"]
        if OPENING.match(text.strip())
        else []
    )  # type: ignore[union-attr]
    return opening + [
        f"says {word.group()!r}"
        for words in (PEOPLE, OBLIQUE)
        for word in words.finditer(text.strip())
    ]


def test_docstrings_begin_with_a_verb_or_a_noun_and_name_things() -> None:
    modules = [module for package in WRITTEN for module in sorted((ROOT / package).rglob("*.py"))]
    written = [(module, line, text) for module in modules for line, text in docstrings(module)]
    assert len(written) > 5000
    wrong = [
        f"{module.relative_to(ROOT)}:{line}: {fault}"
        for module, line, text in written
        for fault in unclear(text)
    ]
    assert wrong == []


def test_documents_name_things_not_people() -> None:
    pages = [
        *ROOT.glob("*.md"),
        *(
            page
            for page in (ROOT / "docs").rglob("*.md")
            if page.parent.name not in ("reference", "verdicts")
        ),
    ]
    assert len(pages) > 40
    wrong = [
        f"{page.relative_to(ROOT)}:{number}: says {word.group()!r}"
        for page in sorted(pages)
        for number, line in enumerate(page.read_text("utf-8").splitlines(), 1)
        for word in PEOPLE.finditer(line)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "text",
    [
        "What a file holds.",
        "Those that are left.",
        "Wait until somebody comes.",
        "Where it is now.",
        "Points and what came of them.",
        "So many draws.",
        "Around all that writes.",
        "Why it fails.",
    ],
)
def test_unclear_docstrings_are_found(text: str) -> None:
    assert unclear(text)


def test_messages_are_in_one_style() -> None:
    said = [(module, line, text) for module in MODULES for line, text in messages(module)]
    assert len(said) > 500
    wrong = [
        f"{module.relative_to(ROOT)}:{line}: {fault}: {text}"
        for module, line, text in said
        for fault in faults(text)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "text",
    [
        "The file is empty",
        "the file is empty.",
        "nobody drives",
        "it cannot be read",
        "two  spaces",
    ],
)
def test_other_styles_are_found(text: str) -> None:
    assert faults(text)


@pytest.mark.parametrize(
    "text",
    ["CARLA has no trailers", "SUMO's drivers drive cars", "EntityRef or ByType is expected"],
)
def test_names_of_others_keep_their_case(text: str) -> None:
    assert not faults(text)
