"""Standard, version and kind of a file, and the official XSD for it.

XSDs are not part of this package. They are found in installed packages (scenariogeneration, which
is a dependency, and ASAM's checker bundles where they are installed) and in the folder that the
environment variable `XOSC_SCHEMA_DIR` names, searched with its subfolders. An XSD is recognised by
what it says itself: it declares the standard's root element, and its heading names the standard and
version. Of several for the same version a file of XOSC_SCHEMA_DIR wins, then the higher patch
level: 1.3 files are validated with 1.3.1. A version that has none is made of an earlier version's
by `schemas.versions.differences`, over several versions where that is needed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property, reduce
from importlib import metadata
from pathlib import Path

from lxml import etree

from schemas.common.errors import InvalidFile, UsageError
from schemas.common.xml import line_of, local_name, parse
from schemas.versions.differences import Difference, applied, known_differences, whole

OPENSCENARIO, OPENDRIVE = "OpenSCENARIO", "OpenDRIVE"
SCHEMA_DIR = "XOSC_SCHEMA_DIR"

HEADERS = {OPENSCENARIO: "FileHeader", OPENDRIVE: "header"}
_PACKAGES = ("scenariogeneration", "asam-qc-openscenarioxml", "asam-qc-opendrive")
_HEADING_BYTES = 4096
_HEADING = re.compile(
    rb"(OpenSCENARIO|OpenDRIVE)\b[^<>]{0,60}?(?:V|Rev\. ?)(\d+)\.(\d+)(?:\.(\d+))?"
)
_ROOT_ELEMENT = re.compile(rb"<\w+:element name=\"(?:OpenSCENARIO|OpenDRIVE)\"")
_XSD_1_1 = re.compile(rb"<\w+:(?:assert|alternative|openContent|override)\b|minVersion=\"1\.1\"")


@dataclass(frozen=True)
class FileType:
    """Type of a document: standard and version.

    Attributes:
        standard: "OpenSCENARIO" or "OpenDRIVE".
        version: major and minor revision.
        kind: "scenario", "catalog", "distribution" (of parameter values) or "road".
    """

    standard: str
    version: tuple[int, int]
    kind: str

    def __str__(self) -> str:
        return f"{self.standard} {self.version[0]}.{self.version[1]}"


@dataclass(frozen=True)
class Schema:
    """An official XSD, or one that is made of an official XSD and differences.

    Attributes:
        standard: "OpenSCENARIO" or "OpenDRIVE".
        version: major, minor and patch level of the standard.
        path: the XSD that declares the root element; it includes its neighbours by relative names.
        differences: changes to that XSD, in order; none where it is that of the version itself.
    """

    standard: str
    version: tuple[int, int, int]
    path: Path
    differences: tuple[Difference, ...] = ()

    def __str__(self) -> str:
        return f"{self.standard} {'.'.join(map(str, self.version))}"

    def tree(self) -> etree._ElementTree:
        """The parsed XSD, with the differences applied.

        Raises:
            InvalidFile: the file can't be read or is no XML.
        """
        return reduce(
            lambda tree, difference: applied(difference, tree),
            self.differences,
            whole(self.path) if self.differences else parse(self.path),
        )

    @cached_property
    def xsd_1_1(self) -> bool:
        """Whether it, or a file beside it that it includes, needs an XSD 1.1 processor.

        The official schemas keep their parts in one folder, so the neighbours it includes are
        looked at as well.
        """
        if any(difference.xsd_1_1 for difference in self.differences):
            return True
        content = self.path.read_bytes()
        names = re.findall(rb"schemaLocation=\"([^\"/\\]+)\"", content)
        parts = [self.path.parent / name.decode(errors="replace") for name in names]
        return any(
            _XSD_1_1.search(text)
            for text in [content, *(part.read_bytes() for part in parts if part.is_file())]
        )


def detect(tree: etree._ElementTree) -> FileType:
    """Standard, version and kind of a parsed document.

    Raises:
        InvalidFile: the root element is of neither standard, or the header with the revision is
            missing or malformed.
    """
    root = tree.getroot()
    path = tree.docinfo.URL
    standard = local_name(root)
    if standard not in HEADERS:
        message = f"the root element is <{standard}>, OpenSCENARIO or OpenDRIVE is expected"
        raise InvalidFile(message, path=path, line=line_of(root))
    header = header_of(root)
    if header is None:
        message = f"the element {HEADERS[standard]}, which holds the version, is missing"
        raise InvalidFile(message, path=path, line=line_of(root), element=standard)
    version = revision(header.get("revMajor")), revision(header.get("revMinor"))
    if version[0] is None or version[1] is None:
        message = (
            "the attributes revMajor and revMinor must hold the version, two non-negative integers"
        )
        raise InvalidFile(message, path=path, line=line_of(header), element=local_name(header))
    return FileType(standard, (version[0], version[1]), _kind(root))


def header_of(root: etree._Element) -> etree._Element | None:
    """The element that holds the version."""
    name = HEADERS.get(local_name(root))
    return next((child for child in root if name and local_name(child) == name), None)


def revision(text: str | None) -> int | None:
    """A part of the version, an unsignedShort; None for anything else."""
    if text is None or not re.fullmatch(r"\s*\+?\d{1,5}\s*", text, re.ASCII) or int(text) > 65535:
        return None
    return int(text)


def schema_for(standard: str, version: tuple[int, int]) -> Schema | None:
    """The XSD to validate that version with, or None where none is at hand.

    Raises:
        UsageError: XOSC_SCHEMA_DIR does not name a folder.
    """
    return _schemas(os.environ.get(SCHEMA_DIR, "")).get((standard, *version))


def available_schemas() -> list[Schema]:
    """Every XSD at hand, one a version, sorted."""
    return [schema for _, schema in sorted(_schemas(os.environ.get(SCHEMA_DIR, "")).items())]


def _kind(root: etree._Element) -> str:
    if local_name(root) == OPENDRIVE:
        return "road"
    children = {local_name(child) for child in root}
    if "Catalog" in children and "Storyboard" not in children:
        return "catalog"
    return "distribution" if "ParameterValueDistribution" in children else "scenario"


@cache
def _schemas(folder: str) -> dict[tuple[str, int, int], Schema]:
    if folder and not Path(folder).expanduser().is_dir():
        raise UsageError(f"{SCHEMA_DIR} names {folder!r}, which is not a folder")
    schemas: dict[tuple[str, int, int], Schema] = {}
    bases: dict[tuple[str, tuple[int, int, int]], Schema] = {}
    # The folder that the user names comes last, and so wins over packages.
    for files in (_installed(), Path(folder).expanduser().rglob("*.xsd") if folder else ()):
        group = sorted(
            (schema for path in files if (schema := _read(path))),
            key=lambda schema: (schema.version, schema.path),
        )
        # Sorted by patch level: the highest of a version is written last and stays.
        schemas |= {(schema.standard, *schema.version[:2]): schema for schema in group}
        bases |= {(schema.standard, schema.version): schema for schema in group}
    # In ascending order, so that a made XSD can be the base of the next; one at hand wins.
    for difference in known_differences():
        base = _base(difference, bases)
        if base is not None:
            made = Schema(
                difference.standard, difference.version, base.path, (*base.differences, difference)
            )
            schemas.setdefault((made.standard, *made.version[:2]), made)
            bases.setdefault((made.standard, made.version), made)
    return schemas


def _base(
    difference: Difference, bases: dict[tuple[str, tuple[int, int, int]], Schema]
) -> Schema | None:
    """The XSD of the version that a difference is from, or of a later patch level of it."""
    schemas = [
        schema for (standard, version), schema in bases.items() if standard == difference.standard
    ]
    fitting = [
        schema
        for schema in schemas
        if schema.version[:2] == difference.base[:2] and schema.version >= difference.base
    ]
    return min(fitting, key=lambda schema: schema.version, default=None)


def _installed() -> Iterator[Path]:
    for package in _PACKAGES:
        try:
            files = metadata.files(package) or []
        except metadata.PackageNotFoundError:
            continue
        yield from (Path(str(file.locate())) for file in files if file.suffix == ".xsd")


def _read(path: Path) -> Schema | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    heading = _HEADING.search(content[:_HEADING_BYTES])
    if heading is None or not _ROOT_ELEMENT.search(content):
        return None
    standard, major, minor, patch = (group.decode() if group else "0" for group in heading.groups())
    return Schema(standard, (int(major), int(minor), int(patch)), path)
