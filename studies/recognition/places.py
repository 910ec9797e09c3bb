"""`python -m studies.recognition places`: how much of the classes the map alone tells, among those
of one kind of place too."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from recognition.labels.classes import Label
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import Verbose, Version, interruptible, out_folder
from studies.recognition.plain import kinematic, static

if TYPE_CHECKING:
    from recognition.trfe.training.windows import Windows

PLACES: dict[str, list[Label]] = {
    "all": [label for label in Label if label is not Label.UNKNOWN],
    "along a road": [
        Label.FREE_CRUISE, Label.CAR_FOLLOWING, Label.CUT_IN, Label.CUT_OUT, Label.LANE_CHANGE_LEFT,
        Label.LANE_CHANGE_RIGHT,
    ],
    "at ramps": [Label.RAMP_ENTERING, Label.RAMP_EXITING],
    "in towns": [Label.URBAN_CUT_IN, Label.URBAN_CUT_OUT],
    "at roundabouts": [Label.ROUNDABOUT_ENTERING, Label.ROUNDABOUT_EXITING,
        Label.ROUNDABOUT_CIRCULATING],
    "at junctions": [Label.LEFT_TURN, Label.RIGHT_TURN, Label.STRAIGHT_CROSS, Label.MERGING],
}  # fmt: skip
"""Classes of each kind of place"""
_FEATURES = {
    "the ego's lane in the middle frame, without motion or anybody": static,
    "13 numbers of motion": kinematic,
}
_OF_EACH, _FOLDS, _TREES = 400, 5, 250


@interruptible("studies.recognition places")
def places(
    windows: Annotated[
        Path,
        typer.Argument(
            metavar="WINDOWS", help="Folder of windows of tokens, as `train --cache` keeps them."
        ),
    ],
    out: Annotated[Path, out_folder("Folder for places.md.")],
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Measure how well forests tell classes apart by the map alone, and by motion alone: all, and
    those of each kind of place.

    Balanced accuracy, cross-validated by recording, so that no map of a test trains.
    """
    from recognition.trfe.training.windows import Windows
    from schemas.common.storage import keep, writing

    found = Windows.load(windows)
    if len(np.unique(found.recordings)) < _FOLDS:
        raise UsageError(f"the windows are of fewer than {_FOLDS} recordings", path=windows)
    with writing("the report", out):
        print(keep(("\n".join(_table(found)) + "\n").encode(), out / "places.md"))


def _table(windows: Windows) -> Iterator[str]:
    from recognition.trfe.inputs.samples import drawn_of_each

    yield f"| classes | windows | chance | {' | '.join(_FEATURES)} |"
    yield "|---|---|---|" + "---|" * len(_FEATURES)
    drawn = np.sort(drawn_of_each(windows.labels, _OF_EACH, np.random.default_rng(0)))
    for name, labels in PLACES.items():
        here = windows.select(drawn[np.isin(windows.labels[drawn], labels)])
        present = len(np.unique(here.labels))
        if present > 1:
            told = [f"{_told(made(here.inputs), here):.2f}" for made in _FEATURES.values()]
            yield f"| {name} | {len(here)} | {1 / present:.2f} | {' | '.join(told)} |"


def _told(features: np.ndarray, windows: Windows) -> float:
    """Balanced accuracy of a forest on windows of recordings that it has not seen."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.metrics import balanced_accuracy_score
    from sklearn.model_selection import GroupKFold, cross_val_predict

    forest = RandomForestClassifier(_TREES, random_state=0, class_weight="balanced")
    found = cross_val_predict(
        forest, features, windows.labels, groups=windows.recordings, cv=GroupKFold(_FOLDS)
    )
    return float(balanced_accuracy_score(windows.labels, found))
