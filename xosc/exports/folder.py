"""The folder that an export writes into: nothing outside it, nothing overwritten unless asked to, one name for one source."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from schemas.common.errors import NotWritten, UsageError
from schemas.common.storage import keep, read_bytes


class Folder:
    """An output folder.

    A file that is there already stays as it is: writing the same content again is no matter, other content is refused.

    Args:
        path: the folder; it is made when the first file is written.
        overwrite: replace files that are there already.
    """

    def __init__(self, path: str | os.PathLike[str], overwrite: bool = False) -> None:
        self.path, self._overwrite = Path(path), overwrite
        self._names: dict[tuple[str, str], str] = {}

    def name(self, source: str | os.PathLike[str], preferred: str) -> str:
        """The name, relative to the folder, of a source's copy: the preferred one, or numbered where another source has that.

        Args:
            source: the file or folder that it is made from.
            preferred: a relative path with `/`, the same whenever the source is named again.
        """
        key = (os.path.abspath(source), preferred)
        if key not in self._names:
            path, taken, number = PurePosixPath(preferred), {name.casefold() for name in self._names.values()}, 1
            while (name := preferred if number == 1 else str(path.with_stem(f"{path.stem}~{number}"))).casefold() in taken:
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
            there = os.path.lexists(path) and not (path.is_file() and path.read_bytes() == content)
            if there and not (self._overwrite and path.is_file() and not path.is_symlink()):
                raise UsageError("this is in the way of an export, which overwrites nothing", path=path)
            keep(content, path)
        except OSError as error:
            raise NotWritten(f"the file can't be written: {error.strerror or error}", path=path) from None

    def write_by(self, name: str, writer: Callable[[Path], object]) -> None:
        """Write a file that a function writes to the path it is given; errors as in `write`."""
        with TemporaryDirectory(prefix="xosc-export-") as scratch:
            path = Path(scratch) / PurePosixPath(name).name
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
