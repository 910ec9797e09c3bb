"""Which share of the votes a model needs for a class, rather than nothing: chosen on other sites than those that are measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from recognition.training.agreement import SiteWindows
from recognition.training.windows import Windows
from recognition.trfe.samples import BACKGROUND
from recognition.trfe.trfe import TRFE
from xodr.array_types import FloatArray, IntArray

_SHARES = np.arange(0.0, 0.6, 0.01)
"""Shares of the votes for classes that are tried; who has more than all of them has the majority"""


class _Given(NamedTuple):
    """What a model gives windows: labels and their shares of the votes for classes (n,), and what the rules say (n,)."""

    labels: IntArray
    shares: FloatArray
    truth: IntArray


def least_shares(model: TRFE, sites: Sequence[SiteWindows]) -> dict[int, float]:
    """The least share of the votes for classes that each class needs; with less, a window is of nothing.

    The share of a class is the one that takes most quiet windows for nothing, as a part of all quiet windows of a site, less
    what it takes of the rules' events that have their class, as a part of all events of the site; sites count alike.
    """
    given = [(_given(model, site.events), _given(model, site.regular)) for site in sites]
    classes = [one for one in model.known.classes.tolist() if one != BACKGROUND]
    found = {label: _least(label, given) for label in classes} if BACKGROUND in model.known.classes else {}
    return {label: share for label, share in found.items() if share > 0.0}


def _given(model: TRFE, windows: Windows) -> _Given:
    found = model.recognise(windows.inputs)
    return _Given(found.labels, found.share, windows.labels)


def _least(label: int, sites: Sequence[tuple[_Given, _Given]]) -> float:
    gain = np.zeros(len(_SHARES))
    for events, regular in sites:
        quiet = (regular.labels == label) & (regular.truth == BACKGROUND)
        right = (events.labels == label) & (events.truth == label)
        gain += _below(regular.shares[quiet]) / max((regular.truth == BACKGROUND).sum(), 1)
        gain -= _below(events.shares[right]) / max(len(events.truth), 1)
    return float(_SHARES[gain.argmax()])


def _below(shares: FloatArray) -> FloatArray:
    """How many shares are below each of those that are tried."""
    return np.searchsorted(np.sort(shares), _SHARES, side="left").astype(np.float64)
