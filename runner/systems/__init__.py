"""Systems under test by name: this folder's modules, the entry-point group `xosc.sut`,
`module:Class`, `FILE.py:Class`; parameters of each.

Runs drive the toolchain's own systems, and objects that a program hands over, in their own process.
A class of the user that is given by name runs in a process of its own
(`runner.systems.isolation.boundary`).

Modules:

- `arrays`: observations and controls of many runs at once
- `base`: what they see, what they answer, and how they are found
- `array_systems`: any system under test in many runs at once
- `drivers`: the ego, from when on a system under test drives it, and its drivers
- `encounters`: participants ahead as the ego sees them, along and across its heading
- `isolation`: systems of users in processes of their own
- `kinds`: systems that `--sut` names: cas, adas, aeb, idm, reference drivers, FMU, bridge
- `outside`: systems under test that live outside: functional mock-up units, OSI messages

Example::

    runner.run("mine.xosc", sut="adas")
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cache, partial, reduce
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, NamedTuple

from runner.systems.base import (
    FIRST,
    RAISED,
    SENSORS,
    Control,
    Observation,
    Participant,
    Pose,
    SystemUnderTest,
    WorldDriven,
    arguments,
    names_of,
    split,
)
from schemas.common.errors import ToolchainError, UsageError, blame, guess
from schemas.common.packages import described, from_working_folder, import_file, missing
from schemas.common.plugins import installed, package_of
from schemas.common.policy import current

__all__ = [
    "Control",
    "Observation",
    "Participant",
    "Pose",
    "System",
    "SystemUnderTest",
    "WorldDriven",
    "find_system",
    "load_system",
    "system_name",
    "systems",
]

GROUP = "xosc.sut"
_OURS = (
    "schemas",
    "xosc",
    "xodr",
    "runner",
    "recognition",
    "generation",
    "studies",
    "xosc_toolchain",
)
"""Packages whose classes run in the process of the run"""


System = SystemUnderTest | WorldDriven
"""Driver of the ego."""


def load_system(name: str | System | None) -> System | None:
    """A new instance of the system under test of that name, None for `none`; an instance is taken
    as it is.

    Raises:
        UsageError: no such system, with those that there are; or it can't be built.

    Example:
        >>> import xosc_toolchain as xt
        >>> type(xt.load_system("cas")).__name__
        'CollisionAvoidance'
    """
    if not isinstance(name, str | None):
        return name
    build = builder(name)
    return None if build is None else build()


def builder(name: str | None) -> Callable[[], System] | None:
    """Builder of new instances of the system under test of that name, which is looked up once; None
    for `none`.

    Raises:
        UsageError: no such system. The builder raises it where an instance can't be built.
    """
    factory = find_system(name)
    return None if factory is None else partial(_build, factory, name or "none")


def _build(factory: Callable[[], System], name: str) -> System:
    """A new instance, which has the methods of a system."""
    try:
        system = factory()
    except ToolchainError:
        raise
    except RAISED as error:
        raise UsageError(
            f"the system under test {name!r} can't be built: {blame(error, _module(factory))}"
        ) from error
    methods = ("reset",) if isinstance(system, WorldDriven) else ("reset", "control")
    missing = [method for method in methods if not callable(getattr(system, method, None))]
    if missing:
        raise UsageError(
            f"the system under test {name!r} has no method {missing[0]}, see "
            "docs/systems-under-test.md"
        )
    return system


def open_system(sut: str | System | None, in_process: bool, limit: float) -> System | None:
    """The system under test of a run: as of `load_system`, but a class of the user by name is in a
    process of its own.

    Args:
        in_process: keep it in this process.
        limit: time (s) that such a process has for each answer.

    Raises:
        UsageError: as of `load_system`.
    """
    if not isinstance(sut, str) or in_process or not is_foreign(sut):
        return load_system(sut)
    from runner.systems.isolation.boundary import isolated

    return isolated(class_name(sut), sut, limit)


def class_name(sut: str) -> str:
    """Name of a system under test without its parameters."""
    return split(sut, _own())[0]


def check_system(sut: str, in_process: bool, limit: float) -> None:
    """Refuse a name that is no system under test; arguments and errors as of `open_system`."""
    if in_process or not is_foreign(sut):
        find_system(sut)
    else:
        _described(sut, limit)


def code_of(sut: str, in_process: bool, limit: float) -> ClassOrigin | None:
    """Origin of the code of a system under test; None for one of the toolchain's own. Arguments as
    of `open_system`."""
    if not is_foreign(sut):
        return None
    return class_origin(sut) if in_process else _described(sut, limit)


class ClassOrigin(NamedTuple):
    """Origin of a class of the user.

    Args:
        package: its top-level package, or module.
        origin: file of that; empty where there is none.
        folders: of a package, with all of its modules.
        imports: files of modules of the user that it imports.
    """

    package: str
    origin: str
    folders: tuple[str, ...]
    imports: tuple[str, ...]


def class_origin(sut: str) -> ClassOrigin:
    """Origin of a class, which is imported in this process; errors as of `find_system`.

    Its imports are those beside it: this process has imported other modules, too.
    """
    factory = find_system(sut)
    assert factory is not None
    package = _module(factory).partition(".")[0]
    spec = getattr(sys.modules.get(package), "__spec__", None)
    folders = tuple(map(str, getattr(spec, "submodule_search_locations", None) or ()))
    origin = getattr(spec, "origin", None) or ""
    beside = os.path.join(os.path.realpath(os.path.dirname(origin)), "")
    imports = (file for file in files_of_user() if origin and file.startswith(beside))
    return ClassOrigin(package, origin, folders, tuple(imports))


_INSTALLED = tuple({os.path.realpath(prefix) for prefix in (sys.prefix, sys.base_prefix)})
_SOURCE = os.path.realpath(Path(__file__).parents[2])
_OUR_PACKAGES = tuple(
    os.path.join(_SOURCE, package, "") for package in ("schemas", "xosc", "xodr", "runner")
)


def files_of_user() -> list[str]:
    """Files of the imported modules that are neither installed nor the toolchain's.

    Modules that libraries make up as they run, as torch does, name files that are not there.
    """
    files = {getattr(module, "__file__", None) or "" for module in list(sys.modules.values())}
    real = {os.path.realpath(file) for file in files if os.path.isfile(file)}
    return sorted(file for file in real if not file.startswith((*_INSTALLED, *_OUR_PACKAGES)))


def _described(sut: str, limit: float) -> ClassOrigin:
    """Origin of a class, which is imported in a process of its own."""
    from runner.systems.isolation.boundary import facts

    package, origin, folders, imports = facts(class_name(sut), sut, limit)
    return ClassOrigin(package, origin, tuple(folders), tuple(imports))


def is_foreign(sut: str) -> bool:
    """Whether a name denotes a class of the user; unknown names are refused.

    A class of the main program is none: no other process could import it.

    Raises:
        UsageError: no such system can be; or --untrusted, which loads no code of others.
    """
    entry = _entry(split(sut, _own())[0])
    return entry is not None and entry.module.partition(".")[0] not in (*_OURS, "__main__")


def system_name(system: str | System | None) -> str:
    """Return the name of a system under test for results and messages."""
    if isinstance(system, str | None):
        return system or "none"
    named: str | None = getattr(system, "remote_name", None)
    return named or f"{type(system).__module__}:{type(system).__qualname__}"


class _ClassReference(NamedTuple):
    """Reference to a class.

    Args:
        module: its module. attribute: its name there.
        file: of the module, where the user names it. is_installed: whether an installed package or
            the toolchain names it. package: the installed package.
    """

    module: str
    attribute: str
    file: str = ""
    is_installed: bool = False
    package: str = ""

    def importing(self) -> AbstractContextManager[None]:
        """Context manager around the import of the class, and around telling an error of that."""
        return nullcontext() if self.file or self.is_installed else from_working_folder(self.module)

    def load(self) -> Any:
        """Import the class."""
        module = import_file(self.file) if self.file else import_module(self.module)
        return reduce(getattr, self.attribute.split("."), module)


def _entry(name: str) -> _ClassReference | None:
    """Class of a name without parameters, not imported; None for `none`.

    Raises:
        UsageError: no such system can be; or --untrusted, which loads no code of others.
    """
    if name == "none":
        return None
    if name not in _own():
        current().admit_code(f"the system under test {name!r}")
    others = {} if current().untrusted else _installed()  # a name that is taken twice is refused
    if own := _own().get(name):
        return _ClassReference(own.module, own.attr, is_installed=True)
    if other := others.get(name):
        return _ClassReference(
            other.module, other.attr, is_installed=True, package=package_of(other)
        )
    if match := re.fullmatch(r"(.+\.py):([\w.]+)", name, re.DOTALL):
        file, attribute = match.groups()
        return _ClassReference(Path(file).stem, attribute, file)
    if match := re.fullmatch(r"([\w.]+):([\w.]+)", name):
        return _ClassReference(match[1], match[2])
    if name.endswith(".py"):
        raise UsageError(f"the system under test is a file: name its class, as {name}:Mine")
    names = sorted({*_own(), *_installed(), "none"})
    hint = "; arguments follow a second colon: module:Class:NAME=VALUE" if ":" in name else ""
    told = f"no system under test is called {name!r}; {guess(name, names)}there are "
    told += f"{', '.join(names)}, and module:Class or FILE.py:Class{hint}"
    raise UsageError(told)


def find_system(name: str | None) -> Callable[[], System] | None:
    """Return the factory of a system under test by name (see `runner.systems.base`); None for
    `none`.

    Raises:
        UsageError: no such system, with those that there are; it can't be imported; or it has no
            such parameter.
        ToolchainError: a file that a system of this folder is made of (its `check`) is wrong.
    """
    if name is None:
        return None
    name, given = split(name, _own())
    entry = _entry(name)
    if entry is None:
        return None
    with entry.importing():
        try:
            factory = entry.load()
        except ToolchainError:
            raise
        except RAISED as error:  # a plug-in's own code runs here
            if absent := missing(error):
                raise absent from None
            told = blame(error, entry.module)
            raise UsageError(f"{_told(name, entry)} can't be imported: {told}") from error
    if not callable(factory):
        raise UsageError(f"{_told(name, entry)} is not a class")
    more = SENSORS if getattr(factory, "sensors", False) else ()
    sensed = {key: text for key, text in given.items() if key in more}
    own = {key: text for key, text in given.items() if key not in sensed}
    values = arguments(factory, own, name, more)
    # A wrong file of a system is refused once, before any run of a batch.
    if name in _own() and hasattr(factory, "check"):
        factory.check(**values)
    found = partial(factory, **values) if values else factory
    return _through_sensors(found, sensed, name) if sensed else found


def _through_sensors(
    factory: Callable[[], System], given: Mapping[str, str], name: str
) -> Callable[[], System]:
    """Factory of a system that sees through a sensor model, from texts of its parameters."""
    from runner.systems.encounters import SensedSystem, SensorModel

    model = SensorModel(**arguments(SensorModel, given, name))  # type: ignore[arg-type]

    def build() -> System:
        system = factory()
        assert not isinstance(system, WorldDriven)  # none of these has sensors
        return SensedSystem(system, model)

    return build


OF_SYSTEM = "sut_"
"""Beginning of the names of a scenario's parameters that are the system's: `sut_delay`"""


def with_parameters(
    sut: str | System | None, parameters: Mapping[str, Any]
) -> tuple[str | System | None, tuple[str, ...]]:
    """A system with the values of a scenario's parameters `sut_NAME`, and the names of those that
    it does not have.

    Values of the scenario replace those of the system's name: a search or a variation file varies
    them. A class of the user is given all of them, and refuses what it does not have.
    """
    given = {
        name.removeprefix(OF_SYSTEM): str(value).lower() if isinstance(value, bool) else str(value)
        for name, value in parameters.items()
        if name.startswith(OF_SYSTEM)
    }
    if not given:
        return sut, ()
    if not isinstance(sut, str) or sut == "none":
        return sut, tuple(given)
    name, own = split(sut, _own())
    if not is_foreign(sut):
        factory = find_system(name if FIRST not in own else sut)
        known = names_of(getattr(factory, "func", factory)) if factory is not None else ()
        unknown = tuple(key for key in given if key not in known)
    else:
        unknown = ()
    values = own | {key: text for key, text in given.items() if key not in unknown}
    texts = (f"{key}={text}" if key != FIRST else text for key, text in values.items())
    return f"{name}:{','.join(texts)}" if values else sut, unknown


def _told(name: str, entry: _ClassReference) -> str:
    """Name a system under test for messages, with the package that brings it."""
    origin = (
        f" ({entry.module}:{entry.attribute}, package {entry.package})" if entry.package else ""
    )
    return f"the system under test {name!r}{origin}"


def _module(factory: Callable[[], System]) -> str:
    return str(getattr(factory.func if isinstance(factory, partial) else factory, "__module__", ""))


@cache
def _own() -> dict[str, EntryPoint]:
    """The systems of this folder by name: those that modules name in `SYSTEMS`, with their class
    and a line of help."""
    ours = described("runner.systems.kinds", "SYSTEMS")
    return {
        name: EntryPoint(name, f"runner.systems.kinds.{module}:{factory}", GROUP)
        for module, systems in ours.items()
        for name, (factory, _) in systems.items()
    }


def systems() -> dict[str, str]:
    """Every name that `--sut` takes, with a line about it.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.systems()["none"]
        'no system: the scripted motion'
    """
    ours = {
        name: line
        for found in described("runner.systems.kinds", "SYSTEMS").values()
        for name, (_, line) in found.items()
    }
    others = {
        name: f"of {entry.value.partition(':')[0]}, installed by pip"
        for name, entry in _installed().items()
    }
    found = {**others, **ours, "none": "no system: the scripted motion"}
    return dict(sorted(found.items())) | {
        "module:Class": "a class of yours, installed or in the working folder",
        "FILE.py:Class": "a class of yours in a file",
    }


@cache
def _installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages for names that are not ours; looked up once.

    It reads every installed package's list, which takes as long as a short run.
    """
    return installed(GROUP, {*_own(), "none"})
