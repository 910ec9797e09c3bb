"""Contents of a scenario library: scenarios with tags, road, parameters and variations, and the
catalogues.

Modules:

- `questions`: questions to rows of catalogues, batches and searches: conditions,
  order, near-duplicates
- `tables`: the rows that questions are asked to, and copies of scenarios with all that they need
- `xosc_list`: the command `xosc-list`

Example::

    xosc-list xosc/library
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from schemas.common.errors import ToolchainError, UsageError, like_or_nearest, nearest
from schemas.common.policy import limited
from schemas.common.terminal.files import LIBRARY as LIBRARY
from schemas.common.terminal.files import expand
from schemas.common.terminal.text import csv_text, many, one_line
from schemas.expressions import ExpressionError
from xosc.distributions import ParameterSpace
from xosc.document import Document, load
from xosc.document.node import Node
from xosc.resolve.parameters import ParameterScope
from xosc.writing.tags import Tag, Value, tags_of

CLASS = "Class"
"""Type of the tag that names a scenario's class."""
_SIGNS = {
    "equalTo": "=", "notEqualTo": "≠", "greaterThan": ">", "greaterOrEqual": "≥", "lessThan": "<",
    "lessOrEqual": "≤",
}  # fmt: skip


@dataclass(frozen=True)
class ListedParameter:
    """A parameter as it is declared.

    Attributes:
        name, type, value: as written.
        limits: groups of constraints (rule, value), one group must hold; empty where any value is
            allowed.
    """

    name: str
    type: str
    value: str
    limits: tuple[tuple[tuple[str, str], ...], ...]

    @property
    def allowed(self) -> str:
        """The limits in short: `[5, 80]`, `car | van`, `> 0`; empty for none."""
        return " | ".join(map(_allowed, self.limits))


@dataclass(frozen=True)
class Variation:
    """A file of variations and how many sets of parameters it has."""

    path: Path
    size: int


