"""Search methods by name: functions `search(problem, budget, seed)` of a folder's modules.

A module describes its methods in a literal `METHODS`, by name; the function of a method has its name, dashes as underscores.
This folder holds the methods that `xosc-generate` offers; `studies.generation` adds folders of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from schemas.common.errors import UsageError
from schemas.common.packages import described

if TYPE_CHECKING:
    from generation.search.problem import Search

DEFAULT = "cover"


class Method(NamedTuple):
    """Search method: location and description.

    Attributes:
        module: full name of the module with the method's function.
        title: for tables.
        meaning: one line for people.
        realistic: whether it keeps to what is plausible: its reward has a realism term, or it draws from recorded parameters.
    """

    module: str
    title: str
    meaning: str
    realistic: bool


def methods_of(package: str) -> dict[str, Method]:
    """The methods of a folder by name, sorted; none of its modules is imported."""
    found = {
        name: Method(f"{package}.{module}", **description)
        for module, methods in described(package, "METHODS").items()
        for name, description in methods.items()
    }
    return dict(sorted(found.items()))


def offered() -> dict[str, Method]:
    """The methods of `xosc-generate`, the default first."""
    found = methods_of("generation.search.methods")
    return {DEFAULT: found.pop(DEFAULT), **found}


def method(name: str, methods: Mapping[str, Method] | None = None) -> Search:
    """The search of that name.

    Args:
        name: of the method.
        methods: where it is looked for; those of `xosc-generate` where it is None.

    Raises:
        UsageError: no method has that name.
    """
    methods = offered() if methods is None else methods
    if name not in methods:
        raise UsageError(f"there is no search method {name!r}; methods: {', '.join(methods)}")
    search: Search = getattr(import_module(methods[name].module), name.replace("-", "_"))
    return search
