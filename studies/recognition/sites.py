"""`python -m studies.recognition sites`: a model, and rows to hold it against, on recordings of
sites that none has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, cast

import numpy as np
import typer
from numpy.typing import NDArray

from recognition.trfe.forest import VotingForest, grow
from recognition.trfe.inputs.tokens import MOTION_CHANGES, changes
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import Verbose, Version, interruptible, out_folder
from studies.recognition.plain import kinematic, static
from studies.recognition.strategies import LinearVotes, grow_linear

if TYPE_CHECKING:
    from recognition.trfe.config import Grow
    from recognition.trfe.training.card import Agreement, SiteWindows
    from recognition.trfe.training.windows import Inputs, Windows
    from recognition.trfe.trfe import TRFE

Made = Callable[["Inputs"], NDArray[np.float32]]
"""Features (n, d) of the inputs of windows"""
_OF_EACH = 400
"""Windows of each class that rows are fitted on; as many again calibrate"""


class Row(NamedTuple):
    """Features of windows, made with the model at hand, and the classifier of them that is held
    against it."""

    title: str
    made: Callable[[TRFE, Inputs], NDArray[np.float32]]
    grow: Callable[..., VotingForest | LinearVotes] = grow_linear


def _random(model: TRFE, inputs: Inputs) -> NDArray[np.float32]:
    from recognition.trfe.encoder.model import untrained
    from recognition.trfe.encoder.storage import features
    from recognition.trfe.encoder.training import deterministic

    with deterministic(0):
        random = untrained(model.encoders[0].architecture, model.encoders[0].view)
    return features([random], inputs)


def _encoded(model: TRFE, inputs: Inputs, which: slice = slice(None)) -> NDArray[np.float32]:
    from recognition.trfe.trfe import features_of

    return features_of(model.encoders[which], inputs)


def _beside(model: TRFE, inputs: Inputs) -> NDArray[np.float32]:
    return np.concatenate([changes(inputs), _encoded(model, inputs)], axis=1)


ROWS: dict[str, Row] = {
    "map-only": Row("map only, one frame, forest", lambda _, inputs: static(inputs), grow),
    "motion": Row("13 numbers of motion, forest", lambda _, inputs: kinematic(inputs), grow),
    "changes": Row("what changes, logistic regression", lambda _, inputs: changes(inputs)),
    "without-roles": Row(
        "the same without roles of lanes", lambda _, inputs: changes(inputs)[:, :MOTION_CHANGES]
    ),
    "changes-forest": Row("what changes, forest", lambda _, inputs: changes(inputs), grow),
    "random": Row("random encoder, logistic regression", _random),
    "pretrained": Row("pretrained encoder, logistic regression", partial(_encoded, which=slice(1))),
    "tuned": Row(
        "fine-tuned encoder, logistic regression", partial(_encoded, which=slice(-1, None))
    ),
    "encoded": Row("both encoders, logistic regression", _encoded),
    "beside": Row("both encoders and what changes, logistic regression", _beside),
}
"""Rows by name. Each screens and calibrates as the model does."""
OTHERS = "others"
"""The fine-tuned encoder with other recordings in training, each time without those that it is
measured on"""


@interruptible("studies.recognition sites")
def sites(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Folder of a model.")],
    paths: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDINGS...", help="Folders of recordings, a data set each."),
    ],
    out: Annotated[Path, out_folder("Folder for sites.md.")],
    windows: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Windows that the model was trained on, to fit rows of other features on.",
        ),
    ] = None,
    develop: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="Recordings by which δ and least shares of votes of rows are "
            "chosen, as `train` does.",
        ),
    ] = None,
    row: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help=f"Only these rows: {', '.join([*ROWS, OTHERS])} (repeatable)."
        ),
    ] = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Measure how a model agrees with the rules on recordings, at their events and at a regular
    stride.

    With the windows that trained it, classifiers of other features are held against it, and one
    that learns from the other recordings too, each time without those that it is measured on.
    """
    from recognition.labels import Rules
    from recognition.trfe.storage import load
    from recognition.trfe.training.card import agreement, site_windows, table
    from recognition.trfe.training.windows import Windows
    from schemas.common.storage import keep, writing

    unknown = sorted(set(row or ()) - {*ROWS, OTHERS})
    if unknown:
        raise UsageError(f"there is no row {unknown[0]!r}; rows: {', '.join([*ROWS, OTHERS])}")
    trfe = load(model)
    if not trfe.encoders:
        raise UsageError("this model has no encoder: it can't recognise recordings", path=model)
    view = trfe.encoders[0].view
    with writing("the report", out):
        out.mkdir(parents=True, exist_ok=True)
        seen, chosen = (
            [site_windows(path, out / "cache", view, Rules(signalised=True)) for path in some]
            for some in (paths, develop or ())
        )
        rows = [
            (
                "model",
                [agreement(lambda part: trfe.recognise(part.inputs).labels, one) for one in seen],
            )
        ]
        if windows is not None:
            rows += _rows(row or [*ROWS, OTHERS], trfe, Windows.load(windows), chosen, seen)
        parts = [f"## {name}\n\n{table(found)}\n" for name, found in rows]
        parts += [f"## Classes: {name}\n\n{_classes(found)}" for name, found in rows]
        print(keep("\n".join(parts).encode(), out / "sites.md"))