@dataclass(frozen=True)
class Listed:
    """A scenario.

    Attributes:
        description: what its FileHeader says.
        road: name of its road file without the ending; empty where it has none.
        tags: values by type; True where the type says all.
    """

    path: Path
    description: str
    road: str
    tags: Mapping[str, Value]
    parameters: tuple[ListedParameter, ...]
    variations: list[Variation] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Name of its file without the ending."""
        return self.path.stem

    @property
    def label(self) -> str:
        """Class of the scenario; empty where it has none."""
        return str(self.tags.get(CLASS, ""))

    def has(self, tag: Tag) -> bool:
        """Whether it has a tag of this type and, where one is given, of this value."""
        return tag.type in self.tags and (
            tag.value is None or _text(self.tags[tag.type]) == tag.value
        )


@dataclass(frozen=True)
class ListedCatalogue:
    """A catalogue: its name, the kind of its entries (`Vehicle`, …) and their names."""

    path: Path
    name: str
    kind: str
    entries: tuple[str, ...]


@dataclass(frozen=True)
class Listing:
    """Scenarios and catalogues, in the order of their files."""

    scenarios: list[Listed]
    catalogues: list[ListedCatalogue]

    def chosen(self, label: str | None, tags: Iterable[Tag]) -> list[Listed]:
        """The scenarios of a class that have all of these tags.

        Raises:
            UsageError: no scenario has the class or one of the tags.
        """
        # A class is a tag like others, so its misspelling gets the same hint.
        required = list(tags) + ([Tag(CLASS, label)] if label else [])
        for tag in required:
            if not any(scenario.has(tag) for scenario in self.scenarios):
                raise UsageError(self._missing(tag))
        return [
            scenario for scenario in self.scenarios if all(scenario.has(tag) for tag in required)
        ]

    def _missing(self, tag: Tag) -> str:
        there = {
            _text(scenario.tags[tag.type])
            for scenario in self.scenarios
            if tag.type in scenario.tags
        }
        if there:
            return (
                f"no scenario has {tag.type} {tag.value!r}; "
                f"{like_or_nearest(_text(tag.value), sorted(there))}"
            )
        types = sorted({name for scenario in self.scenarios for name in scenario.tags})
        return f"no scenario has a tag {tag.type!r}; {nearest(tag.type, types)}"


def listing(paths: Iterable[str], tell: Callable[[ToolchainError], None] | None = None) -> Listing:
    """List files, folders and globs. The scenario of a variation file is included; roads are left
    out.

    Args:
        tell: called with the error of each file that can't be listed, and the others go on; None to
            raise the first.

    Raises:
        UsageError: a folder or a glob stands for no file.
        InvalidFile, Unsupported: a file can't be read, or is no OpenSCENARIO file of a known
            version.
    """
    scenarios: dict[str, Listed] = {}
    variations, catalogues = list[Document](), list[ListedCatalogue]()

    @limited()
    def add(path: Path) -> None:
        document = load(path)
        if document.kind == "scenario":
            scenarios[_key(path)] = _listed(document)
        elif document.kind == "catalog":
            catalogues.append(_catalogue(document))
        else:
            variations.append(document)

    def add_variations(document: Document) -> None:
        space = ParameterSpace(document.path)
        # By its real path: two variation files may spell the way to it differently.
        scenario = scenarios.get(_key(space.scenario)) or _listed(load(space.scenario))
        scenarios[_key(space.scenario)] = scenario
        scenario.variations.append(Variation(document.path, space.size))

    for path in expand(paths):
        if path.suffix.lower() != ".xodr":
            _attempt(partial(add, path), tell)
    # After all scenarios: the one of a variation file may come later in the folder.
    for document in variations:
        _attempt(partial(limited()(add_variations), document), tell)
    return Listing(list(scenarios.values()), catalogues)


def _attempt(work: Callable[[], None], tell: Callable[[ToolchainError], None] | None) -> None:
    try:
        work()
    except ToolchainError as error:
        # As a function the first error is raised; the command names each and lists the others.
        if tell is None:
            raise
        tell(error)


def _key(path: Path) -> str:
    return str(path.resolve())


def _listed(document: Document) -> Listed:
    root = document.node
    holder = root.find("ParameterDeclarations")
    declared = holder.children("ParameterDeclaration") if holder is not None else []
    return Listed(
        path=document.path,
        description=root.need("FileHeader").get("description", ""),
        road=_road(root.find("RoadNetwork", "LogicFile"), declared),
        tags={tag.type: True if tag.value is None else tag.value for tag in tags_of(document.path)},
        parameters=tuple(map(_declared, declared)),
    )


def _road(file: Node | None, declared: list[Node]) -> str:
    """The name of a road file, with the default values of parameters where those name it."""
    if file is None:
        return ""
    try:
        path = ParameterScope(declared).literal(file.get("filepath"))
    except ExpressionError as error:
        raise file.invalid(f"filepath: {error.message}") from None
    # Files written on Windows have backslashes.
    return PurePosixPath(path.replace("\\", "/")).stem


def _declared(node: Node) -> ListedParameter:
    groups = [
        tuple(
            (constraint.get("rule"), constraint.get("value"))
            for constraint in group.children("ValueConstraint")
        )
        for group in node.children("ConstraintGroup")
    ]
    return ListedParameter(
        node.get("name"), node.get("parameterType"), node.get("value"), tuple(groups)
    )


def _catalogue(document: Document) -> ListedCatalogue:
    catalog = document.node.need("Catalog")
    entries = catalog.children()
    return ListedCatalogue(
        document.path,
        catalog.get("name", ""),
        # By the XSD entries may be of several kinds; catalogues of one kind are the rule.
        entries[0].tag if entries else "",
        tuple(entry.get("name", "") for entry in entries),
    )


def _allowed(group: tuple[tuple[str, str], ...]) -> str:
    rules = dict(group)
    if rules.keys() == {"greaterOrEqual", "lessOrEqual"} and len(group) == 2:
        return f"[{rules['greaterOrEqual']}, {rules['lessOrEqual']}]"
    if rules.keys() == {"equalTo"} and len(group) == 1:
        return rules["equalTo"]
    return " and ".join(f"{_SIGNS.get(rule, rule)} {value}" for rule, value in group)


def _text(value: Value) -> str:
    """A tag's value as it is given on a command line."""
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else str(value)


# as text, JSON and CSV --------------------------------------------------------------------------


_COLUMNS = ("NAME", "CLASS", "ROAD", "PARAMETERS", "VARIATIONS", "WHAT IT IS")
_CATALOGUE_COLUMNS = ("CATALOGUE", "OF", "ENTRIES")


def text(listing: Listing, verbose: bool = False) -> str:
    """Two tables, of scenarios and of catalogues.

    Args:
        verbose: with a line for each parameter, file of variations and tag below its scenario.
    """
    rows = [
        (
            scenario.name,
            scenario.label or "–",
            scenario.road or "–",
            str(len(scenario.parameters)),
            str(_sets(scenario)),
            scenario.description,
        )
        for scenario in listing.scenarios
    ]
    details = [_details(scenario) if verbose else [] for scenario in listing.scenarios]
    lines = _aligned(_COLUMNS, rows, details)
    catalogues = [
        (catalogue.name, catalogue.kind, ", ".join(catalogue.entries))
        for catalogue in listing.catalogues
    ]
    if catalogues:
        lines += ["", *_aligned(_CATALOGUE_COLUMNS, catalogues, [[] for _ in catalogues])]
    return "\n".join([*lines, ""])


