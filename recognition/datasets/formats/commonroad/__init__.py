"""CommonRoad XML scenarios (2018b, 2020a), as files or packed in a tar archive.

Source: CommonRoad "XML Format", 2018b and 2020a. Archives are read from front to back, without unpacking them. A scenario brings
its own map along, made of lanelets (`lanelets.road_of`).
"""

from __future__ import annotations

import lzma
import re
import tarfile
import zlib
from functools import lru_cache, partial
from pathlib import Path
from typing import Self

from lxml import etree

from recognition.datasets.formats.commonroad.elements import invalid, unsupported
from recognition.datasets.formats.commonroad.lanelets import road_of
from recognition.datasets.formats.commonroad.obstacles import recording_of
from recognition.datasets.source import Report, SiteRoad, Source
from runner.recording import Recording
from schemas.errors import InvalidFile
from schemas.storage import MAX_BYTES
from schemas.xml import parse, parse_bytes

FORMAT = "CommonRoad"
TITLE = "CommonRoad"
BY_CONTENT = True
_VERSIONS = ("2018b", "2020a")
_ARCHIVES = (".tar", ".tar.xz", ".tar.gz", ".tar.bz2", ".tgz", ".txz")
_ENDING = ".xml"
_HEAD = 4096
_ID = re.compile(r"(?P<site>[^_]+_[^_]+)_.*")
_BROKEN = (tarfile.TarError, lzma.LZMAError, zlib.error, EOFError, OSError, ValueError, KeyError)


def claims(path: Path) -> bool:
    """Whether a file is a CommonRoad scenario, or an archive that may hold some."""
    if path.name.endswith(_ARCHIVES):
        return True
    if path.suffix != _ENDING:
        return False
    try:
        with path.open("rb") as file:
            return b"<commonRoad" in file.read(_HEAD)
    except OSError:
        return False


def sources(path: Path, roads: Path) -> list[Source]:
    """The scenario of a file, or those of an archive in its order."""
    if not path.name.endswith(_ARCHIVES):
        return [_source(path, None)]
    return [_source(path, member) for member in _members(path) if member.endswith(_ENDING)]


def _source(path: Path, member: str | None) -> Source:
    """A scenario; those of one map number, as in USA_US101-9_1_T-1, have one site."""
    name = (member or path.name).removesuffix(_ENDING)
    named = _ID.fullmatch(Path(name).name)
    site = named["site"] if named else name
    read, map_ = partial(_read, path, member), None if member else path
    return Source(name, site, FORMAT, path, read, map_, road=partial(_road, path, member, site))


def _read(path: Path, member: str | None) -> tuple[Recording, Report]:
    return recording_of(document(path, member))


def _road(path: Path, member: str | None, site: str, _recording: Recording, folder: Path) -> SiteRoad:
    return road_of(document(path, member), site, folder)


def document(path: Path, member: str | None = None) -> etree._Element:
    """The root element of a scenario, which is a file or a member of an archive.

    Raises:
        InvalidFile: it can't be read, or is not CommonRoad.
        Unsupported: it has another version than 2018b and 2020a.
    """
    tree = parse(path) if member is None else parse_bytes(_content(path, member), path / member)
    root = tree.getroot()
    if root.tag != "commonRoad":
        raise invalid(root, "the root element of a scenario is commonRoad")
    version = root.get("commonRoadVersion")
    if version not in _VERSIONS:
        raise unsupported(root, f"version {version!r} is none of {', '.join(_VERSIONS)}")
    return root


class _Entry(tarfile.TarInfo):
    """An entry of an archive. Python takes a damaged header for the end of the archive; here it is an error."""

    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> Self:
        """An entry from a block of an archive, as in the base class."""
        try:
            return super().frombuf(buf, encoding, errors)
        except tarfile.HeaderError as error:
            if buf and not any(buf):
                raise  # a block of zeros is how an archive ends
            raise tarfile.ReadError(str(error)) from None


@lru_cache(maxsize=1)
def _archive(path: Path, _version: int) -> dict[str, tuple[tarfile.TarFile, tarfile.TarInfo]]:
    """The files of an archive by name; it stays open, so that reading them one after the other unpacks it once."""
    archive = tarfile.open(path, tarinfo=_Entry)  # noqa: SIM115 - it stays open
    return {member.name: (archive, member) for member in archive.getmembers() if member.isfile()}


def _members(path: Path) -> list[str]:
    try:
        return list(_archive(path, path.stat().st_mtime_ns))
    except tarfile.ReadError:
        raise InvalidFile("this is no tar archive, or a damaged one", path=path) from None
    except _BROKEN as error:
        raise InvalidFile(f"the archive can't be read: {error}", path=path) from None


def _content(path: Path, member: str) -> bytes:
    try:
        archive, entry = _archive(path, path.stat().st_mtime_ns)[member]
        if entry.size > MAX_BYTES:
            raise InvalidFile(f"the file has {entry.size} bytes, at most {MAX_BYTES} are read", path=path / member)
        file = archive.extractfile(entry)
        return file.read() if file is not None else b""
    except _BROKEN as error:
        raise InvalidFile(f"the archive can't be read: {error}", path=path / member) from None
