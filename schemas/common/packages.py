"""Packages: public names imported on first use, libraries of extras, the version; and code that is
found by its name: kinds in a folder, classes that the user names.

Kinds of things (rules, actions, data sets, exports, baselines, …) register themselves by being in a
module of a folder. A new kind is one new file; no list anywhere names it. A folder of kinds is used
in one of two ways:

- **The kinds register something** when they are imported (`@rule(…)`, `@action(…)`). Code that
  needs all of them calls `load("xosc.rules")` once, before it reads the table that they fill.
- **A kind is chosen by its name.** Its module holds one function or class with the name that the
  folder agrees on, and says in a constant what people read of it:

      # runner/exchange/exports/osi.py
      SUMMARY = "ASAM OSI ground-truth traces, .osi and .mcap"
      def export(result, name, folder): …

  `described("runner.exchange.exports", "SUMMARY")` is then `{"osi": "ASAM OSI …", …}` without
  importing any of them, so that help and errors can list what there is before libraries such as
  torch are loaded; `import_module(f"runner.exchange.exports.{name}")` loads the one that was
  chosen. A module without the constant is a helper and no kind. Where more is to be known of a
  kind, the constant is a tuple or dict of literals.

Modules (and packages) come in the order of their names, whatever the file system says; those whose
name begins with an underscore are helpers too. Source trees, installed wheels and zip files work
alike.

Plug-ins are classes as `module:Class`, also in the working folder, and what installed packages
bring (`schemas.common.plugins`). Folders with scenarios come from anyone, and commands are started
in them. Python puts the working folder on its path only where it is started as `python -m`;
commands take it off again. The one way from a file in it to code that runs is a class that the user
names: the module is then sought there after all that is installed, and so is what modules from
there import, whenever they do. Nothing else that is imported (an optional library, a module of
ours) is sought there.
"""

from __future__ import annotations

import ast
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import iter_modules
from types import FrameType, ModuleType
from typing import Any

from schemas.common.errors import UsageError

_EXTRAS = {
    "fmpy": "fmi",
    "gymnasium": "gym",
    "google": "osi",
    "lz4": "osi",
    "mcap": "osi",
    "osi3": "osi",
    "osi_utilities": "osi",
    "ray": "ray",
    "rosbags": "ros",
    "rtamt": "stl",
    "safetensors": "recognition",
    "sklearn": "search",
    "threadpoolctl": "search",
    "torch": "recognition",
    "zstandard": "osi",
    "cma": "study",
    "greenlet": "study",
    "pymoo": "study",
}
"""The extra that brings a library, by the name that it is imported by."""

_WITHOUT = {
    "fmi": "all other systems under test",
    "gym": "runner.Session steps through a run",
    "osi": "all other systems, outputs and targets of xosc-export",
    "ray": "--jobs N runs N processes on this machine",
    "ros": "all other formats of recordings",
    "recognition": "--labels rules labels by rules, --method cover and draws search",
    "search": (
        "xosc-run runs variation files, --sample N draws from them; xosc-recognize --labels rules "
        "makes catalogues"
    ),
    "stl": "--fail-if takes measures, events and criteria",
    "study": "xosc-generate searches by its own methods",
}
"""Functions that work without an extra."""


class MissingExtra(UsageError):
    """A library is missing that an extra brings; says what to type, and what works without it."""


