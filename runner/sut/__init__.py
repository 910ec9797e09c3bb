"""Systems under test by name: the entry-point group `xosc.sut`, or `module:Class`."""

from __future__ import annotations

import importlib
from importlib.metadata import entry_points

from runner.sut.base import Control, Observation, SystemUnderTest, WorldDriven
from schemas.errors import UsageError

__all__ = ["Control", "Observation", "SystemUnderTest", "WorldDriven", "load_system"]

GROUP = "xosc.sut"


def load_system(name: str | None) -> SystemUnderTest | WorldDriven | None:
    """A new instance of the system under test of that name; None for `none`.

    Raises:
        UsageError: no such system, with those that there are; or it can't be built.
    """
    if name is None or name == "none":
        return None
    if ":" in name:
        module, _, attribute = name.partition(":")
        try:
            factory = getattr(importlib.import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise UsageError(f"the system under test {name!r} can't be imported: {error}") from None
    else:
        known = {entry.name: entry for entry in entry_points(group=GROUP)}
        if name not in known:
            raise UsageError(f"no system under test is called {name!r}; there are {', '.join(sorted(known))}, and module:Class")
        factory = known[name].load()
    system = factory()
    if not (isinstance(system, WorldDriven) or callable(getattr(system, "control", None))):
        raise UsageError(f"the system under test {name!r} has no method control(observation, dt)")
    return system
