"""The model card, and agreement of a model with the rules on sites that it was not trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from recognition import recordings as datasets
from recognition.labels import Rules
from recognition.labels.classes import Label
from recognition.scenes import site_of
from recognition.trfe.forest.known import title_of
from recognition.trfe.inputs.samples import BACKGROUND, UNKNOWN
from recognition.trfe.inputs.tokens import Tokens
from recognition.trfe.training.windows import (
    View,
    Windows,
    events_and_background,
    is_windows,
    joined,
    nothing,
    source_of,
    windows_of,
)
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.packages import version

if TYPE_CHECKING:
    from recognition.trfe.training.windows import Split, Windows
    from recognition.trfe.trfe import TRFE

REJECTED = 0.1
"""Greatest share of the rules' events on other sites that may be unknown"""
Recognise = Callable[[Windows], IntArray]
"""Labels (n,) of windows: classes, `BACKGROUND`, or 0 for unknown"""


class SiteWindows(NamedTuple):
    """Windows of a data set: at the rules' events, and at the stride at which a user's recordings
    are looked at."""

    name: str
    events: Windows
    regular: Windows


class Agreement(NamedTuple):
    """Agreement of a model with a data set.

    events: of the rules. agree, nothing, unknown, wrong: shares of them that get the rules' class,
    none, unknown, another class.
    quiet: windows at the stride in which no rule finds anything. still, odd: shares of them that
    the model takes for nothing, and for unknown; the rest are findings that no rule confirms.
    confirmed: of the windows at the stride that the model gives a class, the share to which the
    rules give the same. classes: label, events, agreeing ones.
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
    # Written last: where these are, the events are complete.
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
        parts.append(
            (windows_of(recording, events, view, site), windows_of(recording, regular, view, site))
        )
    return _joined([part[0] for part in parts], view), _joined([part[1] for part in parts], view)


def accept(model: TRFE, windows: Sequence[Windows]) -> None:
    """Let a model take no more than a tenth of the rules' events of other sites for unknown, at
    each, where its own δ took more.

    On sites like those that trained it, everything looks more usual than elsewhere: a δ chosen
    there rejects most of what it gets right on roads that it has not seen.

    Args:
        windows: of events on sites that neither train nor measure it.
    """
    scores = [model.recognise(one.inputs).score for one in windows if len(one)]
    screening = model.known.screening
    # The 0 gives `max` a second value where no site has an event.
    screening.threshold = max(
        screening.threshold, *(float(np.quantile(one, 1.0 - REJECTED)) for one in scores), 0.0
    )


def agreement(recognise: Recognise, windows: SiteWindows) -> Agreement:
    """Hold a model's labels against those of the rules."""
    truth, found = windows.events.labels, recognise(windows.events)
    usual, regular = windows.regular.labels, recognise(windows.regular)
    right, none, odd = found == truth, found == BACKGROUND, found == UNKNOWN
    quiet = usual == BACKGROUND
    said = (regular != BACKGROUND) & (regular != UNKNOWN)
    classes = tuple(
        (int(one), int((truth == one).sum()), int((right & (truth == one)).sum()))
        for one in np.unique(truth)
    )
    return Agreement(
        windows.name, len(truth), _share(right), _share(none), _share(odd),
        _share(~right & ~none & ~odd),
        int(quiet.sum()), _share(regular[quiet] == BACKGROUND), _share(regular[quiet] == UNKNOWN),
        _share(regular[said] == usual[said]), classes,
    )  # fmt: skip


def table(rows: Sequence[Agreement]) -> str:
    """Agreements as a Markdown table."""
    lines = [
        (
            "| recordings | events | agree | nothing | unknown | wrong | quiet windows | rightly "
            "nothing | unknown | confirmed |"
        ),
        f"|{'---|' * 10}",
    ]
    lines += [
        f"| {one.name} | {one.events} | {one.agree:.1%} | {one.nothing:.1%} | {one.unknown:.1%} | "
        f"{one.wrong:.1%} |"
        f" {one.quiet} | {one.still:.1%} | {one.odd:.1%} | {one.confirmed:.1%} |"
        for one in rows
    ]
    return "\n".join(lines)


