"""The elements of an OpenDRIVE file, to be changed and written again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from lxml import etree

from schemas.common.errors import InvalidFile
from schemas.common.remarks import Remark
from schemas.common.xml import local_name, parse
from xodr.reader import elements, load
from xodr.reader.repairs import repair


class EditedRoads:
    """An OpenDRIVE file with the repairs that loading makes in memory.

    Attributes:
        path: the file.
        root: its root element; names of elements are without the namespace that the file may have.
        remarks: the repairs, each with its rule and line.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Read a file.

        Raises:
            InvalidFile: it is no OpenDRIVE file, or has a fault that has no sensible mend.
        """
        self.path = Path(path)
        load(self.path)  # refuses by file, line and element
        outside: list[Remark] = []
        self.root = parse(self.path, outside).getroot()
        self._namespace: str | None = etree.QName(self.root).namespace
        _rename(self.root, None)
        self.remarks = [str(remark) for remark in (*outside, *repair(self.root, self.path))]

    def content(self) -> bytes:
        """Bytes of the file as it is now."""
        with self._named():
            return etree.tostring(self.root.getroottree(), xml_declaration=True, encoding="UTF-8")

    def leave_namespace(self) -> bool:
        """Write names of elements without a namespace from now on; whether there was one."""
        there = self._namespace is not None
        self._namespace = None
        etree.cleanup_namespaces(self.root)  # else the root still declares it
        return there

    @contextmanager
    def _named(self) -> Iterator[None]:
        if self._namespace is not None:
            _rename(self.root, self._namespace)
        yield
        if self._namespace is not None:
            _rename(self.root, None)


def _rename(root: etree._Element, namespace: str | None) -> None:
    """Put all names of elements into a namespace, or take it from them."""
    for element in root.iter("{*}*"):
        name = local_name(element)
        element.tag = name if namespace is None else f"{{{namespace}}}{name}"


def number(element: etree._Element, name: str, path: Path, default: float = 0.0) -> float:
    """An attribute as a finite number, of elements that loading does not read.

    Raises:
        InvalidFile: it is none; names file, line and element.
    """
    try:
        return elements.number(element, name, default)
    except InvalidFile as error:
        error.path = str(path)
        raise


def remove(element: etree._Element) -> None:
    """Take an element out of its parent."""
    parent = element.getparent()
    assert parent is not None
    parent.remove(element)
