"""Training of the models that ship: settings, windows, splits, the command, the card."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from schemas.common.terminal.options import option

Unit = Literal["recording", "vehicle"]
"""Unit that is never divided between training and test."""


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training; `xosc-recognize train` offers them as options.

    Attributes:
        cache: folder that keeps windows made of recordings; None for one in that of the model.
        events_per_class, of_each: most windows of each class, in all and from one recording.
        preset: name of the encoder's preset.
        encoders: a model whose encoders are taken; None to train them.
        pretrain_on: recordings that pretraining reads besides, without labels.
        reviewed, verdicts: recordings that reviewers judged, and their tables, see
            `recognition.trfe.training.windows.judged`.
        develop: recordings that choose δ and least shares of votes.
        unseen: recordings that the model is measured on.
        split_by: unit that is never divided between training and test.
        forest_samples, samples: most samples of each class that trees learn from, and that are kept
            with the model.
        by_changes: whether plain numbers of what changes in windows recognise, too.
        seed: of everything random.
    """

    cache: Path | None = option(
        None, "Folder that keeps windows made of recordings.  [default: DIR/windows]", metavar="DIR"
    )
    events_per_class: int = option(2600, "Most windows of each class.", min=20, metavar="N")
    of_each: int = option(
        60, "Most windows of each class from one recording.", "--per-recording", min=1, metavar="N"
    )
    preset: str = option(
        "tokens", "What the encoder reads, its size and training: tokens, or of grids cpu or full."
    )
    encoders: Path | None = option(
        None, "A model whose encoders are taken.  [default: they are trained]", metavar="DIR"
    )
    pretrain_on: Sequence[Path] = option(
        (),
        "Recordings of real traffic, say, on which the encoder is pretrained beside the windows, "
        "without their labels"
        " (repeatable).",
        metavar="DIR",
    )
    reviewed: Sequence[Path] = option(
        (),
        "Recordings that reviewers judged: the moments of their --verdicts train too (repeatable).",
        metavar="DIR",
    )
    verdicts: Sequence[Path] = option(
        (),
        "CSV table of a reviewer's verdicts on --reviewed: recording as in an index, vehicle, "
        "time, class and, for findings,"
        " verdict (right, wrong or unclear); what contradicts another within 2 s is left out "
        "(repeatable).",
        metavar="FILE",
    )
    develop: Sequence[Path] = option(
        (),
        "Recordings of other sites, by which δ is chosen (at most a tenth of events there is "
        "unknown), and the share of votes"
        " that each class needs, so that windows in which nothing happens get none (repeatable).",
        metavar="DIR",
    )
    unseen: Sequence[Path] = option(
        (),
        "Recordings of other sites, on which the model is measured for its card (repeatable).",
        metavar="DIR",
    )
    split_by: Unit = option(
        "recording",
        "What is never divided between training and test: recording or vehicle.",
        type=Unit,
    )
    forest_samples: int | None = option(
        None,
        "Most samples of each class that trees learn from.  [default: all]",
        min=20,
        metavar="N",
    )
    samples: int | None = option(
        None,
        "Most samples of each class that are kept with the model.  [default: all]",
        min=20,
        metavar="N",
    )
    by_changes: bool = option(
        False,
        "Whether windows of tokens are recognised by plain numbers of what changes in them too, "
        "beside the encoders' features;"
        " classes are discovered by these numbers in any case.",
        "--by-changes/--by-encoders",
    )
    seed: int = option(0, "Of everything random.", min=0)
