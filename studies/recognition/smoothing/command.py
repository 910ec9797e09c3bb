"""`python -m studies.recognition smoothing`: settings of smoothing, chosen on some recordings and
reported on others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import Verbose, Version, interruptible, out_folder

if TYPE_CHECKING:
    from studies.recognition.smoothing.search import Judged, Material, Trial


@interruptible("studies.recognition smoothing")
def smoothing(
    development: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDINGS...", help="Data sets to choose settings by, a folder or file each."
        ),
    ],
    report: Annotated[
        list[Path],
        typer.Option("--report", metavar="PATH", help="Data set to report on (repeatable)."),
    ],
    out: Annotated[Path, out_folder("Folder for smoothing.md.")],
    own: Annotated[
        int, typer.Option(min=0, metavar="SEED", help="Seed of the exact recordings to choose by.")
    ] = 400,
    report_own: Annotated[
        int, typer.Option(min=0, metavar="SEED", help="Seed of those to report on.")
    ] = 402,
    rows: Annotated[
        int, typer.Option(min=1, metavar="N", help="Rows drawn of each data set.")
    ] = 20_000,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of what is drawn, hidden, and of noise.")
    ] = 0,
    _verbose: Verbose = False,
    _version: Version = False,
) -> None:
    """Choose settings of smoothing on recordings, and hold it against other ways to smooth on
    others.

    Stretches of 0.2 to 1 s are hidden from tracks, and found again. Exact recordings of our own get
    noise, and are smoothed.
    """
    from schemas.common.storage import keep, writing
    from studies.recognition.smoothing.search import BY_HAND, METHODS, best, judged, searched

    if {path.resolve() for path in development} & {
        path.resolve() for path in report
    } or own == report_own:
        raise UsageError("what settings are chosen by is not to be reported on")
    for paths in (development, report):
        twice = [path for path in paths if sum(path.stem == other.stem for other in paths) > 1]
        if twice:
            raise UsageError(f"two data sets have the name {twice[0].stem!r}", path=twice[0])
    with writing("the report", out):
        out.mkdir(parents=True, exist_ok=True)
        chosen_by, reported = (
            _material(development, own, rows, seed),
            _material(report, report_own, rows, seed),
        )
        tried = [searched(method, chosen_by) for method in METHODS]
        hand = next(trial for trial in tried[0] if trial.settings == BY_HAND)
        lines = [("set by hand", METHODS[0], hand)]
        bests = (best(trials, hand.judged.error) for trials in tried)
        lines += [
            (method.name, method, trial) for method, trial in zip(METHODS, bests, strict=True)
        ]
        chosen = [(name, trial.settings, trial.judged) for name, _, trial in lines]
        others = [
            (name, trial.settings, judged(method.make(**trial.settings), reported))
            for name, method, trial in lines
        ]
        parts = ["## Chosen by", *_table(chosen), "", "## Reported on", *_table(others)]
        parts += ["", "## About the settings set by hand", *_about(tried[0], hand)]
        print(keep(("\n".join(parts) + "\n").encode(), out / "smoothing.md"))


def _material(paths: Sequence[Path], own: int, rows: int, seed: int) -> Material:
    """Tracks of data sets with rows hidden, and exact ones with noise; what is drawn of one depends
    on no other."""
    from studies.recognition.smoothing.cases import drawn, exact, hidden, noisy
    from studies.recognition.smoothing.search import Material

    recordings = {}
    for path in paths:
        rng = np.random.default_rng((seed, 0))
        recordings[path.stem] = [hidden(tracks, rng) for tracks in drawn(path, rows, rng)]
        if not recordings[path.stem]:
            raise UsageError("no track is long enough to hide rows of it", path=path)
    rng = np.random.default_rng((seed, 1))
    return Material(recordings, [noisy(tracks, rng) for tracks in exact(own, rows, rng)])


def _table(rows: Sequence[tuple[str, dict[str, float], Judged]]) -> Iterator[str]:
    """A line for each way: errors of hidden rows by data set, of exact recordings, and both against
    the first line."""
    names = list(rows[0][2].recordings)
    heads = [
        *(f"{name}: place, heading, speed, likelihood, beyond limits" for name in names),
        "exact: place, heading, speed, acceleration",
    ]
    yield f"| way | settings | {' | '.join(heads)} | {' | '.join(_COMPARED)} |"
    yield "|---" * (len(heads) + 2 + len(_COMPARED)) + "|"
    for way, settings, found in rows:
        told = ", ".join(f"{name} {value:g}" for name, value in settings.items()) or "–"
        cells = [
            (
                f"{one.place:.3f}, {one.heading:.3f}, {one.speed:.2f}, {one.likelihood:.2f}, "
                f"{one.beyond:.2%}"
            )
            for one in found.recordings.values()
        ]
        own = found.exact
        cells.append(f"{own.place:.3f}, {own.heading:.3f}, {own.speed:.3f}, {own.acceleration:.2f}")
        yield f"| {way} | {told} | {' | '.join([*cells, *_compared(found, rows[0][2])])} |"


def _about(trials: Sequence[Trial], hand: Trial) -> Iterator[str]:
    """Trials that differ from the settings set by hand in one of them."""
    yield f"| setting | {' | '.join(_COMPARED)} |"
    yield "|---" * (1 + len(_COMPARED)) + "|"
    for name in hand.settings:
        for trial in trials:
            if (
                all(
                    trial.settings[other] == value
                    for other, value in hand.settings.items()
                    if other != name
                )
                and trial is not hand
            ):
                yield (
                    f"| {name} {trial.settings[name]:g} | "
                    f"{' | '.join(_compared(trial.judged, hand.judged))} |"
                )


_COMPARED = ("hidden likelihood", "hidden place", "exact")


def _compared(found: Judged, than: Judged) -> list[str]:
    """Compare the likelihood of hidden places, and errors."""
    more = [
        f"{100.0 * (a / b - 1.0):+.1f} %"
        for a, b in ((found.place, than.place), (found.error, than.error))
    ]
    return [f"{found.likelihood - than.likelihood:+.3f}", *more]