def _classes(rows: Iterable[Agreement]) -> str:
    from recognition.trfe.forest.known import title_of

    lines = ["| recordings | class | events | agree |", "|---|---|---|---|"]
    lines += [
        f"| {row.name} | {title_of(label)} | {events} | {right / events:.1%} |"
        for row in rows
        for label, events, right in row.classes
    ]
    return "\n".join(lines) + "\n"


def _rows(
    names: Sequence[str],
    trfe: TRFE,
    training: Windows,
    develop: Sequence[SiteWindows],
    seen: Sequence[SiteWindows],
) -> Iterator[tuple[str, list[Agreement]]]:
    """Rows fitted on windows of the same classes, as many of each."""
    from recognition.trfe.training.card import agreement
    from recognition.trfe.training.windows import split

    parts = split(training, 0, "recording")
    labelled, held = (_drawn(training.select(rows)) for rows in (parts.labelled, parts.validation))
    for name in names:
        made, title = (
            ROWS["tuned" if name == OTHERS else name],
            ROWS["tuned" if name == OTHERS else name].title,
        )
        if name != OTHERS:
            recognise = recogniser(made, trfe, labelled, held, develop)
            yield title, [agreement(recognise, one) for one in seen]
            continue
        found = []
        for one in seen:
            known = beside(labelled, [other for other in seen if other is not one])
            found.append(agreement(recogniser(made, trfe, known, held, develop), one))
        yield f"{title}, other recordings too", found


def recogniser(
    row: Row, trfe: TRFE, labelled: Windows, held: Windows, develop: Sequence[SiteWindows]
) -> Callable[[Windows], NDArray[np.int64]]:
    """A row fitted on windows and calibrated on others, as a function of windows; with recordings
    to develop on, thresholds are chosen by these."""
    from recognition.trfe.config import Config, Steps
    from recognition.trfe.forest.known import DELTA
    from recognition.trfe.training.card import SiteWindows, accept, least_shares
    from recognition.trfe.trfe import TRFE

    def seen(windows: Windows) -> Windows:
        return replace(windows, inputs=row.made(trfe, windows.inputs))

    fitted, calibrating = seen(labelled), seen(held)
    model = TRFE(Config(delta=DELTA), steps=Steps(grow=cast("Grow", row.grow)))
    model.fit(fitted.inputs, fitted.labels, calibrating.inputs, calibrating.labels)
    if develop:
        elsewhere = [SiteWindows(one.name, seen(one.events), seen(one.regular)) for one in develop]
        accept(model, [one.events for one in elsewhere])
        model.least = least_shares(model, elsewhere)
    return lambda windows: (
        model.recognise(seen(windows).inputs).labels if len(windows) else windows.labels
    )


def beside(training: Windows, sites: Sequence[SiteWindows]) -> Windows:
    """Windows and those of other recordings, at events and at the stride, no more of each class."""
    from recognition.trfe.training.windows import joined

    known = np.unique(training.labels)
    there = [windows for site in sites for windows in (site.events, site.regular)]
    return joined(
        [training, *(_drawn(windows.select(np.isin(windows.labels, known))) for windows in there)]
    )


def _drawn(windows: Windows) -> Windows:
    from recognition.trfe.inputs.samples import drawn_of_each

    return windows.select(
        np.sort(drawn_of_each(windows.labels, _OF_EACH, np.random.default_rng(0)))
    )
