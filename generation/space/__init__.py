"""The space that is searched: parameters of a logical scenario and how likely their values are.

Modules:

- `density`: densities of manoeuvre parameters: one contract (`base.Density`)
- `logical`: the logical scenarios of the library
- `recorded`: recorded parameters of a scenario: from a table of units
- `space`: search space: the parameters of a logical scenario as a box with a name on each

Example::

    Space.of("logical.xosc")  # a side for each parameter
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from generation.space.density.marginals import Marginal


@dataclass(frozen=True, kw_only=True)
class SpaceChoice:
    """Choice of the parameters that are searched.

    Attributes:
        pinned: values of parameters that are not searched, or that are to differ from their
            defaults.
        free: names of parameters to search besides the default ones.
        marginals: densities, with their limits in the place of declared ones, of parameters to
            search besides.
        default: whether to search what is searched by default; otherwise only what is free or has a
            density.
    """

    pinned: Mapping[str, str] = field(default_factory=dict)
    free: Sequence[str] = ()
    marginals: Mapping[str, Marginal] = field(default_factory=dict)
    default: bool = True