def optional(module: str) -> Any:
    """A module of a library that an extra brings.

    Raises:
        MissingExtra: the library is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise missing(error) or error from None


def missing(error: BaseException, extra: str | None = None) -> MissingExtra | None:
    """Return the error for a library that an extra installs and that is missing; None for other
    errors.

    Args:
        extra: what to install instead of the extra that brings this library alone.
    """
    library = (error.name or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if library not in _EXTRAS:
        return None
    named = extra or _EXTRAS[library]
    return MissingExtra(
        f'{library} is missing; type: pip install "xosc-toolchain[{named}]"; without it: '
        f"{_WITHOUT[named]}"
    )


@cache
def version() -> str:
    """Version of xosc-toolchain, from the installed metadata; "unknown" where it is used without
    being installed."""
    from importlib import metadata

    try:
        return metadata.version("xosc-toolchain")
    except metadata.PackageNotFoundError:
        return "unknown"


def compiled() -> bool:
    """Whether the installed wheel has compiled modules; false in a checkout."""
    from importlib import metadata

    try:
        wheel = metadata.distribution("xosc-toolchain").read_text("WHEEL")
    except metadata.PackageNotFoundError:
        return False
    return "Root-Is-Purelib: false" in (wheel or "").splitlines()


def public(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose public names are imported on first use:
    commands answer `--help` at once.

    They know `__version__` as well.

    Args:
        package: the package's name.
        homes: the module that each name is in, as `module:name` where it has another name there,
            and `module:` where it is the module itself.
    """

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            return version()
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, mark, own = homes[name].partition(":")
        imported = optional(module)
        return imported if mark and not own else getattr(imported, own or name)

    def __dir__() -> list[str]:
        names = vars(sys.modules[package])
        special = {name for name in names if name.startswith("__")}
        return sorted({*special, *names.get("__all__", ()), *homes, "__version__"})

    return __getattr__, __dir__


# code that is found by its name -------------------------------------------------------------------


@cache
def names(package: str) -> tuple[str, ...]:
    """Names of a package's modules, sorted, without the package's own; none of them is imported.

    Args:
        package: its full name; it is imported itself, so its `__init__` is to be light.
    """
    every = (module.name for module in iter_modules(import_module(package).__path__))
    return tuple(sorted(name for name in every if not name.startswith("_")))


def load(package: str) -> list[ModuleType]:
    """Import all modules of a package, in the order of `names`."""
    return [import_module(f"{package}.{name}") for name in names(package)]


@cache
def described(package: str, constant: str) -> dict[str, Any]:
    """Return the values of a constant in a package's modules, by module name. No module is
    imported.

    Args:
        package: its full name.
        constant: name that those modules which are kinds assign a literal to; the others are left
            out.

    Raises:
        ValueError: a module assigns something else than a literal (numbers, texts, None, and
            tuples, dicts, … of them).
    """
    constants = {name: _constant(f"{package}.{name}", constant) for name in names(package)}
    return {name: ast.literal_eval(value) for name, value in constants.items() if value is not None}


def _constant(module: str, constant: str) -> ast.expr | None:
    """The expression that a module assigns to a name at its top level; None where it does not."""
    # The loader has the source in zip files too, where there is no file to open.
    spec = find_spec(module)
    source = (
        spec.loader.get_source(module)
        if spec and spec.loader and hasattr(spec.loader, "get_source")
        else None
    )
    for statement in _assignments(source or "", constant):
        if isinstance(statement, ast.Assign):
            targets: list[ast.expr] = statement.targets
        elif isinstance(statement, ast.AnnAssign):
            targets = [statement.target]
        else:
            continue
        if any(isinstance(target, ast.Name) and target.id == constant for target in targets):
            return statement.value
    return None


def _assignments(source: str, constant: str) -> Iterator[ast.stmt]:
    """Statements of a module's top level that begin with a name.

    The rest of the module is not parsed: a command reads all kinds of its family as it starts.
    """
    for begin in re.finditer(rf"^{re.escape(constant)}\b", source, re.MULTILINE):
        end = _NEXT_STATEMENT.search(source, begin.end())
        try:
            yield from ast.parse(source[begin.start() : end.start() if end else None]).body
        except SyntaxError:  # lines of a text look like statements
            yield from ast.parse(source).body
            return


_NEXT_STATEMENT = re.compile(r"^[^\s)\]}]", re.MULTILINE)
"""The first sign of a statement at the top level, or of a comment there"""


# functions of higher floors ------------------------------------------------------------------

_OFFERED: dict[str, str] = {}


def offer(homes: Mapping[str, str]) -> None:
    """Name functions that modules below may call without knowing where they are.

    A package that stands above both sides calls this when it is imported.

    Args:
        homes: `module:function`, or `module:` for all of it, by the name that the caller uses.
    """
    _OFFERED.update(homes)


