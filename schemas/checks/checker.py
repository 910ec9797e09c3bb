"""Checking files: well-formed, valid against the official XSD, and sound by every rule that concerns them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path

from schemas.catalogs import Folders
from schemas.checks.document import Document
from schemas.checks.problems import Problem
from schemas.checks.registry import all_rules
from schemas.errors import InvalidFile
from schemas.xml import parse, rule_of


def check(path: str | PathLike[str], catalog_path: Folders = (), road_path: Folders = ()) -> list[Problem]:
    """Every problem of a file, ordered by line; empty for a sound one.

    Nothing that can be in a file raises: a file that is missing or no XML is a problem, too.

    Args:
        catalog_path: folders in which directories of catalogues are looked for that are not where the scenario says.
        road_path: folders in which road networks are, likewise.

    Raises:
        UsageError: XOSC_SCHEMA_DIR names no folder, or an XSD in it cannot be used.
    """
    path = Path(path)
    try:
        document = Document(parse(path), path, catalog_path, road_path)
    except InvalidFile as error:
        return [Problem(rule_of(path), "error", error.message, str(path), error.line)]
    return sorted(_problems(document), key=lambda problem: (problem.line or 0, problem.rule, problem.message))


def check_many(
    paths: Iterable[str | PathLike[str]], catalog_path: Folders = (), road_path: Folders = ()
) -> Iterator[tuple[Path, list[Problem]]]:
    """Each file with its problems, as they are checked; arguments as for `check`."""
    for path in paths:
        yield Path(path), check(path, catalog_path, road_path)


def _problems(document: Document) -> list[Problem]:
    rules = [rule for rule in all_rules() if rule.standard == document.standard]
    broken = [problem for rule in rules if rule.precondition for problem in rule.problems(document)]
    if broken:
        return broken
    concerned = (rule for rule in rules if not rule.precondition and rule.concerns(document.type))
    return [problem for rule in concerned for problem in rule.problems(document)]