def _share(flags: BoolArray) -> float:
    return float(np.mean(flags)) if len(flags) else 0.0


def _joined(parts: Sequence[Windows], view: View) -> Windows:
    # An empty part has the view's shape, so that recordings without windows can be joined.
    none = np.zeros(0, np.str_)
    return joined([Windows(nothing(view), np.zeros(0, np.int64), none, none, np.zeros(0)), *parts])


_SHARES = np.arange(0.0, 0.9, 0.01)
"""Tried shares of the votes for classes"""
_TIE = 1e-9
"""Weight of a window that gets a class, among shares of equal F1"""


class _Given(NamedTuple):
    """Labels of a model for windows, shares of votes for classes (n,), and labels of the rules
    (n,)."""

    labels: IntArray
    shares: FloatArray
    truth: IntArray


def least_shares(model: TRFE, sites: Sequence[SiteWindows]) -> dict[int, float]:
    """The least share of the votes for classes that each class needs; with less, a window is of
    nothing.

    The share of a class is the one with the greatest F1 of its windows, at events and at the
    stride, of all sites together. Of equally good ones it is the middle. A class that is always
    wrong needs more than it ever gets; one that no window gets, none.
    """
    given = [
        _given(model, windows)
        for site in sites
        for windows in (site.events, site.regular)
        if len(windows)
    ]
    classes = [one for one in model.known.classes.tolist() if one != BACKGROUND]
    found = (
        {label: _least(label, given) for label in classes}
        if BACKGROUND in model.known.classes
        else {}
    )
    return {label: share for label, share in found.items() if share > 0.0}


def _given(model: TRFE, windows: Windows) -> _Given:
    found = model.recognise(windows.inputs)
    return _Given(found.labels, found.share, windows.labels)


