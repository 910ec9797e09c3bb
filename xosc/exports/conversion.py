"""Conversion to an older version for exports: beyond `xosc.versions`, so that files stay valid and move as before.

What an older version cannot express, although no motion depends on it, is kept in a form that it has:

| of | before | becomes |
|---|---|---|
| License, Properties of the FileHeader | 1.1, 1.2 | comments before it |
| mass of a vehicle | 1.1 | one of its properties |
| no model of a pedestrian | 1.1 | its name as model |
| rule greaterOrEqual, lessOrEqual | 1.1 | greaterThan, lessThan, the value moved by `GRAIN` |

Everything else is the business of `xosc.versions`: converted without loss, or refused.
"""

from __future__ import annotations

from collections.abc import Callable

from lxml import etree

from schemas.values import number
from xosc.document import Document
from xosc.exports.concrete import copied
from xosc.exports.draft import Draft
from xosc.exports.omissions import omit
from xosc.versions import Version, convert

GRAIN = 2e-6
"""By how much the value of a comparison is moved where its equality is to count: twice the tolerance (1e-6) with which this
runner and esmini compare, so that both find the same border."""

_STRICT = {"greaterOrEqual": ("greaterThan", -GRAIN), "lessOrEqual": ("lessThan", GRAIN)}


def in_version(document: Document, version: Version, draft: Draft) -> Document:
    """A document in another version, with the changes of the table above, and `xosc.exports.omissions` unless exports are strict.

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
    for each in [element, *element.iterchildren(etree.Element)]:
        parts = [f"{name}={each.get(name)!r}" for name in map(str, each.attrib)] + (each.text or "").split()
        if parts:
            header.addprevious(etree.Comment(f" {each.tag} {' '.join(parts)} ".replace("--", "- -")))
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
