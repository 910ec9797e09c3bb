"""A listing as text for people, JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from schemas.common.text import csv_text, many, one_line
from xosc.listing import Declared, Listed, Listing

_COLUMNS = ("NAME", "CLASS", "ROAD", "PARAMETERS", "VARIATIONS", "WHAT IT IS")
_CATALOGUE_COLUMNS = ("CATALOGUE", "OF", "ENTRIES")


def text(listing: Listing, verbose: bool = False) -> str:
    """Two tables, of scenarios and of catalogues.

    Args:
        verbose: with a line for each parameter, file of variations and tag below its scenario.
    """
    rows = [
        (each.name, each.label or "–", each.road or "–", str(len(each.parameters)), str(_sets(each)), each.description)
        for each in listing.scenarios
    ]
    details = [_details(each) if verbose else [] for each in listing.scenarios]
    lines = _aligned(_COLUMNS, rows, details)
    catalogues = [(each.name, each.kind, ", ".join(each.entries)) for each in listing.catalogues]
    if catalogues:
        lines += ["", *_aligned(_CATALOGUE_COLUMNS, catalogues, [[] for _ in catalogues])]
    return "\n".join([*lines, ""])


def to_json(listing: Listing) -> str:
    """An object with all that is known of scenarios and catalogues."""
    scenarios = [
        {
            "name": each.name, "class": each.label or None, "description": each.description, "path": str(each.path),
            "road": each.road or None, "tags": dict(each.tags), "parameters": [_parameter(one) for one in each.parameters],
            "variations": [{"path": str(one.path), "parameter_sets": one.size} for one in each.variations],
        }
        for each in listing.scenarios
    ]  # fmt: skip
    catalogues = [
        {"name": each.name, "kind": each.kind, "path": str(each.path), "entries": list(each.entries)}
        for each in listing.catalogues
    ]
    return json.dumps({"scenarios": scenarios, "catalogues": catalogues}, indent=1, ensure_ascii=False) + "\n"


def to_csv(listing: Listing) -> str:
    """A line for each scenario."""
    rows: list[tuple[object, ...]] = [("name", "class", "description", "path", "road", "parameters", "variations", "tags")]
    for each in listing.scenarios:
        parameters = "; ".join(map(_parameter_text, each.parameters))
        variations = "; ".join(str(one.path) for one in each.variations)
        tags = "; ".join(_tag_texts(each.tags))
        rows.append((each.name, each.label, each.description, str(each.path), each.road, parameters, variations, tags))
    return csv_text(rows)


FORMATS: Mapping[str, Callable[[Listing], str]] = {"json": to_json, "csv": to_csv}


def _sets(listed: Listed) -> int:
    return sum(each.size for each in listed.variations)


def of_rows(rows: Sequence[Mapping[str, Any]], shown: Sequence[str], format: str) -> str:
    """Rows of an index as text, JSON or CSV.

    Args:
        shown: columns of the text; the other formats have all. Near-duplicates are listed below the row that stands for them.
    """
    if format == "json":
        return json.dumps(rows, indent=1, ensure_ascii=False) + "\n"
    names = list(rows[0]) if rows else list(shown)
    if format == "csv":
        return csv_text([names, *([row[name] for name in names] for row in rows)])
    shown = [name for name in shown if name != "duplicates"]
    cells = [[_cell(row[name]) for name in shown] for row in rows]
    details = [[f"near-duplicate: {name}" for name in (row.get("duplicates") or "").split("; ") if name] for row in rows]
    left_out = f", {many(sum(map(len, details)), 'near-duplicate')} left out" if rows and "duplicates" in rows[0] else ""
    return "\n".join([*_aligned(shown, cells, details), f"{many(len(rows), 'scenario')}{left_out}", ""])


def _cell(value: Any) -> str:
    return "–" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def _aligned(columns: Sequence[str], rows: Sequence[Sequence[str]], details: Sequence[Sequence[str]]) -> list[str]:
    """Rows under their columns, the last column as long as it is; below each row its details."""
    rows, details = ([[one_line(text) for text in texts] for texts in table] for table in (rows, details))
    widths = [max(map(len, column)) for column in list(zip(columns, *rows, strict=True))[:-1]]
    lines = []
    for row, more in zip([columns, *rows], [[], *details], strict=True):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        lines += ["  ".join([*cells, row[-1]]), *(f"    {line}" for line in more)]
    return lines


def _details(listed: Listed) -> list[str]:
    variations = [f"{each.path}: {many(each.size, 'parameter set')}" for each in listed.variations]
    return [*map(_parameter_text, listed.parameters), *variations, *_tag_texts(listed.tags)]


def _parameter_text(parameter: Declared) -> str:
    allowed = parameter.allowed
    return f"{parameter.name} = {parameter.value}" + (f" in {allowed}" if allowed else "")


def _tag_texts(tags: Mapping[str, Any]) -> list[str]:
    return [name if value is True else f"{name}={value}" for name, value in tags.items()]


def _parameter(parameter: Declared) -> dict[str, Any]:
    limits = [[{"rule": rule, "value": value} for rule, value in group] for group in parameter.limits]
    return {"name": parameter.name, "type": parameter.type, "value": parameter.value, "limits": limits}
