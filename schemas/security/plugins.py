"""Code that a user chooses: classes as `module:Class`, also in the working folder, and entry points of installed packages.

Folders with scenarios come from anyone, and commands are started in them. Python puts the working folder on its path only where
it is started as `python -m`; commands take it off again. The one way from a file in it to code that runs is a class that the
user names: the module is then sought there after all that is installed, and so is what modules from there import, whenever they
do. Nothing else that is imported (an optional library, a module of ours) is sought there.
"""

from __future__ import annotations

import os
import site
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import FrameType, ModuleType

_MACHINERY = ("importlib", "_frozen_importlib")
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable by which other Pythons that are started leave the working folder off their path."""


def leave_working_folder_out() -> None:
    """Take the working folder off the path where Python put it itself (`python -m`), here and in processes that are started."""
    os.environ[SAFE_PATH] = "1"
    if not sys.flags.safe_path and sys.path and _is_working_folder(sys.path[0]):
        del sys.path[0]


def _is_working_folder(entry: str) -> bool:
    """Whether an entry of the path is the working folder; that of a package's own source (`pip install -e`) comes later."""
    return os.path.realpath(entry or os.curdir) == os.path.realpath(os.curdir)


# classes that the user names ----------------------------------------------------------------------


class _WorkingFolder:
    """Finds modules in a folder, for the import of those that were asked for and for imports by what came from it.

    A meta path finder (`importlib.abc.MetaPathFinder`); the last one, so that what is installed comes first.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.wanted = ""
        self._found: set[str] = set()

    def find_spec(self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module of that name in the folder; packages find their own submodules."""
        if path is not None or not (fullname == self.wanted or _importer(sys._getframe(1)) in self._found):
            return None
        found = PathFinder.find_spec(fullname, [self.folder])
        if found is not None:
            self._found.add(fullname)
        return found


def _importer(frame: FrameType | None) -> str:
    """The top-level package of the code that an import is in."""
    while frame is not None:
        name = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if name not in _MACHINERY:
            return name
        frame = frame.f_back
    return ""


@contextmanager
def from_working_folder(module: str) -> Iterator[None]:
    """Around the import of a module that the user has named: it may lie in the working folder.

    What it imports from there itself, then or later, is found too.

    Args:
        module: its full name.
    """
    folder = os.path.realpath(os.curdir)
    finder = next((each for each in sys.meta_path if isinstance(each, _WorkingFolder) and each.folder == folder), None)
    if finder is None:
        finder = _WorkingFolder(folder)
        sys.meta_path.append(finder)
    PathFinder.invalidate_caches()
    before, finder.wanted = finder.wanted, module.partition(".")[0]
    try:
        yield
    finally:
        finder.wanted = before


# entry points --------------------------------------------------------------------------------


def installed(group: str) -> dict[str, metadata.EntryPoint]:
    """The entry points of a group that installed packages have, by name; the first on the path wins.

    Metadata in the working folder, which any repository may hold, is none of an installed package, but where Python keeps
    installed packages in it.
    """
    found: dict[str, metadata.EntryPoint] = {}
    for distribution in metadata.distributions(path=_places()):
        for entry in distribution.entry_points.select(group=group):
            found.setdefault(entry.name, entry)
    return found


def _places() -> list[str]:
    """The folders of the path that packages are installed in."""
    own = {os.path.realpath(sysconfig.get_path(name)) for name in ("purelib", "platlib")}
    own |= {os.path.realpath(folder) for folder in (*site.getsitepackages(), site.getusersitepackages())}
    working = Path(os.path.realpath(os.curdir))
    return [entry for entry in sys.path if os.path.realpath(entry or os.curdir) in own or not _is_in(entry, working)]


def _is_in(entry: str, folder: Path) -> bool:
    return Path(os.path.realpath(entry or os.curdir)).is_relative_to(folder)
