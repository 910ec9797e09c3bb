"""`python -m studies.recognition sites`: a model, and rows to hold it against, on recordings of sites that none has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from schemas.common.command_line import Verbose, Version, interruptible, out_folder
from schemas.common.errors import UsageError
from studies.recognition.plain import kinematic, static

if TYPE_CHECKING:
    from recognition.training.card import Agreement, Recognise, SiteWindows
    from recognition.training.windows import View, Windows
    from recognition.trfe.trfe import TRFE

Made = Callable[["Windows"], NDArray[np.float32]]
"""Features (n, d) of windows"""
_OF_EACH = 400
"""Windows of each class that rows are fitted on"""


@interruptible("studies.recognition sites")
def sites(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Folder of a model.")],
    paths: Annotated[list[Path], typer.Argument(metavar="RECORDINGS...", help="Folders of recordings, a data set each.")],
    out: Annotated[Path, out_folder("Folder for sites.md.")],
    windows: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Windows that the model was trained on, to fit rows of other features on.")
    ] = None,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Measure how a model agrees with the rules on recordings, at their events and at a regular stride.

    With the windows that trained it, forests on a map without vehicles, on thirteen numbers of motion, and linear classifiers on
    the encoder before fine-tuning and on a random one are held against it; and a linear classifier that learns from the other
    recordings too, each time without those that it is measured on.
    """
    from recognition.labels import Rules
    from recognition.training.card import agreement, site_windows, table
    from recognition.training.windows import Windows
    from recognition.trfe.storage import load
    from schemas.common.storage import keep, writing

    trfe = load(model)
    if not trfe.encoders:
        raise UsageError("this model has no encoder: it can't recognise recordings", path=model)
    view = trfe.encoders[0].view
    with writing("the report", out):
        out.mkdir(parents=True, exist_ok=True)
        seen = [site_windows(path, out / "cache", view, Rules(signalised=True)) for path in paths]
        rows = [("model", [agreement(lambda part: trfe.recognise(part.inputs).labels, one) for one in seen])]
        if windows is not None:
            rows += _rows(trfe, Windows.load(windows), view, seen)
        parts = [f"## {name}\n\n{table(found)}\n" for name, found in rows]
        parts.append("## Classes\n\n" + _classes(rows[0][1]))
        print(keep("\n".join(parts).encode(), out / "sites.md"))


def _classes(rows: Iterable[Agreement]) -> str:
    from recognition.trfe.known import title_of

    lines = ["| recordings | class | events | agree |", "|---|---|---|---|"]
    lines += [
        f"| {row.name} | {title_of(label)} | {events} | {right / events:.1%} |"
        for row in rows
        for label, events, right in row.classes
    ]
    return "\n".join(lines) + "\n"


def _rows(trfe: TRFE, training: Windows, view: View, seen: list[SiteWindows]) -> Iterator[tuple[str, list[Agreement]]]:
    """Other features, fitted on windows of the same classes, as many of each."""
    from recognition.encoder.model import untrained
    from recognition.encoder.storage import features
    from recognition.encoder.training import deterministic
    from recognition.training.card import agreement
    from recognition.trfe.samples import drawn_of_each

    training = training.select(np.sort(drawn_of_each(training.labels, _OF_EACH, np.random.default_rng(0))))
    with deterministic(0):
        random = untrained(trfe.encoders[0].architecture, view)
    for name, made in (
        ("map only, one frame, forest", lambda part: static(part.inputs)),
        ("13 numbers of motion, forest", lambda part: kinematic(part.inputs)),
        ("random encoder, linear", lambda part: features(random, part)),
        ("pretrained encoder, linear", lambda part: features(trfe.encoders[0], part)),
        ("fine-tuned encoder, linear", lambda part: features(trfe.encoders[-1], part)),
    ):
        recognise = _fitted(made, training, linear="linear" in name)
        yield name, [agreement(recognise, one) for one in seen]
    tuned: Made = partial(features, trfe.encoders[-1])
    others = [joined(training, [other for other in seen if other is not one]) for one in seen]
    found = [agreement(_fitted(tuned, known, linear=True), one) for known, one in zip(others, seen, strict=True)]
    yield "fine-tuned encoder, linear, other recordings too", found


def joined(training: Windows, sites: Sequence[SiteWindows]) -> Windows:
    """Windows and those of other recordings, at events and at the stride, no more of each class."""
    from recognition.training.windows import Windows
    from recognition.trfe.samples import drawn_of_each

    parts = [training]
    for windows in (windows for site in sites for windows in (site.events, site.regular)):
        parts.append(windows.select(np.sort(drawn_of_each(windows.labels, _OF_EACH, np.random.default_rng(0)))))
    return Windows(*(np.concatenate(columns) for columns in zip(*(part.columns for part in parts), strict=True)))


def _fitted(made: Made, training: Windows, linear: bool) -> Recognise:
    """A classifier on features, as a function of windows; nothing is unknown to it."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    classifier = (
        make_pipeline(StandardScaler(), LogisticRegression(max_iter=1000, class_weight="balanced"))
        if linear
        else RandomForestClassifier(250, random_state=0, class_weight="balanced", n_jobs=-1)
    )
    classifier.fit(made(training), training.labels)
    return lambda part: classifier.predict(made(part)) if len(part) else part.labels
