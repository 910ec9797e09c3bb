"""OpenSCENARIO files as documents: reading and writing them.

Modules:

- `carla`: differences between scenarios for CARLA's scenario_runner and the standard
- `node`: typed, located access to the elements of a resolved OpenSCENARIO document
- `repairs`: repairs of documents as they are loaded
- `road_files`: location of a scenario's road network: the path of its LogicFile

Example::

    xosc.load("mine.xosc").node.need("Storyboard")
"""

from __future__ import annotations

import copy
import os
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from lxml import etree

from schemas.checks.structure import SCHEMA_UID
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.remarks import Remark, Remarks
from schemas.common.storage import Stamp, drafted, stamp, writing
from schemas.common.xml import line_of, local_name, parse
from schemas.versions.registry import OPENSCENARIO, detect
from xosc.document.node import OWN, Node
from xosc.document.repairs import repair

VERSIONS = ((1, 0), (1, 1), (1, 2), (1, 3), (1, 4))
"""Versions of OpenSCENARIO XML that are read and written."""


@dataclass(frozen=True, eq=False)
class Document:
    """A parsed OpenSCENARIO file.

    Documents are cached and shared: work on a copy of `root` to change one.

    Attributes:
        path: the file it was read from, as the caller named it.
        root: the element OpenSCENARIO.
        version: major and minor revision of the standard.
        kind: "scenario", "catalog" or "distribution" (of parameter values).
        remarks: what was assumed to read the file, or to resolve it.

    Example:
        >>> import xosc_toolchain as xt
        >>> document = xt.load("xosc/library/simple_cut_in.xosc")
        >>> [entity.get("name") for entity in document.node.iter("ScenarioObject")]
        ['Ego', 'CutIn']
    """

    path: Path
    root: etree._Element
    version: tuple[int, int]
    kind: str
    remarks: tuple[Remark, ...] = field(default=(), kw_only=True)

    @property
    def node(self) -> Node:
        """The root, typed and located."""
        return Node(self.root, self.path)


def load(path: str | os.PathLike[str], *, strict: bool = False) -> Document:
    """Read an OpenSCENARIO file of version 1.0 to 1.4: a scenario, a catalogue or a parameter value
    distribution.

    Documents are cached; a file whose modification time or size has changed is read again. Faults
    that leave one sensible meaning are repaired, each with a remark.

    Args:
        path: the file.
        strict: refuse such faults.

    Raises:
        InvalidFile: the file can't be read, is not well-formed XML, or is not OpenSCENARIO XML.
        Unsupported: it is of another version.

    Example:
        >>> import xosc_toolchain as xt
        >>> document = xt.load("xosc/library/simple_cut_in.xosc")
        >>> document.kind, document.version
        ('scenario', (1, 3))
    """
    name = os.fspath(path)
    document = _load(name, stamp(name))
    # Outside of the cache: a lenient reading of the same file may have filled it.
    Remarks(strict).add(*document.remarks)
    return document


def write(document: Document, path: str | os.PathLike[str]) -> None:
    """Write a document, indented, as UTF-8; the same document always gives the same bytes.

    File references stay as they are, relative to the place that they were written for.

    Raises:
        UsageError: the file can't be written.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.write(xt.load("xosc/library/simple_cut_in.xosc"), "copy.xosc")
        >>> xt.load("copy.xosc").kind
        'scenario'
    """
    with writing("the file", Path(path)), drafted(Path(path)) as draft:
        draft.write_bytes(to_bytes(document))


def to_bytes(document: Document) -> bytes:
    """The content of the file that `write` makes of a document."""
    tree = copy.deepcopy(document.root.getroottree())
    etree.strip_attributes(tree, *OWN)
    etree.cleanup_namespaces(tree, keep_ns_prefixes=["xsi"])
    etree.indent(tree, "  ")
    return etree.tostring(tree, xml_declaration=True, encoding="UTF-8") + b"\n"


@lru_cache(maxsize=256)
def _load(path: str, _: Stamp) -> Document:
    remarks: list[Remark] = []
    tree = parse(path, remarks)
    root = tree.getroot()
    # No file may claim these: by SOURCE its errors and relative paths would be those of another
    # file.
    etree.strip_attributes(tree, *OWN)
    node = Node(root, Path(path))
    if root.tag != OPENSCENARIO and local_name(root) == OPENSCENARIO:
        remarks.append(
            node.remark(
                SCHEMA_UID,
                "OpenSCENARIO elements are in no XML namespace; that of the file is left out",
            )
        )
        for element in root.iter(etree.Element):
            element.tag = local_name(element)
        etree.cleanup_namespaces(tree)
    if root.tag == OPENSCENARIO:
        remarks += repair(node, VERSIONS)
    file = detect(tree)
    if file.standard != OPENSCENARIO:
        raise InvalidFile(
            f"this is {file.standard}, an OpenSCENARIO file is expected",
            path=path,
            line=line_of(root),
        )
    if file.version not in VERSIONS:
        first, last = (".".join(map(str, version)) for version in (VERSIONS[0], VERSIONS[-1]))
        message = (
            f"{file} is not supported, only versions {first} to {last} of OpenSCENARIO XML are"
        )
        raise Unsupported(message, path=path, line=line_of(root))
    return Document(Path(path), root, file.version, file.kind, remarks=tuple(remarks))
