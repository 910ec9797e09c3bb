"""Scenarios with everything worked out, and conversion to an older version, so that files stay
valid and move as before.

What an older version cannot express, although no motion depends on it, is kept in a form that it
has:

| of | before | becomes |
|---|---|---|
| License, Properties of the FileHeader | 1.1, 1.2 | comments before it |
| mass of a vehicle | 1.1 | one of its properties |
| no model of a pedestrian | 1.1 | its name as model |
| rule greaterOrEqual, lessOrEqual | 1.1 | greaterThan, lessThan, the value moved by `GRAIN` |

Everything else is the business of `xosc.writing.versions`: converted without loss, or refused.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from lxml import etree

from schemas.catalogs import Folders
from schemas.common.policy import current
from schemas.expressions.values import number
from xosc.distributions import ParameterSpace
from xosc.distributions.space import numbered
from xosc.document import Document, load
from xosc.document.node import SOURCE, Node
from xosc.exports.draft import Draft, ExportSettings
from xosc.exports.omissions import omit
from xosc.resolve import Argument, resolve
from xosc.writing.versions import LEFT_OPEN, SAID_SINCE, Version, checked, convert, say_left_open

# everything worked out --------------------------------------------------------------------------


MAX_SETS = 1000
"""Most scenarios that one distribution may become."""

_WORKED_OUT, _SINCE_1_1 = (
    ("LateralDistanceAction", "RelativeLanePosition"),
    {"displacement", "dsLane"},
)
"""Elements that may have got attributes of a later version by `xosc.document.carla`."""
_REFERENCES = ("parameterRef",)
"""Attributes by which an element names a parameter when the scenario runs."""


def concrete(
    document: Document,
    parameters: Mapping[str, Argument] | None = None,
    *,
    enforce_constraints: bool = True,
    strict: bool = False,
    catalog_path: Folders = (),
) -> Document:
    """A scenario without parameters, expressions and references: values and catalogue entries stand
    in their places.

    Its version is the newest of its own and those of its catalogues. Declarations stay only of
    parameters that conditions and actions name; what then is left out is not used any more.

    Raises:
        UsageError, InvalidFile: as in `xosc.resolve`.
    """
    resolved = resolve(
        document,
        parameters,
        enforce_constraints=enforce_constraints,
        strict=strict,
        catalog_path=catalog_path,
    )
    named = {
        element.get(name)
        for element in resolved.root.iter()
        for name in _REFERENCES
        if element.get(name)
    }
    for declarations in list(resolved.root.iter("ParameterDeclarations")):
        for declaration in list(declarations):
            if declaration.get("name") not in named:
                declarations.remove(declaration)
        parent = declarations.getparent()
        if len(declarations) == 0 and parent is not None:
            parent.remove(declarations)
    # Emptied, not removed: the XSDs ask for the element itself.
    for locations in resolved.root.findall("CatalogLocations"):
        for location in list(locations):
            locations.remove(location)
    versions = {path: load(path).version for path in _sources(resolved)}
    version = max([resolved.version, *versions.values()])
    if any(_SINCE_1_1.intersection(element.attrib) for element in resolved.root.iter(*_WORKED_OUT)):
        version = max(version, (1, 1))
    if version >= SAID_SINCE:
        for element in resolved.root.iter(*LEFT_OPEN):
            if _version_of(element, versions, resolved.version) < SAID_SINCE:
                say_left_open(element)
    Node(resolved.root, resolved.path).need("FileHeader").element.set("revMinor", str(version[1]))
    return Document(resolved.path, resolved.root, version, resolved.kind, remarks=resolved.remarks)


def _version_of(element: etree._Element, catalogs: Mapping[str, Version], own: Version) -> Version:
    """The version in which an element was written: that of the catalogue that it came from, or the
    scenario's own."""
    for ancestor in (element, *element.iterancestors()):
        if ancestor.get(SOURCE):
            return catalogs[str(ancestor.get(SOURCE))]
    return own


def _sources(resolved: Document) -> set[str]:
    """The catalogues that entries came from, which may be of a newer version than the scenario."""
    return {str(element.get(SOURCE)) for element in resolved.root.iter() if element.get(SOURCE)}


