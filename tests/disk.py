"""A disk that fails: tests watch the operations by which something below a
folder is written, and let one of them fail.

Operations without an effect, as making a folder that is there, don't count.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from schemas.common.storage import LOCK

OPERATIONS = ("fsync", "write", "sendfile", "rename", "replace", "mkdir", "unlink", "rmdir")


@contextmanager
def watched(
    root: Path,
    before: Callable[[str], None],
    after: Callable[[str, Any], None] = lambda name, file: None,
) -> Iterator[None]:
    """Call `before` and `after` around each operation by which something below a folder is written.

    What `before` raises stands for the failure of the operation. A file that could not be written
    to is left empty, as a full disk leaves it. Operations of other processes, and of libraries that
    open files by themselves, are not seen.
    """

    def wrapped(
        name: str, real: Callable[..., Any], concerns: Callable[..., bool]
    ) -> Callable[..., Any]:
        def operation(*arguments: Any, **options: Any) -> Any:
            if os.getpid() != process or not concerns(*arguments, **options):
                return real(*arguments, **options)
            try:
                before(name)
            except OSError:
                if name == "table" or (name == "open" and "w" in arguments[1]):
                    real_open(arguments[name == "table"], "wb").close()
                raise
            result = real(*arguments, **options)
            after(name, arguments[0])
            return result

        return operation

    def inside(path: Any, *_: Any, **__: Any) -> bool:
        if isinstance(path, int):
            path = os.readlink(f"/proc/self/fd/{path}")
        return isinstance(path, str | Path) and Path(os.path.abspath(path)).is_relative_to(root)

    def written(path: Any, mode: str = "r", *_: Any, **__: Any) -> bool:
        return not isinstance(path, int) and "r" not in mode and inside(path)

    def concerned(name: str) -> Callable[..., bool]:
        if name == "mkdir":
            return lambda path, *_, **__: inside(path) and not os.path.isdir(path)
        if name in ("unlink", "rmdir"):
            return lambda path, *_, **__: inside(path) and os.path.lexists(path)
        return inside

    real_open, process = io.open, os.getpid()
    with pytest.MonkeyPatch.context() as patch:
        for name in OPERATIONS:
            patch.setattr(os, name, wrapped(name, getattr(os, name), concerned(name)))
        opening = wrapped("open", real_open, written)
        patch.setattr(io, "open", opening)
        patch.setattr(builtins, "open", opening)
        patch.setattr(
            pq,
            "write_table",
            wrapped("table", pq.write_table, lambda table, path, **_: inside(path)),
        )
        patch.setattr(
            "schemas.common.storage._SYNCED", 1
        )  # one after the other, so that operations have numbers
        yield


class Failure:
    """Fails one operation, named by its number; to be given to `watched`.

    Attributes:
        error: the failure, once it has happened.
        name: of the operation that failed.
        count: operations so far.
    """

    def __init__(self, place: int) -> None:
        self.place = place
        self.error: OSError | None = None
        self.name = ""
        self.count = 0

    def __call__(self, name: str) -> None:
        """Take note of an operation that begins.

        Raises:
            OSError: it is the one that fails.
        """
        self.count += 1
        if self.count == self.place + 1:
            number = errno.EIO if name == "fsync" else errno.ENOSPC
            self.error, self.name = OSError(number, os.strerror(number)), name
            raise self.error


class Disk:
    """What of a folder is on the disk: contents of files as they were last
    synced, and of folders their names.

    What is there at the beginning is on the disk.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._files: dict[int, bytes] = {}
        self._folders: dict[int, dict[str, tuple[int, bool]]] = {}
        for path in (root, *root.rglob("*")) if any(root.iterdir()) else ():
            self._note(path)

    def after(self, name: str, file: Any) -> None:
        """Take note of an operation that is done; to be given to `watched`."""
        if name == "fsync":
            self._note(Path(os.readlink(f"/proc/self/fd/{file}")))

    def pictures(self, target: Path) -> dict[str, Path]:
        """Make folders of what would be left if the machine went down now, or the process was
        killed, by the kind of loss.

        Of a machine only what was synced is left, or names without contents that were not synced.
        """
        target.mkdir()
        kinds = {kind: target / kind for kind in ("synced", "names", "killed")}
        self._restore(self.root.stat().st_ino, kinds["synced"])
        self._with_names(kinds["names"], everything=False)
        self._with_names(kinds["killed"], everything=True)
        return kinds

    def _note(self, path: Path) -> None:
        if path.is_dir():
            self._folders[path.stat().st_ino] = {
                each.name: (each.stat().st_ino, each.is_dir()) for each in path.iterdir()
            }
        else:
            self._files[path.stat().st_ino] = path.read_bytes()

    def _restore(self, folder: int, target: Path) -> None:
        target.mkdir()
        for name, (inode, is_folder) in self._folders.get(folder, {}).items():
            if is_folder:
                self._restore(inode, target / name)
            else:
                (target / name).write_bytes(self._files.get(inode, b""))

    def _with_names(self, target: Path, everything: bool) -> None:
        target.mkdir()
        for path in sorted(self.root.rglob("*")):
            copy = target / path.relative_to(self.root)
            if path.is_dir():
                copy.mkdir()
            else:
                copy.write_bytes(
                    path.read_bytes() if everything else self._files.get(path.stat().st_ino, b"")
                )


def files(folder: Path) -> dict[str, bytes]:
    """All files below a folder by name, without locks."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }
