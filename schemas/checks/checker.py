"""Checking files: well-formed, valid against the official XSD, and sound by every rule that
concerns them; OSI traces too."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from types import MappingProxyType

from schemas.catalogs import Folders
from schemas.checks import LIMITS, Problem
from schemas.checks.document import CheckedDocument
from schemas.checks.osi import check_trace
from schemas.checks.registry import all_rules
from schemas.common.errors import InvalidFile, ToolchainError, UsageError, describe
from schemas.common.policy import LimitReached, limited
from schemas.common.xml import parse, parse_bytes, rule_of
from schemas.osi.traces import SUFFIXES


def check(
    path: str | PathLike[str],
    catalog_path: Folders = (),
    road_path: Folders = (),
    content: bytes | None = None,
) -> list[Problem]:
    """Every problem of a file, ordered by line; empty for a sound one.

    Nothing that can be in a file raises: a file that is missing or no XML is a problem, too.

    Args:
        catalog_path: folders in which directories of catalogues are looked for that are not where
            the scenario says.
        road_path: folders in which road networks are, likewise.
        content: of a file that was read already; None to read it.

    Raises:
        UsageError: XOSC_SCHEMA_DIR names no folder, or an XSD in it cannot be used.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.check("xosc/library/simple_cut_in.xosc")
        []
    """
    path = Path(path)
    if path.suffix.lower() in SUFFIXES:
        # Binary: nothing of what follows can be asked of it.
        return check_trace(path)
    try:
        document = CheckedDocument(
            parse(path) if content is None else parse_bytes(content, path),
            path,
            catalog_path,
            road_path,
        )
        problems = _problems(document)
    except InvalidFile as error:
        return [Problem(rule_of(path), "error", error.message, str(path), error.line)]
    except (UsageError, LimitReached):
        raise
    except Exception as error:  # one file never ends the check of the others
        if not isinstance(error, ToolchainError | OSError | MemoryError):
            # A defect of a rule: the developer needs the place, the report one line.
            traceback.print_exc()
        return [Problem(rule_of(path), "error", f"not checked: {describe(error)[0]}", str(path))]
    return sorted(problems, key=lambda problem: (problem.line or 0, problem.rule, problem.message))


def check_many(
    paths: Iterable[str | PathLike[str]],
    catalog_path: Folders = (),
    road_path: Folders = (),
    contents: Mapping[Path, bytes] = MappingProxyType({}),
) -> Iterator[tuple[Path, list[Problem]]]:
    """Each file with its problems, as they are checked; arguments as for `check`, contents by path.

    Example:
        >>> import xosc_toolchain as xt
        >>> files = ["xosc/library/simple_cut_in.xosc", "xodr/library/roundabout.xodr"]
        >>> for path, problems in xt.check_many(files):
        ...     print(path.name, len(problems))
        simple_cut_in.xosc 0
        roundabout.xodr 0
    """
    for path in map(Path, paths):
        try:
            # For each file anew: a slow one may not take the time of those after it.
            with limited():
                problems = check(path, catalog_path, road_path, contents.get(path))
        except LimitReached as error:
            problems = [Problem(LIMITS, "error", error.message, str(path))]
        yield path, problems


def _problems(document: CheckedDocument) -> list[Problem]:
    rules = [rule for rule in all_rules() if rule.standard == document.standard]
    broken = [problem for rule in rules if rule.precondition for problem in rule.problems(document)]
    # Without a root, header and version, each other rule would only report what follows from it.
    if broken:
        return broken
    concerned = (rule for rule in rules if not rule.precondition and rule.concerns(document.type))
    return [problem for rule in concerned for problem in rule.problems(document)]
