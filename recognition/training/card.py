"""The card of a model: what it was trained on, how good it is, how it decides, and what it is not for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from recognition.labels.classes import Label
from recognition.tokens.config import Tokens
from recognition.training.agreement import Agreement, table
from recognition.trfe.titles import title_of
from schemas.packages import version

if TYPE_CHECKING:
    from recognition.training.splits import Split
    from recognition.training.windows import Windows
    from recognition.trfe.trfe import TRFE

CARD = "README.md"
"""File of a model's folder that describes it"""
LIMITS = """\
- Classes are what the labelling rules take them for: the rates tell how far the model agrees with the rules, on recordings like
  those that trained it. With other traffic, sensors or maps expect more unknown and more wrong classes; try some before you
  rely on it.
- Rare classes were trained with few windows. Confidences are shares of votes, no probabilities.
- It sorts recordings for tests, afterwards. It is not made to decide anything in a vehicle, and where it finds nothing
  critical, that is no evidence of safety."""
_GOOD = 0.75
"""Share of agreeing events below which the card says that a class fails"""
_LICENCE = "Those who trained it decide, as far as the terms of the recordings allow."


def card_of(model: TRFE, windows: Windows, parts: Split, data: str, unseen: Sequence[Agreement] = ()) -> str:
    """What a model was trained on, what it makes of windows of its `parts` that it has not seen, and what it is for; Markdown.

    Args:
        unseen: how it agrees with the rules on recordings of other sites.
    """
    missing = ", ".join(f"{title_of(label)} ({count} windows)" for label, count in sorted(parts.left_out.items()))
    paragraphs = [
        "# TRFE model",
        f"Made by xosc-recognize train (xosc-toolchain {version()}) from {data}.\n{_rates(model, windows, parts)}",
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
    """Where it was measured besides, and where it fails."""
    if not unseen:
        return []
    counts: dict[int, tuple[int, int]] = {}
    for label, events, agreeing in (one for site in unseen for one in site.classes):
        before = counts.get(label, (0, 0))
        counts[label] = before[0] + events, before[1] + agreeing
    poor = [(label, some, good) for label, (some, good) in sorted(counts.items()) if good < _GOOD * some]
    failing = [f"{title_of(label)} ({good} of {some})" for label, some, good in poor]
    about = (
        "Recordings of sites that it was not trained on. Of the rules' events: how many get the rules' class, nothing, unknown, "
        "or another class. Of windows at a regular stride in which no rule finds anything (quiet): how many are taken for "
        "nothing or for unknown. Confirmed: of all windows at the stride that get a class, how many the rules give the same."
    )
    fails = f"It fails, with less than {_GOOD:.0%} of the rules' events there, at: {', '.join(failing) or 'no class'}."
    return ["## Sites that it has not seen", about, table(unseen), fails]


def decision(model: TRFE) -> str:
    """By what a model takes windows for a class, or for unknown."""
    known = model.known
    trees, features = len(known.forest.trees.estimators_), sum(encoder.architecture.dim for encoder in model.encoders)
    changes = len(known.prototypes.mean) - features
    beside = f" and {changes} numbers of what changes" if changes else ""
    screening = f"the screening `joint` calls unknown what belongs to no class, by δ = {1.0 - known.screening.threshold:.2g}"
    text = f"{trees} trees vote on {features} features of {len(model.encoders)} encoders{beside}; {screening}."
    if model.least:
        needed = ", ".join(f"{title_of(label)} {share:.0%}" for label, share in model.least.items())
        text += f"\nWith less than this share of the votes for classes, a window is taken for nothing: {needed}."
    return text


def scope(model: TRFE) -> str:
    """What a model's windows show, as the first of its limits."""
    view = model.encoders[0].view
    if isinstance(view, Tokens):
        about = (
            f"one motor vehicle and the {view.others} others that matter most to it within {view.reach:g} m, for {view.span:g} s"
        )
        return f"- It sees {about}, in coordinates of the lanes: no pedestrians, and nothing without a map of the lanes."
    about = f"{view.frames} grids of {view.length:g} m × {view.width:g} m about one motor vehicle within {view.span:g} s"
    return f"- It sees {about} ({', '.join(view.channels)}): nothing that is farther away, and nothing that takes longer."


def _rates(model: TRFE, windows: Windows, parts: Split) -> str:
    """How many windows of each class there were, and how many of those for tests are recognised."""
    import numpy as np

    test = windows.select(parts.test)
    found = model.recognise(test.inputs)
    lines = [
        f"{len(test)} windows of test recordings: {np.mean(found.labels == test.labels):.1%} recognised,"
        f" {np.mean(found.labels == Label.UNKNOWN):.1%} taken for unknown, {np.mean(found.closed == test.labels):.1%} right where"
        " unknown is no answer.",
        "",
        "| class | trained with label | without | calibrated | tested | recognised |",
        "|---|---|---|---|---|---|",
    ]
    for label in model.known.classes.tolist():
        counts = [str(int((windows.labels[rows] == label).sum())) for rows in parts[:4]]
        own = test.labels == label
        lines.append(f"| {title_of(label)} | {' | '.join(counts)} | {np.mean(found.labels[own] == label):.1%} |")
    return "\n".join(lines)
