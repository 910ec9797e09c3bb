"""Tags of scenarios: ASAM OpenLABEL as JSON beside the file, and the same as Properties of its
FileHeader.

Source: ASAM OpenLABEL 1.0.0, chapter 8 (scenario tagging). A tag is a class of an ontology, with or
without a value; a class is used once for a file. What ASAM's ontology has no class for comes from
an ontology of this project.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from schemas.common.errors import InvalidFile, Unsupported, UsageError
from xosc.document import Document, load

ASAM = "https://openlabel.asam.net/V1-0-0/ontologies/openlabel_ontology_scenario_tags.ttl"
"""Ontology of the standard's own scenario tags."""
OWN = "urn:xosc-toolchain:scenario-tags:1"
"""Ontology of the tags that the standard has no class for."""

PREFIX = "openlabel."
"""Prefix of the names of properties that are tags."""

Value = bool | float | str | Sequence[float] | Sequence[str] | None


class Tag(NamedTuple):
    """A tag.

    type: class of its ontology, in PascalCase (administrative ones in camelCase). value: None where
    the class says all.
    """

    type: str
    value: Value = None
    ontology: str = OWN


def openlabel(tags: Sequence[Tag], file: str, annotator: str) -> dict[str, Any]:
    """The JSON object of an OpenLABEL file.

    Args:
        tags: in any order; they are sorted.
        file: the tagged file, relative to the OpenLABEL file.
        annotator: person or program that added the tags.

    Raises:
        UsageError: two tags have the same type.
    """
    tags = _sorted(tags)
    # Numbered by their uris, so that the same tags give the same file.
    ontologies = {
        uri: str(number) for number, uri in enumerate(sorted({tag.ontology for tag in tags}))
    }
    entries = {
        str(number): _entry(tag, ontologies[tag.ontology]) for number, tag in enumerate(tags)
    }
    metadata = {"schema_version": "1.0.0", "tagged_file": file, "annotator": annotator}
    named = {number: {"uri": uri} for uri, number in ontologies.items()}
    return {"openlabel": {"metadata": metadata, "ontologies": named, "tags": entries}}


def to_bytes(tags: Sequence[Tag], file: str, annotator: str) -> bytes:
    """The content of an OpenLABEL file; arguments as in `openlabel`."""
    return (
        json.dumps(openlabel(tags, file, annotator), indent=1, ensure_ascii=False, allow_nan=False)
        + "\n"
    ).encode()


def read(path: str | PathLike[str]) -> list[Tag]:
    """The tags of an OpenLABEL file.

    Raises:
        InvalidFile: it is not readable, or holds tags in a form that OpenLABEL does not know.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))["openlabel"]
        named = {
            key: ontology if isinstance(ontology, str) else ontology["uri"]
            for key, ontology in content.get("ontologies", {}).items()
        }
        return [
            Tag(tag["type"], _value(tag.get("tag_data")), named[tag["ontology_uid"]])
            for tag in content["tags"].values()
        ]
    # All that a file of another program may lack or have otherwise: its tags are one sentence, not
    # a traceback.
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        IndexError,
        RecursionError,
    ) as error:
        raise InvalidFile(
            f"not readable as OpenLABEL tags: {type(error).__name__}: {error}", path=path
        ) from None


def tags_of(scenario: str | PathLike[str]) -> list[Tag]:
    """The tags of a scenario: those of the OpenLABEL file beside it, or else those among the
    properties of its FileHeader.

    Properties are texts and name no ontology: such tags have the text as value (none for `true`)
    and this project's ontology.

    Raises:
        InvalidFile: one of the two files is not readable.
    """
    path = Path(scenario)
    beside = path.with_name(f"{path.stem}.openlabel.json")
    # The file says more: properties are texts without an ontology.
    if beside.is_file():
        return read(beside)
    tags = {
        entry.get("name", ""): entry.get("value", "")
        for entry in load(path).root.iterfind("FileHeader/Properties/Property")
    }
    named = {
        name.removeprefix(PREFIX): value for name, value in tags.items() if name.startswith(PREFIX)
    }
    return _sorted([Tag(name, None if value == "true" else value) for name, value in named.items()])


def properties(tags: Sequence[Tag]) -> dict[str, str]:
    """The tags as names and values of FileHeader properties."""
    return {f"{PREFIX}{tag.type}": _text(tag.value) for tag in _sorted(tags)}


def annotated(document: Document, tags: Sequence[Tag]) -> Document:
    """A copy of a document with these tags in its FileHeader in the place of all former ones; other
    properties stay.

    Raises:
        Unsupported: its version (before 1.2) has no properties in the FileHeader.
        InvalidFile: it has no FileHeader.
    """
    if document.version < (1, 2):
        version = ".".join(map(str, document.version))
        raise Unsupported(
            f"OpenSCENARIO {version} has no Properties in the FileHeader; versions from 1.2 on do",
            path=document.path,
        )
    # Documents are shared, so only the copy is changed.
    root = copy.deepcopy(document.root)
    header = root.find("FileHeader")
    if header is None:
        raise InvalidFile("there is no FileHeader", path=document.path)
    holder = header.find("Properties")
    if holder is None:
        holder = etree.SubElement(header, "Properties")
    for old in [
        entry
        for entry in holder.iterchildren("Property")
        if (entry.get("name") or "").startswith(PREFIX)
    ]:
        holder.remove(old)
    for number, (name, value) in enumerate(properties(tags).items()):
        # At the front and in order: the schema does not say where, a diff does.
        holder.insert(number, etree.Element("Property", name=name, value=value))
    return Document(document.path, root, document.version, document.kind)


def _sorted(tags: Sequence[Tag]) -> list[Tag]:
    """Return the tags sorted by ontology and type.

    Raises:
        UsageError: a type is there twice.
    """
    # Sorted, so that the same tags give the same file.
    ordered = sorted(tags, key=lambda tag: (tag.ontology, tag.type))
    types = [tag.type for tag in ordered]
    twice = next((name for name in types if types.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"the tag {twice} is there twice")
    return ordered


def _entry(tag: Tag, ontology: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"type": tag.type, "ontology_uid": ontology}
    if tag.value is not None:
        entry["tag_data"] = _data(tag.value)
    return entry


def _data(value: bool | float | str | Sequence[float] | Sequence[str]) -> Mapping[str, Any]:
    # First, since a bool is an int to Python.
    if isinstance(value, bool):
        return {"boolean": [{"type": "value", "val": value}]}
    if isinstance(value, int | float):
        return {"num": [{"type": "value", "val": value}]}
    if isinstance(value, str):
        return {"text": [{"type": "value", "val": value}]}
    return {"vec": [{"type": "values", "val": list(value)}]}


def _value(data: Any) -> Value:
    if data is None or isinstance(data, str):
        return data
    kind = next(iter(data))
    if kind not in ("boolean", "num", "text", "vec"):
        raise ValueError(f"tag_data of {kind!r}")
    value = data[kind][0]["val"]
    return tuple(value) if kind == "vec" else value


def _text(value: Value) -> str:
    if value is None or value is True:
        return "true"
    if value is False:
        return "false"
    if isinstance(value, str | int | float):
        return str(value)
    return "; ".join(map(str, value))
