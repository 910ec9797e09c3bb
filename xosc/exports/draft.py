"""The files of an export before they are written, and its folder: what is refused on the way leaves
nothing behind."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import TypedDict

from schemas.catalogs import Folders
from schemas.common.errors import NotWritten, UsageError
from schemas.common.policy import scratch
from schemas.common.remarks import Remark, Remarks
from schemas.common.storage import keep, read_bytes
from xosc.distributions.space import Selection
from xosc.document import Document
from xosc.document.node import Node
from xosc.document.road_files import RoadFile, find_roads, logic_file
from xosc.exports.starts import RoadGeometry

# the folder: nothing outside it, nothing overwritten unless asked to, one name for one source ----


class Folder:
    """An output folder.

    A file with the same content is kept, one with other content is refused.

    Args:
        path: the folder; it is made when the first file is written.
        overwrite: replace files that are there already.
    """

    def __init__(self, path: str | os.PathLike[str], overwrite: bool = False) -> None:
        self.path, self._overwrite = Path(path), overwrite
        self.produced: dict[str, None] = {}
        """Names of the files that were written or are the same, in order."""
        self._names: dict[tuple[str, str], str] = {}

    def name(self, source: str | os.PathLike[str], preferred: str) -> str:
        """The name, relative to the folder, of a source's copy: the preferred one, or numbered
        where another source has that.

        Args:
            source: the file or folder that it is made from.
            preferred: a relative path with `/`, the same whenever the source is named again.
        """
        key = (os.path.abspath(source), preferred)
        if key not in self._names:
            # Case counts for nothing in file names on Windows and macOS.
            path, taken, number = (
                PurePosixPath(preferred),
                {name.casefold() for name in self._names.values()},
                1,
            )
            while (
                name := preferred if number == 1 else str(path.with_stem(f"{path.stem}~{number}"))
            ).casefold() in taken:
                number += 1
            self._names[key] = name
        return self._names[key]

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all, under a name that is relative to the folder.

        Raises:
            UsageError: another file is in the way, or the file can't be written.
        """
        path = self.path / name
        try:
            if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.path)):
                raise UsageError("a symbolic link leads out of the output folder", path=path)
            file = path.is_file() and not path.is_symlink()
            there = os.path.lexists(path) and not (path.is_file() and path.read_bytes() == content)
            if there and not (self._overwrite and file):
                what = (
                    "another file is in the way; --overwrite replaces it"
                    if file
                    else "this is in the way, and is no file"
                )
                raise UsageError(what, path=path)
            keep(content, path)
            self.produced[name] = None
        except OSError as error:
            raise NotWritten(
                f"the file can't be written: {error.strerror or error}", path=path
            ) from None

    def write_by(self, name: str, writer: Callable[[Path], object]) -> None:
        """Write a file that a function writes to the path it is given; errors as in `write`."""
        # Elsewhere first: a writer that fails leaves nothing in the folder.
        with scratch("xosc-export-") as folder:
            path = folder / PurePosixPath(name).name
            writer(path)
            self.write(name, path.read_bytes())

    def copy(self, source: Path, preferred: str) -> str:
        """Copy a file that an exported one refers to; the name that it got.

        Raises:
            InvalidFile: the source can't be read.
            UsageError: as in `write`.
        """
        content = read_bytes(source)
        name = self.name(source, preferred)
        self.write(name, content)
        return name


# the files before they are written --------------------------------------------------------------


Roads = Callable[[Node], RoadFile | None]
"""The road network of a scenario, by its root; None where it has none; errors as in
`xosc.document.road_files.find_roads`."""


def roads_in(*folders: str | PathLike[str]) -> Roads:
    """The road networks that scenarios name, looked for in these folders too."""

    def roads(scenario: Node) -> RoadFile | None:
        logic = logic_file(scenario)
        return find_roads(logic, folders) if logic is not None else None

    return roads


Locate = Callable[[Document], RoadGeometry]
"""Puts a worked-out scenario on its roads; errors as in a run."""


class Resolving(TypedDict):
    """Settings for resolving documents, as in `xosc.resolve`."""

    enforce_constraints: bool
    strict: bool
    catalog_path: Folders


@dataclass(frozen=True)
class ExportSettings:
    """Settings of an export.

    Args:
        strict: refuse what is otherwise repaired, changed or left out with a remark.
        roads: where road networks are.
        locate: puts scenarios on their roads; None leaves out the changes that need it.
        catalog_path: folders in which directories of catalogues are looked for that are not where
            the scenario says.
        selection: parameter sets of distributions that are exported; where it leaves any out, a
            scenario is written for each.
        enforce_constraints: refuse worked-out values that violate their constraint groups, and
            leave such sets of a distribution out.
        needs_road: refuse a scenario whose road network is nowhere.
    """

    strict: bool = False
    roads: Roads = field(default_factory=roads_in)
    locate: Locate | None = None
    catalog_path: Folders = ()
    selection: Selection = field(default_factory=Selection)
    enforce_constraints: bool = True
    needs_road: bool = True

    @property
    def resolving(self) -> Resolving:
        """Subset of them that `xosc.resolve` takes."""
        return {
            "enforce_constraints": self.enforce_constraints,
            "strict": self.strict,
            "catalog_path": self.catalog_path,
        }


DEFAULTS = ExportSettings()


class Draft:
    """Files by name, relative to an output folder, and remarks on them.

    Args:
        folder: it is written into.
        settings: of the export.
    """

    def __init__(self, folder: Folder, settings: ExportSettings) -> None:
        self.folder = folder
        self.settings = settings
        self._files: dict[str, bytes] = {}
        self._remarks: dict[str, None] = {}

    def copy(self) -> Draft:
        """A copy to add to: it can be dropped if that fails."""
        draft = Draft(self.folder, self.settings)
        draft.take(self)
        return draft

    def take(self, other: Draft) -> None:
        """Add the files and remarks of another draft."""
        self._files |= other._files
        self._remarks |= other._remarks

    def add(self, name: str, content: bytes) -> None:
        """Add a file."""
        self._files[name] = content

    def content(self, name: str) -> bytes:
        """Content of a file that was added."""
        return self._files[name]

    def note(self, *remarks: str | Remark) -> None:
        """Add remarks, each once.

        Raises:
            InvalidFile: one is on a repair, and exports are strict.
        """
        Remarks(self.settings.strict).add(
            *(remark for remark in remarks if isinstance(remark, Remark))
        )
        self._remarks.update(dict.fromkeys(map(str, remarks)))

    def write(self, *also: str) -> Sequence[str]:
        """Write the files, after all checks.

        Args:
            also: remarks that come first.

        Returns:
            All remarks.

        Raises:
            UsageError: a file is in the way, or can't be written.
        """
        for name, content in self._files.items():
            self.folder.write(name, content)
        return list(dict.fromkeys((*also, *self._remarks)))
