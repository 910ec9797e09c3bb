"""`xosc-recognize train`: a model from recordings, with a card about it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from recognition.trfe.training import TrainingSettings
from schemas.common.errors import UsageError
from schemas.common.storage import keep
from schemas.common.terminal.command_line import (
    Verbose,
    Version,
    interruptible,
    out_folder,
    protected,
)
from schemas.common.terminal.options import with_settings
from schemas.common.terminal.text import markdown

if TYPE_CHECKING:
    from recognition.trfe.config import Config
    from recognition.trfe.encoder.config import Preset
    from recognition.trfe.encoder.inference import StoredEncoder
    from recognition.trfe.encoder.model import Encoder
    from recognition.trfe.encoder.training import Progress
    from recognition.trfe.training.windows import Split, View, Windows
    from recognition.trfe.trfe import TRFE


@protected("max_runs")
@with_settings
@interruptible("xosc-recognize train")
def train(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="WINDOWS_OR_RECORDINGS", help="Folder of windows, or of recordings."
        ),
    ],
    out: Annotated[Path, out_folder("Folder of the model.")],
    settings: TrainingSettings,
    _verbose: Verbose = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress bar and no figures.")
    ] = False,
    _version: Version = False,
) -> None:
    """Train a model that recognises the classes of recordings, to be used by xosc-recognize
    catalogue --model DIR.

    Recordings are divided: a part trains, a part calibrates what counts as unknown, a part measures
    how good the model is.
    """
    import numpy as np

    from recognition.labels import Rules
    from recognition.trfe.config import Config
    from recognition.trfe.encoder.config import TokenArchitecture
    from recognition.trfe.encoder.config import preset as preset_of
    from recognition.trfe.forest.known import DELTA
    from recognition.trfe.inputs.grids import Grid
    from recognition.trfe.inputs.tokens import Tokens
    from recognition.trfe.storage import load, save
    from recognition.trfe.training.card import (
        CARD,
        accept,
        agreement,
        card_of,
        least_shares,
        site_windows,
    )
    from recognition.trfe.training.windows import (
        joined,
        judged,
        reviewed,
        source_of,
        split,
        windows_at,
    )

    if settings.encoders and settings.pretrain_on:
        raise UsageError(
            "--encoders takes encoders that are trained: give either it or --pretrain-on"
        )
    if bool(settings.reviewed) != bool(settings.verdicts):
        raise UsageError("--reviewed and --verdicts belong together: give both or neither")
    judgements = judged(settings.verdicts)  # a faulty table is better named before windows are made
    chosen, rules = preset_of(settings.preset), Rules(signalised=True)
    view = Tokens() if isinstance(chosen.architecture, TokenArchitecture) else Grid()
    folder = settings.cache or out / "windows"
    # Named after recordings, preset and number: windows of other settings are not taken for these.
    kept = folder / f"{source_of(path)}-{settings.preset}-{settings.of_each}"
    windows = windows_at(path, kept, view, settings.of_each, background=True)
    parts = split(windows, settings.seed, settings.split_by, settings.events_per_class)
    if not len(parts.labelled):
        raise UsageError(
            f"no class has enough {settings.split_by}s to be in every part of the data", path=path
        )
    others = [
        part for one in settings.pretrain_on for part in site_windows(one, folder, view, rules)[1:]
    ]
    besides = (
        reviewed(settings.reviewed, judgements, folder / "roads", view)
        if settings.verdicts
        else windows.select([])
    )
    # Verdicts on classes that are too rare to be known would teach the trees further classes.
    besides = besides.select(np.isin(besides.labels, windows.labels[parts.labelled]))
    with epochs(chosen.pretraining.epochs + chosen.finetuning.epochs, quiet) as progress:
        labelled = joined([windows.select(parts.labelled), besides])
        if settings.encoders:
            trained = load(settings.encoders).encoders
        else:
            trained = encoders_of(labelled, others, chosen, view, settings.seed, progress)
        # With --develop `accept` adapts the usual δ; a choice by leaving classes out costs a forest
        # for each.
        config = Config(
            seed=settings.seed,
            delta=DELTA if settings.develop else None,
            recognise_by_changes=settings.by_changes,
        )
        model = fitted(windows, parts, trained, config, settings.forest_samples, besides)
    if settings.develop:
        elsewhere = [site_windows(one, folder, view, rules) for one in settings.develop]
        accept(model, [one.events for one in elsewhere])
        model.least = least_shares(model, elsewhere)
    elsewhere = [site_windows(one, folder, view, rules) for one in settings.unseen]
    measured = [
        agreement(lambda windows: model.recognise(windows.inputs).labels, one) for one in elsewhere
    ]
    if measured:
        model.unseen_sites = (
            min(one.agree for one in measured),
            max(one.wrong + one.nothing for one in measured),
        )
    save(model, out, settings.samples)
    chosen_by = (
        f", δ and least shares of votes by {_names(settings.develop)}" if settings.develop else ""
    )
    beside = f", pretrained on {_names(settings.pretrain_on)} too" if settings.pretrain_on else ""
    beside += (
        f", and {len(besides)} windows of reviewers' verdicts on {_names(settings.reviewed)}"
        if len(besides)
        else ""
    )
    data = (
        f"{markdown(path.name)}, preset {settings.preset}, seed {settings.seed}, divided by "
        f"{settings.split_by}"
    )
    card = card_of(model, windows, parts, data + beside + chosen_by, measured)
    keep(card.encode(), out / CARD)
    if not quiet:
        print(card)


def _names(folders: Sequence[Path]) -> str:
    return ", ".join(markdown(one.name) for one in folders)


@contextmanager
def epochs(count: int, quiet: bool) -> Iterator[Progress | None]:
    """Progress bar of epochs on standard error, if that is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("training", total=count)
        yield lambda epoch, loss: bar.update(
            task, advance=1, description=f"epoch {epoch}, loss {loss:.3f}"
        )


