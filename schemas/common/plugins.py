"""Plug-ins: kinds of things that installed packages bring by entry points.

A package names modules in a group, one group a family of kinds:

    [project.entry-points."xosc.action"]
    acme = "acme.actions"

Groups are used as the folders of kinds are (`schemas.common.packages`): modules whose kinds
register themselves on import are loaded by `register`; kinds that are chosen by their name are
listed by `installed`, and the chosen one is loaded by `load`. A plug-in that can't be imported,
that takes a name in use, or that brings nothing is refused with its package, entry point and
reason. Under --untrusted none is loaded.
"""

from __future__ import annotations

import os
import site
import sys
import sysconfig
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from schemas.common.errors import ToolchainError, UsageError, blame, note_plugin
from schemas.common.policy import current

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_PREFIX = "xosc."
"""All groups begin with it"""
_OF_ELEMENTS = ("xosc.action", "xosc.condition", "xosc.position")
"""Groups whose kinds execute elements of a scenario"""
_HOMES: dict[str, str] = {}
"""Module that executes an element, by the name of the element"""


class NameTaken(ValueError):
    """Two modules register a kind under one name."""


def installed(group: str, taken: Collection[str] = ()) -> dict[str, EntryPoint]:
    """Return the entry points of a group that installed packages have, by name; nothing is
    imported.

    Metadata in the working folder, which any repository may hold, is none of an installed package,
    but where Python keeps installed packages in it. Of a package that the path has twice, the first
    counts.

    Args:
        taken: names of the toolchain's own kinds.

    Raises:
        UsageError: an entry point has a name of these, or of another package.
    """
    entries: dict[str, EntryPoint] = {}
    # Both are part of the cache's key: tests and notebooks change them.
    for entry in _declared(tuple(sys.path), os.path.realpath(os.curdir)).get(group, ()):
        if entry.name in taken:
            raise UsageError(f"{told(entry)} takes a name of the toolchain's own")
        other = entries.setdefault(entry.name, entry)
        if other is not entry:
            raise UsageError(f"{told(entry)} takes the name of {told(other)}; uninstall one")
    return entries


def told(entry: EntryPoint) -> str:
    """Name an entry point with its package, for messages."""
    return (
        f"the plug-in {entry.name!r} of {entry.group} ({entry.value}, package {package_of(entry)})"
    )


def package_of(entry: EntryPoint) -> str:
    """Name of the distribution that has an entry point, with underscores."""
    return _distribution(Path(str(getattr(entry.dist, "_path", "unknown"))))


def load(entry: EntryPoint, needs: Sequence[str] = ()) -> ModuleType:
    """Import the module of an entry point.

    Args:
        needs: names that it has to define.

    Raises:
        UsageError: it can't be imported, is no module, takes a name in use or lacks a needed one;
            or --untrusted.
    """
    # Before anything of it is imported, since importing executes.
    current().admit_code(told(entry))
    try:
        module = entry.load()
    except NameTaken as error:
        raise UsageError(f"{told(entry)} takes a name in use: {error}") from error
    except ToolchainError as error:  # a missing extra, which says what to type
        raise UsageError(f"{told(entry)} can't be imported: {error}") from error
    except Exception as error:  # a plug-in's own code runs here
        reason = blame(error, entry.module)
        raise UsageError(f"{told(entry)} can't be imported: {reason}") from error
    if not isinstance(module, ModuleType):
        raise UsageError(f"{told(entry)} is no module")
    note_plugin(module.__name__, told(entry))
    # Now, not at its first use in the middle of a batch.
    missing = [name for name in needs if not hasattr(module, name)]
    if missing:
        raise UsageError(f"{told(entry)} has no {missing[0]}")
    return module


def modules(
    group: str, taken: Collection[str] = (), needs: Sequence[str] = ()
) -> dict[str, ModuleType]:
    """Import the modules of a group, by entry point; none under --untrusted.

    Args and errors as of `installed` and `load`.
    """
    if current().untrusted:
        return {}
    return {name: load(entry, needs) for name, entry in sorted(installed(group, taken).items())}


def register(group: str, homes: Callable[[], Collection[str]]) -> None:
    """Import the modules of a group, so that their kinds register; none under --untrusted.

    Args:
        homes: modules of all registered kinds.

    Raises:
        UsageError: as of `modules`; or one registers nothing.
    """
    if current().untrusted:
        return
    for _, entry in sorted(installed(group).items()):
        before = len(homes())
        load(entry)
        package = entry.module.partition(".")[0]
        # The package may have registered its kinds when another of its modules was imported.
        own = any(home.partition(".")[0] == package for home in homes())
        # A module whose decorators were forgotten would be there and do nothing.
        if len(homes()) == before and not own:
            raise UsageError(f"{told(entry)} registers nothing")


def note_element(name: str, module: str) -> None:
    """Note the module that executes an element, for `of_element`."""
    _HOMES[name] = module


def of_element(name: str) -> EntryPoint | None:
    """Return the plug-in that executes an element of its own; None under --untrusted.

    A plug-in that can't be imported has no elements here: a run names it, a check goes on.
    """
    entries: list[EntryPoint] = []
    for group in _OF_ELEMENTS:
        with suppress(UsageError):
            modules(group)
            entries += installed(group).values()
    home = _HOMES.get(name, "")
    package = home.partition(".")[0]
    own = [entry for entry in entries if entry.module.partition(".")[0] == package]
    # The module may be another one of the package, which the one of the entry point imports.
    return min(own, key=lambda entry: entry.module != home, default=None)


@cache
def _declared(path: tuple[str, ...], working: str) -> dict[str, tuple[EntryPoint, ...]]:
    """Entry points of all our groups.

    Args:
        path: `sys.path`. working: the working folder.
    """
    declared: dict[str, list[EntryPoint]] = {}
    seen: set[str] = set()
    for folder in _metadata_folders(path, Path(working)):
        name = _distribution(folder)
        # The first on the path is the one that Python imports.
        if name in seen:
            continue
        seen.add(name)
        try:
            text = (folder / "entry_points.txt").read_text("utf-8")
        except (OSError, ValueError):
            continue
        if f"[{_PREFIX}" not in text:
            continue  # to parse the lists of all packages takes ten times as long
        from importlib.metadata import PathDistribution  # takes time, and most often there is none

        for entry in PathDistribution(folder).entry_points:
            if entry.group.startswith(_PREFIX):
                declared.setdefault(entry.group, []).append(entry)
    return {group: tuple(entries) for group, entries in declared.items()}


def _distribution(folder: Path) -> str:
    """Name of a distribution, from the folder of its metadata."""
    return folder.name.partition("-")[0].removesuffix(".egg").lower().replace(".", "_")


def _metadata_folders(path: Sequence[str], working: Path) -> Iterator[Path]:
    """Folders with the metadata of installed packages, in the order of the path."""
    for place in filter(os.path.isdir, _places(path, working)):
        names = sorted(os.listdir(place))
        yield from (
            Path(place, name) for name in names if name.endswith((".dist-info", ".egg-info"))
        )


def _places(path: Sequence[str], working: Path) -> list[str]:
    """The folders of the path that packages are installed in."""
    # A virtual environment may lie in the working folder: Python's own places count there.
    own = {os.path.realpath(sysconfig.get_path(name)) for name in ("purelib", "platlib")}
    own |= {
        os.path.realpath(folder) for folder in (*site.getsitepackages(), site.getusersitepackages())
    }
    real = {entry: os.path.realpath(entry or os.curdir) for entry in path}
    return [
        entry
        for entry in path
        if real[entry] in own or not Path(real[entry]).is_relative_to(working)
    ]
