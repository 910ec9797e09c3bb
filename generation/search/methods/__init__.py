"""Search methods by name: functions `search(problem, budget, seed)` of a folder's modules.

A module describes its methods in a literal `METHODS`, by name; the function of a method has its
name, dashes as underscores. This folder holds the methods that `xosc-generate` offers;
`studies.generation` adds folders of its own.
"""

from __future__ import annotations

from typing import NamedTuple

from schemas.common.packages import described

DEFAULT = "cover"


class Method(NamedTuple):
    """Search method: location and description.

    Attributes:
        module: full name of the module with the method's function.
        title: for tables.
        meaning: one line for people.
        realistic: whether it keeps to what is plausible: its reward has a realism term, or it draws
            from recorded parameters.
    """

    module: str
    title: str
    meaning: str
    realistic: bool


def methods_of(package: str) -> dict[str, Method]:
    """The methods of a folder by name, sorted; none of its modules is imported."""
    # `described` reads the literal `METHODS` from the source: importing all methods would load
    # torch.
    by_name = {
        name: Method(f"{package}.{module}", **description)
        for module, methods in described(package, "METHODS").items()
        for name, description in methods.items()
    }
    return dict(sorted(by_name.items()))


def offered() -> dict[str, Method]:
    """The methods of `xosc-generate`, the default first."""
    methods = methods_of("generation.search.methods")
    return {DEFAULT: methods.pop(DEFAULT), **methods}