def encoders_of(
    labelled: Windows,
    others: Sequence[Windows],
    preset: Preset,
    view: View,
    seed: int,
    progress: Progress | None,
) -> tuple[Encoder, Encoder]:
    """An encoder pretrained on windows of the known classes and on others, and the same fine-tuned
    on the first with labels."""
    from recognition.trfe.encoder.storage import rounded
    from recognition.trfe.encoder.training import finetune, pretrain
    from recognition.trfe.training.windows import joined

    encoder = pretrain(joined([labelled, *others]), preset, view, seed, progress=progress)
    tuned = finetune(encoder, labelled, preset.finetuning, seed, progress)
    return rounded(encoder), rounded(tuned)


def fitted(
    windows: Windows,
    parts: Split,
    encoders: Sequence[Encoder | StoredEncoder],
    settings: Config,
    most: int | None,
    judged: Windows,
) -> TRFE:
    """A model with these encoders; without a δ one is chosen.

    Args:
        most: windows of each class that trees learn from.
        judged: windows of reviewers' verdicts, which trees learn from besides.
    """
    from dataclasses import replace

    import numpy as np

    from recognition.trfe.inputs.samples import drawn_of_each
    from recognition.trfe.inputs.tokens import CHANGES, Tokens
    from recognition.trfe.training.windows import joined
    from recognition.trfe.trfe import TRFE

    labelled, held = windows.select(parts.labelled), windows.select(parts.validation)
    changes = CHANGES if isinstance(encoders[0].view, Tokens) else 0
    model = TRFE(
        replace(settings, changes=changes, pretrained=encoders[0].architecture.dim), encoders
    )
    labelled = labelled.select(
        np.sort(drawn_of_each(labelled.labels, most, np.random.default_rng(settings.seed)))
    )
    labelled = joined([labelled, judged])
    return model.fit(labelled.inputs, labelled.labels, held.inputs, held.labels)