def to_json(listing: Listing) -> str:
    """An object with all that is known of scenarios and catalogues."""
    scenarios = [
        {
            "name": scenario.name, "class": scenario.label or None,
            "description": scenario.description, "path": str(scenario.path),
            "road": scenario.road or None, "tags": dict(scenario.tags),
            "parameters": [_parameter(one) for one in scenario.parameters],
            "variations": [{"path": str(one.path),
                "parameter_sets": one.size} for one in scenario.variations],
        }
        for scenario in listing.scenarios
    ]  # fmt: skip
    catalogues = [
        {
            "name": catalogue.name,
            "kind": catalogue.kind,
            "path": str(catalogue.path),
            "entries": list(catalogue.entries),
        }
        for catalogue in listing.catalogues
    ]
    return (
        json.dumps({"scenarios": scenarios, "catalogues": catalogues}, indent=1, ensure_ascii=False)
        + "\n"
    )


def to_csv(listing: Listing) -> str:
    """A line for each scenario."""
    rows: list[tuple[object, ...]] = [
        ("name", "class", "description", "path", "road", "parameters", "variations", "tags")
    ]
    for scenario in listing.scenarios:
        parameters = "; ".join(map(_parameter_text, scenario.parameters))
        variations = "; ".join(str(one.path) for one in scenario.variations)
        tags = "; ".join(_tag_texts(scenario.tags))
        rows.append(
            (
                scenario.name,
                scenario.label,
                scenario.description,
                str(scenario.path),
                scenario.road,
                parameters,
                variations,
                tags,
            )
        )
    return csv_text(rows)


FORMATS: Mapping[str, Callable[[Listing], str]] = {"json": to_json, "csv": to_csv}


def _sets(listed: Listed) -> int:
    return sum(variation.size for variation in listed.variations)


def of_rows(
    rows: Sequence[Mapping[str, Any]], shown: Sequence[str], format: str, noun: str = "scenario"
) -> str:
    """Rows of an index as text, JSON or CSV.

    Args:
        noun: for a row.
        shown: columns of the text; the other formats have all. Near-duplicates are listed below the
            row that stands for them.
    """
    if format == "json":
        # JSON has neither infinity nor NaN, which tables of other programs may hold.
        finite = [{name: _finite(value) for name, value in row.items()} for row in rows]
        return json.dumps(finite, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    # Without rows no column but the shown ones is known; the header stays.
    names = list(rows[0]) if rows else list(shown)
    if format == "csv":
        return csv_text([names, *([row[name] for name in names] for row in rows)])
    shown = [name for name in shown if name != "duplicates"]
    cells = [[_cell(row[name]) for name in shown] for row in rows]
    details = [
        [f"near-duplicate: {name}" for name in (row.get("duplicates") or "").split("; ") if name]
        for row in rows
    ]
    left_out = (
        f", {many(sum(map(len, details)), 'near-duplicate')} left out"
        if rows and "duplicates" in rows[0]
        else ""
    )
    return "\n".join([*_aligned(shown, cells, details), f"{many(len(rows), noun)}{left_out}", ""])


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _aligned(
    columns: Sequence[str], rows: Sequence[Sequence[str]], details: Sequence[Sequence[str]]
) -> list[str]:
    """Rows under their columns, the last column as long as it is; below each row its details."""
    rows, details = (
        [[one_line(text) for text in texts] for texts in table] for table in (rows, details)
    )
    # The last column is free text, and no column follows that it would have to line up with.
    widths = [max(map(len, column)) for column in list(zip(columns, *rows, strict=True))[:-1]]
    lines = []
    for row, more in zip([columns, *rows], [[], *details], strict=True):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        lines += ["  ".join([*cells, row[-1]]), *(f"    {line}" for line in more)]
    return lines


def _details(listed: Listed) -> list[str]:
    variations = [
        f"{variation.path}: {many(variation.size, 'parameter set')}"
        for variation in listed.variations
    ]
    return [*map(_parameter_text, listed.parameters), *variations, *_tag_texts(listed.tags)]


def _parameter_text(parameter: ListedParameter) -> str:
    allowed = parameter.allowed
    return f"{parameter.name} = {parameter.value}" + (f" in {allowed}" if allowed else "")


def _tag_texts(tags: Mapping[str, Any]) -> list[str]:
    return [name if value is True else f"{name}={value}" for name, value in tags.items()]


def _parameter(parameter: ListedParameter) -> dict[str, Any]:
    limits = [
        [{"rule": rule, "value": value} for rule, value in group] for group in parameter.limits
    ]
    return {
        "name": parameter.name,
        "type": parameter.type,
        "value": parameter.value,
        "limits": limits,
    }
