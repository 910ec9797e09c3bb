"""Search methods by name: each is a module of a folder, with a function `search` and a constant `METHOD` that describes it.

`generation.search.methods` holds what `xosc-generate` offers. `generation.study` adds folders of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from schemas.discovery import described
from schemas.errors import UsageError

if TYPE_CHECKING:
    from generation.search.problem import Search

DEFAULT = "quality"


class Method(NamedTuple):
    """Where a method is, and what it is.

    Attributes:
        module: full name; its `search` is the method.
        title: for tables.
        meaning: one line for people.
        realistic: whether it keeps to what is plausible: its reward has a realism term, or it draws from recorded parameters.
    """

    module: str
    title: str
    meaning: str
    realistic: bool


def methods_of(package: str) -> dict[str, Method]:
    """The methods of a folder by name: the module's, with a dash for each underscore. No method is imported."""
    found = described(package, "METHOD")
    return {module.replace("_", "-"): Method(f"{package}.{module}", **constant) for module, constant in found.items()}


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
    search: Search = import_module(methods[name].module).search
    return search
