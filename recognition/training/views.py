"""What an encoder sees of a moment: tokens, or occupancy grids. One way to make either."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recognition.grids import Grid, Moments, covered, rasterise
from recognition.sites import Site
from recognition.tokens.config import Tokens
from recognition.tokens.features import in_parts, tokenise
from runner.recording import Recording
from schemas.errors import UsageError
from xodr.array_types import BoolArray

View = Tokens | Grid
Inputs = NDArray[Any]
"""Windows (n, ...) of a view, as an encoder takes them"""


def visible(recording: Recording, moments: Moments, view: View) -> BoolArray:
    """Whether the ego's track covers what a view needs of it about each moment: only such moments can be drawn."""
    times = view.offsets if isinstance(view, Grid) else (-0.5 * view.core, 0.0, 0.5 * view.core)
    return covered(recording, moments, times)


def drawn(recording: Recording, moments: Moments, view: View, site: Site | None) -> Inputs:
    """Windows about visible moments.

    Raises:
        UsageError: a moment is not visible, or the view needs a site.
    """
    if isinstance(view, Grid):
        return rasterise(recording, moments, view, site)
    return tokenise(recording, moments, view, _known(site))


def drawn_in_parts(recording: Recording, moments: Moments, view: View, site: Site | None, size: int) -> Iterator[Inputs]:
    """The same, so many windows at a time: those of a long recording need not be in memory together."""
    if isinstance(view, Grid):
        return (rasterise(recording, moments[start : start + size], view, site) for start in range(0, len(moments), size))
    return in_parts(recording, moments, view, _known(site), size)


def _known(site: Site | None) -> Site:
    if site is None:
        raise UsageError("tokens need the site's road")
    return site


def nothing(view: View) -> Inputs:
    """No windows."""
    return np.zeros((0, *view.shape), np.uint8 if isinstance(view, Grid) else np.float16)
