"""How a model agrees with the rules on recordings of sites that it was not trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition import datasets
from recognition.labels import Rules
from recognition.sites import site_of
from recognition.training.moments import events_and_background
from recognition.training.views import View, nothing
from recognition.training.windows import Windows, windows_of
from recognition.trfe.samples import BACKGROUND, UNKNOWN
from xodr.array_types import BoolArray, IntArray

Recognise = Callable[[Windows], IntArray]
"""Labels (n,) of windows: classes, `BACKGROUND`, or 0 for unknown"""


class SiteWindows(NamedTuple):
    """Windows of a data set: at the rules' events, and at the stride at which a user's recordings are looked at."""

    name: str
    events: Windows
    regular: Windows


class Agreement(NamedTuple):
    """What a model makes of a data set.

    events: of the rules. agree, nothing, unknown, wrong: shares of them that get the rules' class, none, unknown, another class.
    quiet: windows at the stride in which no rule finds anything. still, odd: shares of them that the model takes for nothing, and
        for unknown; the rest are findings that no rule confirms.
    confirmed: of the windows at the stride that the model gives a class, the share to which the rules give the same.
    classes: label, events, agreeing ones.
    """

    name: str
    events: int
    agree: float
    nothing: float
    unknown: float
    wrong: float
    quiet: int
    still: float
    odd: float
    confirmed: float
    classes: tuple[tuple[int, int, int], ...]


def site_windows(path: Path, roads: Path, view: View, rules: Rules) -> SiteWindows:
    """Windows of all recordings in a folder.

    Raises:
        InvalidFile: nothing of a known format, or a recording is malformed.
    """
    parts: list[tuple[Windows, Windows]] = []
    for source in datasets.open(path, roads=roads).sources:
        recording = source.load()
        site = site_of(source, recording, roads)
        events, regular = events_and_background(recording, site, source.name, rules)
        parts.append((windows_of(recording, events, view, site), windows_of(recording, regular, view, site)))
    return SiteWindows(path.name, _joined([part[0] for part in parts], view), _joined([part[1] for part in parts], view))


def agreement(recognise: Recognise, windows: SiteWindows) -> Agreement:
    """Hold a model's labels against those of the rules."""
    truth, found = windows.events.labels, recognise(windows.events)
    usual, regular = windows.regular.labels, recognise(windows.regular)
    right, none, odd = found == truth, found == BACKGROUND, found == UNKNOWN
    quiet = usual == BACKGROUND
    said = (regular != BACKGROUND) & (regular != UNKNOWN)
    classes = tuple((int(one), int((truth == one).sum()), int((right & (truth == one)).sum())) for one in np.unique(truth))
    return Agreement(
        windows.name, len(truth), _share(right), _share(none), _share(odd), _share(~right & ~none & ~odd),
        int(quiet.sum()), _share(regular[quiet] == BACKGROUND), _share(regular[quiet] == UNKNOWN),
        _share(regular[said] == usual[said]), classes,
    )  # fmt: skip


def table(rows: Sequence[Agreement]) -> str:
    """Agreements as a Markdown table."""
    lines = [
        "| recordings | events | agree | nothing | unknown | wrong | quiet windows | for nothing | for unknown | confirmed |",
        f"|{'---|' * 10}",
    ]
    lines += [
        f"| {one.name} | {one.events} | {one.agree:.1%} | {one.nothing:.1%} | {one.unknown:.1%} | {one.wrong:.1%} |"
        f" {one.quiet} | {one.still:.1%} | {one.odd:.1%} | {one.confirmed:.1%} |"
        for one in rows
    ]
    return "\n".join(lines)


def _share(flags: BoolArray) -> float:
    return float(np.mean(flags)) if len(flags) else 0.0


def _joined(parts: Sequence[Windows], view: View) -> Windows:
    none = np.zeros(0, np.str_)
    empty = Windows(nothing(view), np.zeros(0, np.int64), none, none, np.zeros(0))
    columns = zip(*(part.columns for part in (empty, *parts)), strict=True)
    return Windows(*(np.concatenate(column) for column in columns))