def offered(name: str) -> Any:
    """The function or module that was offered under a name; it is imported now.

    Raises:
        KeyError: no package offers it.
    """
    module, _, function = _OFFERED[name].partition(":")
    imported = import_module(module)
    return getattr(imported, function) if function else imported


# the working folder ---------------------------------------------------------------------------

_MACHINERY = ("importlib", "_frozen_importlib")
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable by which other Pythons that are started leave the working folder off their
path."""


def leave_working_folder_out() -> None:
    """Take the working folder off the path where Python put it itself (`python -m`), here and in
    processes that are started."""
    os.environ[SAFE_PATH] = "1"
    # With `-P` or PYTHONSAFEPATH the first entry is not one that Python added.
    if not sys.flags.safe_path and sys.path and _is_working_folder(sys.path[0]):
        del sys.path[0]


def _is_working_folder(entry: str) -> bool:
    """Whether an entry of the path is the working folder; that of a package's own source (`pip
    install -e`) comes later."""
    return os.path.realpath(entry or os.curdir) == os.path.realpath(os.curdir)


# classes that the user names ----------------------------------------------------------------------


class _WorkingFolder:
    """Finds modules in a folder, for imports of chosen modules and for imports by modules of the
    folder.

    A meta path finder (`importlib.abc.MetaPathFinder`); the last one, so that what is installed
    comes first.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.wanted = ""
        self._found: set[str] = set()

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module of that name in the folder; packages find their own submodules."""
        if path is not None or not (
            fullname == self.wanted or _importer(sys._getframe(1)) in self._found
        ):
            return None
        spec = PathFinder.find_spec(fullname, [self.folder])
        if spec is not None:
            self._found.add(fullname)
        return spec

    def take(self, module: str) -> None:
        """Find imports of a module that was read from the folder."""
        self._found.add(module.partition(".")[0])


def _importer(frame: FrameType | None) -> str:
    """The top-level package of the code that an import is in."""
    while frame is not None:
        # Frames of the import machinery lie between the import statement and the finder.
        name = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if name not in _MACHINERY:
            return name
        frame = frame.f_back
    return ""


@contextmanager
def from_working_folder(module: str) -> Iterator[None]:
    """Context manager around the import of a module that the user has named: it may lie in the
    working folder.

    What it imports from there itself, then or later, is found too.

    Args:
        module: its full name.
    """
    finder = _finder(os.path.realpath(os.curdir))
    # Finders keep listings of folders: a module that was just written would be missed.
    PathFinder.invalidate_caches()
    before, finder.wanted = finder.wanted, module.partition(".")[0]
    try:
        yield
    finally:
        finder.wanted = before


def _finder(folder: str) -> _WorkingFolder:
    """The finder of a folder, which is put in place."""
    known = (
        finder
        for finder in sys.meta_path
        if isinstance(finder, _WorkingFolder) and finder.folder == folder
    )
    finder = next(known, None)
    if finder is None:
        finder = _WorkingFolder(folder)
        sys.meta_path.append(finder)
    return finder


def import_file(file: str) -> ModuleType:
    """The module in a file that the user has named, imported under the file's name; its imports
    from its folder are found too.

    Raises:
        UsageError: there is no such file, or another module of that name is loaded.
    """
    path = os.path.realpath(file)
    name = Path(path).stem
    if not os.path.isfile(path):
        raise UsageError("there is no such file", path=file)
    loaded = sys.modules.get(name)
    if loaded is not None:
        if os.path.realpath(getattr(loaded, "__file__", None) or "") == path:
            return loaded
        raise UsageError(f"another module is called {name}; give the file another name", path=file)
    spec = spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    # In place before it runs, as by `import`: dataclasses look their module up there.
    module = sys.modules[name] = module_from_spec(spec)
    _finder(os.path.dirname(path)).take(name)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        # What failed half-way must not be taken for a loaded module.
        del sys.modules[name]
        raise
    return module