def _least(label: int, given: Sequence[_Given]) -> float:
    right, all_given, own = np.zeros(len(_SHARES)), np.zeros(len(_SHARES)), 0
    for one in given:
        found, truth = one.labels == label, one.truth == label
        right += _at_least(one.shares[found & truth])
        all_given += _at_least(one.shares[found])
        own += int(truth.sum())
    if not all_given.any():
        return 0.0
    score = 2.0 * right / np.maximum(all_given + own, 1.0) - _TIE * all_given
    first = int(score.argmax())
    worse = np.flatnonzero(score[first:] < score[first])
    last = first + int(worse[0]) - 1 if len(worse) else len(score) - 1
    return float(_SHARES[(first + last) // 2])


def _at_least(shares: FloatArray) -> FloatArray:
    """Return the number of shares that reach each tried threshold."""
    return (len(shares) - np.searchsorted(np.sort(shares), _SHARES, side="left")).astype(np.float64)


CARD = "README.md"
"""File of a model's folder that describes it"""
LIMITS = """\
- The classes are those of the labelling rules; the rates measure agreement with these rules.
- Rare classes were trained with few windows. Confidences are shares of votes, no probabilities.
- The model sorts recordings for tests, afterwards. It must not decide anything in a vehicle.
  Finding nothing critical is no evidence of safety."""
_GOOD = 0.75
"""Share of agreeing events below which the card says that a class fails"""
_LICENCE = "Those who trained it decide, as far as the terms of the recordings allow."


def card_of(
    model: TRFE, windows: Windows, parts: Split, data: str, unseen: Sequence[Agreement] = ()
) -> str:
    """Return the model card in Markdown: training data, results on unseen windows of its `parts`,
    intended use.

    Args:
        unseen: how it agrees with the rules on recordings of other sites.
    """
    missing = ", ".join(
        f"{title_of(label)} ({count} windows)" for label, count in sorted(parts.left_out.items())
    )
    paragraphs = [
        "# TRFE model",
        (
            f"Made by xosc-recognize train (xosc-toolchain {version()}) from "
            f"{data}.\n{_rates(model, windows, parts)}"
        ),
        *([f"Too rare to be divided, so not known: {missing}."] if missing else []),
        *_elsewhere(unseen),
        "## How it decides",
        decision(model),
        "## Limits of use",
        f"{scope(model)}\n{LIMITS}",
        "## Licence",
        _LICENCE,
    ]
    return "\n\n".join(paragraphs) + "\n"


def _elsewhere(unseen: Sequence[Agreement]) -> list[str]:
    """Return the lines on other measured sites, failures included."""
    if not unseen:
        return []
    counts: dict[int, tuple[int, int]] = {}
    for label, events, agreeing in (one for site in unseen for one in site.classes):
        before = counts.get(label, (0, 0))
        counts[label] = before[0] + events, before[1] + agreeing
    poor = [
        (label, some, good) for label, (some, good) in sorted(counts.items()) if good < _GOOD * some
    ]
    failing = [f"{title_of(label)} ({good} of {some})" for label, some, good in poor]
    about = (
        "Recordings of sites that it was not trained on. Of the rules' events: how many get the "
        "rules' class, nothing, unknown, "
        "or another class. Of windows at a regular stride in which no rule finds anything "
        "(quiet): how many are rightly taken "
        "for nothing, how many for unknown; the rest gets a class. Confirmed: of all windows at "
        "the stride that get a class, how "
        "many the rules give the same."
    )
    fails = (
        f"It fails, with less than {_GOOD:.0%} of the rules' events there, at: "
        f"{', '.join(failing) or 'no class'}."
    )
    return ["## Sites that it has not seen", about, table(unseen), fails]


def decision(model: TRFE) -> str:
    """Rule by which a model takes windows for a class, or for unknown."""
    known = model.known
    trees, features = (
        known.forest.trees.count_of_trees,
        sum(encoder.architecture.dim for encoder in model.encoders),
    )
    changes = len(known.prototypes.mean) - features
    beside = f" and {changes} numbers of what changes" if changes else ""
    screening = (
        "The screening `joint` calls a window unknown below δ = "
        f"{1.0 - known.screening.threshold:.2g}."
    )
    text = (
        f"{trees} trees vote on {features} features of {len(model.encoders)} "
        f"encoders{beside}. {screening}"
    )
    if model.least:
        shares = {label: model.least_share(label) for label in model.known.classes.tolist()}
        needed = ", ".join(
            f"{title_of(label)} {share:.0%}" for label, share in shares.items() if share > 0.0
        )
        text += f"\nA class needs this share of the votes, else the window is nothing: {needed}."
    return text


def scope(model: TRFE) -> str:
    """Return the range of a model's windows, the first of its limits."""
    view = model.encoders[0].view
    if isinstance(view, Tokens):
        about = (
            f"one motor vehicle and the {view.others} most relevant others within {view.reach:g} "
            f"m, for {view.span:g} s"
        )
        return f"- Input: {about}, in lane coordinates. No pedestrians; nothing without a lane map."
    about = (
        f"{view.frames} grids of {view.length:g} m × {view.width:g} m about one motor vehicle "
        f"within {view.span:g} s"
    )
    return (
        f"- It sees {about} ({', '.join(view.channels)}): nothing that is farther away, and "
        "nothing that takes longer."
    )


def _rates(model: TRFE, windows: Windows, parts: Split) -> str:
    """Return the table of windows per class, and the share of test windows recognised."""
    import numpy as np

    test = windows.select(parts.test)
    found = model.recognise(test.inputs)
    lines = [
        f"{len(test)} windows of test recordings: "
        f"{np.mean(found.labels == test.labels):.1%} recognised,"
        f" {np.mean(found.labels == Label.UNKNOWN):.1%} taken for unknown, "
        f"{np.mean(found.closed == test.labels):.1%} right where"
        " unknown is no answer.",
        "",
        "| class | trained with label | without | calibrated | tested | recognised |",
        "|---|---|---|---|---|---|",
    ]
    for label in model.known.classes.tolist():
        counts = [str(int((windows.labels[rows] == label).sum())) for rows in parts[:4]]
        own = test.labels == label
        lines.append(
            f"| {title_of(label)} | {' | '.join(counts)} | "
            f"{np.mean(found.labels[own] == label):.1%} |"
        )
    return "\n".join(lines)