def concrete_scenarios(path: Path, settings: ExportSettings) -> Iterator[tuple[str, Document]]:
    """Name (without ending) and worked-out document of each scenario that a file stands for.

    A scenario stands for itself, a distribution for its scenario with every chosen set of
    parameters, numbered as by `xosc-run`. What was assumed to read the distribution is among the
    remarks of each.

    Raises:
        Unsupported: there are more than `MAX_SETS` sets.
        UsageError, InvalidFile: as in `Selection.sets` and `xosc.resolve`; the distribution is not
            valid.
    """
    document = load(path)
    work_out = partial(concrete, **settings.resolving)
    if document.kind == "scenario":
        yield path.stem, work_out(document)
        return
    checked(document)
    space = ParameterSpace(path)
    count = settings.selection.count(space)
    current().admit_runs(count, path)
    if count > MAX_SETS:
        raise document.node.unsupported(
            f"{count} sets of parameters would be {count} files, and at most "
            f"{MAX_SETS} are written: "
            "choose some of them with --sample N or --only NUMBERS"
        )
    for index, parameters in settings.selection.sets(space, settings.enforce_constraints):
        scenario = work_out(load(space.scenario), parameters)
        yield (
            numbered(path.stem, index),
            replace(scenario, remarks=(*document.remarks, *scenario.remarks)),
        )


def copied(document: Document) -> Document:
    """A document that may be changed."""
    root = copy.deepcopy(document.root.getroottree()).getroot()
    return Document(document.path, root, document.version, document.kind, remarks=document.remarks)


# conversion to an older version -----------------------------------------------------------------


GRAIN = 2e-6
"""By how much the value of a comparison is moved where its equality is to count: twice the
tolerance (1e-6) with which this runner and esmini compare, so that both find the same border."""

_STRICT = {"greaterOrEqual": ("greaterThan", -GRAIN), "lessOrEqual": ("lessThan", GRAIN)}


def in_version(document: Document, version: Version, draft: Draft) -> Document:
    """A document in another version, with the changes of the table above, and
    `xosc.exports.omissions` unless exports are strict.

    Args:
        draft: gets the remarks.

    Raises:
        Unsupported, InvalidFile: as in `xosc.convert`.
    """
    plain = copied(document)
    if not draft.settings.strict:
        draft.note(*omit(plain, version))
    for since, tag, change in _CHANGES:
        if version < since <= document.version:
            for element in list(plain.root.iter(tag)):
                change(element)
    return convert(plain, version)


def _as_comments(element: etree._Element) -> None:
    header = element.getparent()
    if header is None or header.tag != "FileHeader":
        return
    for part in [element, *element.iterchildren(etree.Element)]:
        parts = [f"{name}={part.get(name)!r}" for name in map(str, part.attrib)] + (
            part.text or ""
        ).split()
        if parts:
            # XML allows no `--` in a comment.
            header.addprevious(
                etree.Comment(f" {part.tag} {' '.join(parts)} ".replace("--", "- -"))
            )
    header.remove(element)


def _mass_as_property(vehicle: etree._Element) -> None:
    mass = vehicle.get("mass")
    if mass is not None:
        del vehicle.attrib["mass"]
        holder = vehicle.find("Properties")
        holder = etree.SubElement(vehicle, "Properties") if holder is None else holder
        holder.insert(0, etree.Element("Property", name="mass", value=mass))


def _name_as_model(pedestrian: etree._Element) -> None:
    if "model" not in pedestrian.attrib and "model3d" not in pedestrian.attrib:
        pedestrian.set("model", pedestrian.get("name", ""))


def _strict(condition: etree._Element) -> None:
    if condition.get("rule") not in _STRICT or "value" not in condition.attrib:
        return
    rule, moved = _STRICT[condition.get("rule", "")]
    try:
        value = number(condition.get("value", ""))
    except ValueError:
        return  # no number, and then no comparison that this version knows
    condition.set("value", repr(value + moved))
    condition.set("rule", rule)


_CHANGES: tuple[tuple[Version, str, Callable[[etree._Element], None]], ...] = (
    ((1, 1), "License", _as_comments),
    ((1, 2), "Properties", _as_comments),
    ((1, 1), "Vehicle", _mass_as_property),
    ((1, 1), "Pedestrian", _name_as_model),
    ((1, 1), "*", _strict),
)
