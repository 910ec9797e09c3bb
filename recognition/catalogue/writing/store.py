"""The folder of a catalogue: files that are written again unless a person has edited them.

The manifest holds the hash of every file as it was written. A file that differs from its hash, or
that has none, is a person's: it is left alone and reported."""

from __future__ import annotations

import json
from pathlib import Path, PurePath

from schemas.common.errors import InvalidFile
from schemas.common.storage import digest, keep, read_object, writing

MANIFEST = "manifest.json"


class Store:
    """A catalogue's folder.

    Args:
        root: the folder; made where it does not exist.

    Attributes:
        edited: files (relative to the root) that a person has edited, so that they were not
            written.

    Raises:
        UsageError: it can't be made.
        InvalidFile: its manifest is not readable.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.edited: list[str] = []
        self._before = _manifest(root / MANIFEST)
        self._now: dict[str, str] = {}
        with writing("this", root):
            root.mkdir(parents=True, exist_ok=True)

    @property
    def written(self) -> dict[str, str]:
        """Digests of the files written, by name."""
        return self._now

    def take(self, files: dict[str, str], edited: list[str]) -> None:
        """Take in what another store of the same folder has written and left alone."""
        self._now |= files
        self.edited += edited

    def write(self, name: str, content: bytes) -> bool:
        """Write a file, named relative to the root; False where there is one that a person has
        edited."""
        if not write_unless_edited(self.root / name, content, self._before.get(name)):
            self.edited.append(name)
            return False
        self._now[name] = digest(content)
        return True

    def discard(self, name: str) -> bool:
        """Remove a file that was written now; False where it was not, or has another content by
        now."""
        path = self.root / name
        if self._now.get(name) is None or digest(path.read_bytes()) != self._now[name]:
            return False
        with writing("this", path):
            path.unlink()
            _remove_empty(path.parent, self.root)
        del self._now[name]
        return True

    def close(self) -> list[str]:
        """Remove what earlier runs have written and this one has not, and write the manifest; the
        files that were removed."""
        stale = sorted(self._before.keys() - self._now.keys() - set(self.edited))
        removed = []
        for name in stale:
            path = self.root / name
            if not path.is_file():
                continue
            if digest(path.read_bytes()) != self._before[name]:
                self.edited.append(name)
                continue
            with writing("this", path):
                path.unlink()
                _remove_empty(path.parent, self.root)
            removed.append(name)
        kept = {name: self._before[name] for name in self.edited if name in self._before}
        text = (
            json.dumps(
                {"files": dict(sorted((self._now | kept).items()))}, indent=1, ensure_ascii=False
            )
            + "\n"
        )
        with writing("this", self.root / MANIFEST):
            keep(text.encode(errors="backslashreplace"), self.root / MANIFEST)
        return removed


def write_unless_edited(path: Path, content: bytes, before: str | None) -> bool:
    """Write a file unless a person has edited it: its `digest` is neither that of the content nor
    the earlier one."""
    with writing("this", path):
        found = path.read_bytes() if path.is_file() else None
        if found is not None and found != content and digest(found) != before:
            return False
        keep(content, path)
    return True


def digests(path: Path) -> dict[str, str]:
    """The digests of files by name as a JSON file has them under "files"; none where there is no
    such file.

    Raises:
        InvalidFile: it is not readable, or has something else.
    """
    if not path.is_file():
        return {}
    files = read_object(path).get("files")
    if not isinstance(files, dict):
        raise InvalidFile("the digests of files are expected, in an object 'files'", path=path)
    return {name: str(value) for name, value in files.items()}


def _manifest(path: Path) -> dict[str, str]:
    files = digests(path)
    if any(".." in PurePath(name).parts or PurePath(name).is_absolute() for name in files):
        raise InvalidFile("the manifest names files outside of the catalogue", path=path)
    return files


def _remove_empty(folder: Path, root: Path) -> None:
    while folder != root and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent
