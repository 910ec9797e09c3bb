"""How a model agrees with the rules on recordings of sites that it was not trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition import datasets
from recognition.labels import Rules
from recognition.sites import site_of
from recognition.training.data import is_windows, source_of
from recognition.training.moments import events_and_background
from recognition.training.views import View, nothing
from recognition.training.windows import Windows, windows_of
from recognition.trfe.samples import BACKGROUND, UNKNOWN
from recognition.trfe.trfe import TRFE
from xodr.array_types import BoolArray, IntArray

REJECTED = 0.1
"""Greatest share of the rules' events on other sites that may be unknown"""
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


def site_windows(path: Path, cache: Path, view: View, rules: Rules) -> SiteWindows:
    """Windows of all recordings in a folder.

    Args:
        cache: folder that keeps the windows for the next time, and roads made for them.

    Raises:
        InvalidFile: nothing of a known format, or a recording is malformed.
    """
    kept = cache / f"{path.name}-{source_of(path)}-{type(view).__name__.lower()}"
    events, regular = kept / "events", kept / "regular"
    if not is_windows(regular):
        made = _made(path, cache / "roads", view, rules)
        made[0].save(events)
        made[1].save(regular)
    return SiteWindows(path.name, Windows.load(events), Windows.load(regular))


def _made(path: Path, roads: Path, view: View, rules: Rules) -> tuple[Windows, Windows]:
    parts: list[tuple[Windows, Windows]] = []
    for source in datasets.open(path, roads=roads).sources:
        recording = source.load()
        site = site_of(source, recording, roads)
        events, regular = events_and_background(recording, site, source.name, rules)
        parts.append((windows_of(recording, events, view, site), windows_of(recording, regular, view, site)))
    return _joined([part[0] for part in parts], view), _joined([part[1] for part in parts], view)


def accept(model: TRFE, windows: Sequence[Windows]) -> None:
    """Let a model take no more than a tenth of the rules' events of other sites for unknown, at each, where its own δ took more.

    On sites like those that trained it, everything looks more usual than elsewhere: a δ chosen there rejects most of what it gets
    right on roads that it has not seen.

    Args:
        windows: of events on sites that neither train nor measure it.
    """
    scores = [model.recognise(one.inputs).score for one in windows if len(one)]
    screening = model.known.screening
    screening.threshold = max(screening.threshold, *(float(np.quantile(one, 1.0 - REJECTED)) for one in scores), 0.0)


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
