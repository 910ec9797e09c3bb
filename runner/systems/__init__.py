"""Systems under test by name: this folder's modules, the entry-point group `xosc.sut`, `module:Class`; parameters of each."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache, partial
from importlib.metadata import EntryPoint

from runner.systems.base import (
    Control,
    Observation,
    Participant,
    Pose,
    SystemUnderTest,
    WorldDriven,
    arguments,
    split,
)
from schemas.common.errors import ToolchainError, UsageError, blame
from schemas.common.packages import described, from_working_folder, installed, missing
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


System = SystemUnderTest | WorldDriven
"""Driver of the ego."""


def load_system(name: str | System | None) -> System | None:
    """A new instance of the system under test of that name, None for `none`; an instance is taken as it is.

    Raises:
        UsageError: no such system, with those that there are; or it can't be built.

    Example:
        >>> import xosc_toolchain as xt
        >>> type(xt.load_system("cas")).__name__
        'CollisionAvoidance'
    """
    if not isinstance(name, str | None):
        return name
    factory = find_system(name)
    if factory is None:
        return None
    try:
        system = factory()
    except ToolchainError:
        raise
    except Exception as error:
        raise UsageError(
            f"the system under test {name!r} can't be built: {blame(error, _module(factory))}"
        ) from error
    methods = ("reset",) if isinstance(system, WorldDriven) else ("reset", "control")
    missing = [method for method in methods if not callable(getattr(system, method, None))]
    if missing:
        raise UsageError(
            f"the system under test {name!r} has no method {missing[0]}, see docs/systems-under-test.md"
        )
    return system


def system_name(system: str | System | None) -> str:
    """Return the name of a system under test for results and messages."""
    if isinstance(system, str | None):
        return system or "none"
    return f"{type(system).__module__}:{type(system).__qualname__}"


def find_system(name: str | None) -> Callable[[], System] | None:
    """Return the factory of a system under test by name (see `runner.systems.base`); None for `none`.

    Raises:
        UsageError: no such system, with those that there are; it can't be imported; or it has no
            such parameter.
        ToolchainError: a file that a system of this folder is made of (its `check`) is wrong.
    """
    if name is None or name == "none":
        return None
    name, given = split(name, _own())
    if name not in _own():
        current().admit_code(f"the system under test {name!r}")
    entry = _own().get(name) or _installed().get(name)
    if entry is None and not re.fullmatch(r"[\w.]+:[\w.]+", name):
        there = ", ".join(sorted({*_own(), *_installed(), "none"}))
        hint = "; arguments follow a second colon: module:Class:NAME=VALUE" if ":" in name else ""
        raise UsageError(
            f"no system under test is called {name!r}; there are {there}, and module:Class{hint}"
        )
    chosen = nullcontext() if entry else from_working_folder(name.partition(":")[0])
    entry = entry or EntryPoint(name, name, GROUP)
    with chosen:
        try:
            factory = entry.load()
        except Exception as error:  # a plug-in's own code runs here
            if absent := missing(error):
                raise absent from None
            raise UsageError(
                f"the system under test {name!r} can't be imported: {blame(error, entry.module)}"
            ) from error
    if not callable(factory):
        raise UsageError(f"the system under test {name!r} is not a class")
    values = arguments(factory, given, name)
    if name in _own() and hasattr(factory, "check"):
        factory.check(**values)
    return partial(factory, **values) if values else factory


def _module(factory: Callable[[], System]) -> str:
    return str(getattr(factory.func if isinstance(factory, partial) else factory, "__module__", ""))


@cache
def _own() -> dict[str, EntryPoint]:
    """The systems of this folder by name: those that modules name in `SYSTEMS`, with their class and a line of help."""
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
        "module:Class": "a class of yours, installed or in the working folder"
    }


@cache
def _installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages for names that are not ours; looked up once.

    It reads every installed package's list, which takes as long as a short run.
    """
    return installed(GROUP)
