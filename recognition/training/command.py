"""`xosc-recognize train`: a model from recordings, with a card about it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from recognition.training import Unit
from schemas.common.command_line import Verbose, Version, interruptible, out_folder, protected
from schemas.common.errors import UsageError
from schemas.common.storage import keep
from schemas.common.text import markdown

if TYPE_CHECKING:
    from recognition.encoder.config import Preset
    from recognition.encoder.model import Encoder
    from recognition.encoder.training import Progress
    from recognition.training.data import Split
    from recognition.training.windows import View, Windows
    from recognition.trfe.config import Config
    from recognition.trfe.trfe import TRFE


@protected("max_runs")
@interruptible("xosc-recognize train")
def train(
    path: Annotated[Path, typer.Argument(metavar="WINDOWS_OR_RECORDINGS", help="Folder of windows, or of recordings.")],
    out: Annotated[Path, out_folder("Folder of the model.")],
    cache: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that keeps windows made of recordings.  [default: DIR/windows]")
    ] = None,
    events_per_class: Annotated[int, typer.Option(min=20, metavar="N", help="Most windows of each class.")] = 2600,
    of_each: Annotated[
        int, typer.Option("--per-recording", min=1, metavar="N", help="Most windows of each class from one recording.")
    ] = 60,
    preset: Annotated[
        str, typer.Option(help="What the encoder reads, its size and training: tokens, or of grids cpu or full.")
    ] = "tokens",
    encoders: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="A model whose encoders are taken.  [default: they are trained]"),
    ] = None,
    pretrain_on: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="Recordings of real traffic, say, on which the encoder is pretrained beside the windows, without their labels"
            " (repeatable).",
        ),
    ] = None,
    develop: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="Recordings of other sites, by which δ is chosen (at most a tenth of events there is unknown), and the share of"
            " votes that each class needs, so that windows in which nothing happens get none (repeatable).",
        ),
    ] = None,
    unseen: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="Recordings of other sites, on which the model is measured for its card (repeatable)."),
    ] = None,
    split_by: Annotated[
        Unit, typer.Option(help="What is never divided between training and test: recording or vehicle.")
    ] = "recording",
    forest_samples: Annotated[
        int | None, typer.Option(min=20, metavar="N", help="Most samples of each class that trees learn from.  [default: all]")
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(min=20, metavar="N", help="Most samples of each class that are kept with the model.  [default: all]"),
    ] = None,
    by_changes: Annotated[
        bool,
        typer.Option(
            "--by-changes/--by-encoders",
            help="Whether windows of tokens are recognised by plain numbers of what changes in them too, beside the encoders'"
            " features; classes are discovered by these numbers in any case.",
        ),
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 0,
    _verbose: Verbose = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no figures.")] = False,
    _version: Version = False,
) -> None:
    """Train a model that recognises the classes of recordings, to be used by xosc-recognize catalogue --model DIR.

    Recordings are divided: a part trains, a part calibrates what counts as unknown, a part measures how good the model is.
    """
    from recognition.encoder.config import TokenArchitecture
    from recognition.encoder.config import preset as preset_of
    from recognition.grids import Grid
    from recognition.labels import Rules
    from recognition.tokens import Tokens
    from recognition.training.card import CARD, accept, agreement, card_of, least_shares, site_windows
    from recognition.training.data import source_of, split, windows_at
    from recognition.trfe.config import Config
    from recognition.trfe.known import DELTA
    from recognition.trfe.storage import load, save

    if encoders and pretrain_on:
        raise UsageError("--encoders takes encoders that are trained: give either it or --pretrain-on")
    chosen, rules = preset_of(preset), Rules(signalised=True)
    view = Tokens() if isinstance(chosen.architecture, TokenArchitecture) else Grid()
    folder = cache or out / "windows"
    kept = folder / f"{source_of(path)}-{preset}-{of_each}"
    windows = windows_at(path, kept, view, of_each, background=True)
    parts = split(windows, seed, split_by, events_per_class)
    if not len(parts.labelled):
        raise UsageError(f"no class has enough {split_by}s to be in every part of the data", path=path)
    others = [part for one in pretrain_on or () for part in site_windows(one, folder, view, rules)[1:]]
    with epochs(chosen.pretraining.epochs + chosen.finetuning.epochs, quiet) as progress:
        labelled = windows.select(parts.labelled)
        trained = load(encoders).encoders if encoders else encoders_of(labelled, others, chosen, view, seed, progress)
        settings = Config(seed=seed, delta=DELTA if develop else None, recognise_by_changes=by_changes)
        model = fitted(windows, parts, trained, settings, forest_samples)
    if develop:
        elsewhere = [site_windows(one, folder, view, rules) for one in develop]
        accept(model, [one.events for one in elsewhere])
        model.least = least_shares(model, elsewhere)
    elsewhere = [site_windows(one, folder, view, rules) for one in unseen or ()]
    measured = [agreement(lambda windows: model.recognise(windows.inputs).labels, one) for one in elsewhere]
    if measured:
        model.unseen_sites = min(one.agree for one in measured), max(one.wrong + one.nothing for one in measured)
    save(model, out, samples)
    chosen_by = f", δ and least shares of votes by {_names(develop)}" if develop else ""
    beside = f", pretrained on {_names(pretrain_on)} too" if pretrain_on else ""
    data = f"{markdown(path.name)}, preset {preset}, seed {seed}, divided by {split_by}{beside}{chosen_by}"
    card = card_of(model, windows, parts, data, measured)
    keep(card.encode(), out / CARD)
    if not quiet:
        print(card)


def _names(folders: Sequence[Path]) -> str:
    return ", ".join(markdown(one.name) for one in folders)


@contextmanager
def epochs(count: int, quiet: bool) -> Iterator[Progress | None]:
    """A bar on standard error for so many epochs, where that is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("training", total=count)
        yield lambda epoch, loss: bar.update(task, advance=1, description=f"epoch {epoch}, loss {loss:.3f}")


def encoders_of(
    labelled: Windows, others: Sequence[Windows], preset: Preset, view: View, seed: int, progress: Progress | None
) -> tuple[Encoder, Encoder]:
    """An encoder pretrained on windows of the known classes and on others, and the same fine-tuned on the first with labels."""
    from recognition.encoder.storage import rounded
    from recognition.encoder.training import finetune, pretrain
    from recognition.training.windows import joined

    encoder = pretrain(joined([labelled, *others]), preset, view, seed, progress=progress)
    tuned = finetune(encoder, labelled, preset.finetuning, seed, progress)
    return rounded(encoder), rounded(tuned)


def fitted(windows: Windows, parts: Split, encoders: Sequence[Encoder], settings: Config, most: int | None) -> TRFE:
    """A model with these encoders, whose trees learn from at most so many windows of each class; without a δ one is chosen."""
    from dataclasses import replace

    import numpy as np

    from recognition.tokens import CHANGES, Tokens
    from recognition.trfe.samples import drawn_of_each
    from recognition.trfe.trfe import TRFE

    labelled, held = windows.select(parts.labelled), windows.select(parts.validation)
    changes = CHANGES if isinstance(encoders[0].view, Tokens) else 0
    model = TRFE(replace(settings, changes=changes, pretrained=encoders[0].architecture.dim), encoders)
    labelled = labelled.select(np.sort(drawn_of_each(labelled.labels, most, np.random.default_rng(settings.seed))))
    return model.fit(labelled.inputs, labelled.labels, held.inputs, held.labels)
