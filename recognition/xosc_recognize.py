"""The command `xosc-recognize`: catalogues and replays of recordings, labels of runs, recordings of
SUMO's traffic, training.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from recognition.trfe.training.command import train
from schemas.common import packages
from schemas.common.errors import UsageError, exit_codes
from schemas.common.terminal.command_line import (
    CommandGroup,
    Jobs,
    Quiet,
    Verbose,
    Version,
    guarded,
    interruptible,
    new_app,
    out_folder,
    progress_bar,
    protected,
    say,
)
from schemas.common.terminal.files import named_road
from schemas.common.terminal.options import (
    READ,
    WRITTEN,
    option,
    with_settings,
    writable_folder,
)
from schemas.common.terminal.text import alike, many

if TYPE_CHECKING:
    from recognition.catalogue.detect import Recogniser
    from recognition.catalogue.pipeline import Summary
    from xosc.writing.versions import Version as Standard


NAME = "xosc-recognize"


@dataclass(frozen=True)
class Sorting:
    """Sorting of recordings into classes: options of `catalogue` and `label`.

    Attributes:
        labels: auto, model or rules.
        model: folder of the model; None for the one shipped.
        signalised: whether rules count junctions with traffic lights.
    """

    labels: str = option(
        "auto",
        "Who sorts: the rules, with a model only where --model, --discover or --keep-model asks "
        "for one (auto); the model in"
        " any case; or the rules, without a model.",
        type=Literal["auto", "model", "rules"],
    )
    model: Path | None = option(
        None, "Model to label by.  [default: the one shipped]", metavar="DIR"
    )
    signalised: bool = option(
        False,
        "Let the rules count junctions with traffic lights as well, in classes that are called "
        "unsignalised all the same.",
        "--signalised",
    )


@dataclass(frozen=True)
class RecordingOptions:
    """Road and columns of recordings: options of all commands that read them.

    Attributes:
        road: the OpenDRIVE file of all recordings, or the name of a shipped one; None for what they
            have.
        columns: declaration of the columns of tables; None for those beside them.
    """

    road: Path | None = option(
        None,
        "OpenDRIVE file of all recordings, or name of a shipped road.  [default: what each has, "
        "names, or has beside it]",
        metavar="FILE",
    )
    columns: Path | None = option(
        None,
        "Names, units and frame of the columns of tables, TOML.  [default: "
        "columns.toml beside each]",
        metavar="FILE",
    )

    @property
    def network(self) -> Path | None:
        """The OpenDRIVE file, a shipped one by its name."""
        return None if self.road is None else named_road(self.road)


@dataclass(frozen=True)
class ScenarioFormat:
    """Version of what is written: option of `catalogue`, `write` and `replay`.

    Attributes:
        standard: version of OpenSCENARIO.
    """

    standard: str = option(
        "1.3", "Version of OpenSCENARIO.", type=Literal["1.0", "1.1", "1.2", "1.3"]
    )

    @property
    def version(self) -> Standard:
        """Version of OpenSCENARIO as numbers."""
        major, minor = map(int, self.standard.split("."))
        return major, minor


Talkative = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print more, and tracebacks of errors.")
]
Ray = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Read and write on this Ray cluster; 'local' starts one of --jobs processes here.",
    ),
]


Scenes = Annotated[Literal["events", "vehicles"], typer.Option(help="What a scenario is made for.")]
KeepModel = Annotated[
    Path | None,
    out_folder("Folder for the model as it is afterwards, to label more recordings by."),
]
Discover = Annotated[
    bool,
    typer.Option(
        "--discover",
        help="Also take what the model does not know, or what is of discovered classes.",
    ),
]


@protected("max_runs")
@with_settings
def catalogue(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...", help="Recordings: files, or folders with all below them."
        ),
    ],
    out: Annotated[Path, out_folder("Folder of the catalogue.")],
    given: RecordingOptions,
    form: ScenarioFormat,
    sorting: Sorting,
    scenes: Scenes = "events",
    keep_model: KeepModel = None,
    discover: Discover = False,
    jobs: Jobs = 1,
    ray: Ray = None,
    verbose: Talkative = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Recognise scenarios in recordings and write a catalogue of them.

    A folder for each class: scenarios that replay what was recorded, the same as parametrised
    manoeuvres, the OpenSCENARIO catalogues that they use, and OpenLABEL tags; beside them the roads
    and an index. Files that a person has edited stay. A model that is kept knows the classes that
    it discovered, by the names that they have in the catalogue. Bytes are the same for any number
    of processes, and after an interruption the same command reads only recordings that were not
    read yet.
    """
    from recognition.catalogue.pipeline import build
    from recognition.catalogue.recordings import CatalogueSettings
    from recognition.catalogue.writing.write import CatalogueConfig
    from recognition.labels import Rules
    from runner.batch.pool import Workers

    config, rules = CatalogueConfig(version=form.version), Rules(signalised=sorting.signalised)
    settings = CatalogueSettings(scenes, given.network, given.columns, rules, config=config)
    with _labelling(sorting, discover, keep_model, quiet) as recogniser:
        summary = build(
            paths, out, settings, recogniser, partial(progress_bar, quiet=quiet), Workers(jobs, ray)
        )
    code = _report(summary, verbose, quiet)
    if not quiet and summary.classes:
        say(f"catalogue: {out}")
    raise typer.Exit(code)


@protected("max_runs")
@with_settings
def replay(
    path: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="A recording: a file, or a folder with one.")
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="FILE", help="Scenario to write, .xosc; its road goes beside it."),
    ],
    given: RecordingOptions,
    form: ScenarioFormat,
    ego: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Participant that becomes the ego.  [default: the recording's, or the one there "
            "for longest]",
        ),
    ] = None,
    raw: Annotated[
        bool,
        typer.Option(
            "--raw", help="Replay the recorded places and headings, not the smoothed motion."
        ),
    ] = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Write one scenario that replays a whole recording, without recognising anything in it.

    What was assumed, derived or left out is printed. A recording without roads is replayed on a
    plane.
    """
    from recognition.catalogue.whole import write_replay

    if out.suffix != ".xosc":
        raise UsageError("a scenario ends in .xosc", path=out)
    made = write_replay(
        path, out, ego=ego, road=given.network, columns=given.columns, version=form.version, raw=raw
    )
    if not quiet:
        for remark in made.remarks if verbose else alike(made.remarks):
            say(f"{NAME}: remark: {remark}", to=sys.stderr)
        for file in made.files:
            say(f"written: {file}")


@protected("max_runs")
@with_settings
def label(
    folder: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Results of xosc-run --out.")],
    sorting: Sorting,
    annotate: Annotated[
        bool,
        typer.Option(
            "--annotate", help="Write tagged copies and OpenLABEL beside the runs' scenarios."
        ),
    ] = False,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="Write the tags into the scenarios themselves.")
    ] = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Label the results of runs; labels.json beside them lists what was found when.

    The scenarios that they are of are annotated if asked.
    """
    from recognition.catalogue.pipeline import label_runs
    from recognition.catalogue.recordings import CatalogueSettings
    from recognition.labels import Rules

    settings, (recogniser, note) = (
        CatalogueSettings(rules=Rules(signalised=sorting.signalised)),
        _recogniser(sorting),
    )
    labelled = label_runs(
        folder,
        settings,
        recogniser(),
        partial(progress_bar, quiet=quiet),
        "scenarios" if in_place else "copies" if annotate else None,
    )
    _print_note(note, quiet)
    if not quiet:
        for name, found in labelled.findings.items():
            for detection in found:
                moment = detection.moment
                say(f"{name}: {moment.title} of {moment.ego} at {moment.time:.2f} s")
        for path in labelled.written:
            say(f"written: {path}")
    for path in labelled.edited:
        say(f"{NAME}: {path} was edited since it was written, it is left as it is", to=sys.stderr)


@contextmanager
def _labelling(
    sorting: Sorting, discover: bool, keep: Path | None, quiet: bool
) -> Iterator[Callable[[], Recogniser]]:
    """Recogniser factory; its model is kept after the work, if that is asked for."""
    from recognition.catalogue.detect import ByRules

    made, note = _recogniser(sorting, discover, keep is not None)
    if discover and made is ByRules:
        raise UsageError("--discover is for a model that labels; rules discover nothing")
    if keep and made is ByRules:
        raise UsageError("--keep-model is for a model that labels; rules learn nothing")
    recogniser = cache(made)
    yield recogniser
    if keep:
        from recognition.catalogue.model import ByModel

        model_after = recogniser()
        assert isinstance(model_after, ByModel), "rules were refused"
        model_after.keep(keep)
    _print_note(note, quiet)


def _recogniser(
    sorting: Sorting, discover: bool = False, keep: bool = False
) -> tuple[Callable[[], Recogniser], str]:
    """Recogniser factory, and the reason if rules label beside a model that was asked for."""
    from recognition.catalogue.detect import MODEL, RULES, ByRules
    from recognition.catalogue.pipeline import SHIPPED

    if sorting.labels == "rules" and sorting.model is not None:
        raise UsageError("--model and --labels rules exclude each other")
    folder = sorting.model or SHIPPED
    asked = sorting.model is not None or discover or keep
    if sorting.labels == "rules" or (sorting.labels == "auto" and not asked):
        return ByRules, ""
    if sorting.labels == "auto" and sorting.model is None and not folder.is_dir():
        return ByRules, "no model is shipped: the rules label alone"
    if not folder.is_dir():
        raise UsageError("there is no model in this folder; --labels rules needs none", path=folder)
    # else a library that the extra `search` brings as well would name that one
    packages.optional("safetensors")
    from recognition.catalogue.model import (  # needs the extra, which rules do not
        objection,
        unseen_sites,
    )

    why = objection(unseen_sites(folder))
    sorts = sorting.labels == "model" or (sorting.model is not None and why is None)
    return partial(
        _by_model, folder, sorts, discover
    ), f"scenarios are sorted by the {MODEL if sorts else RULES}: {why}" if why else ""


def _by_model(folder: Path, sorts: bool, discover: bool) -> Recogniser:
    """Labels by a model; what that takes is imported here only, which is seconds."""
    from recognition.catalogue.model import load

    return load(folder, sorts=sorts, discover=discover)


def _print_note(note: str, quiet: bool) -> None:
    if note and not quiet:
        say(f"{NAME}: {note}", to=sys.stderr)


def _print_skipped(files: list[Path], quiet: bool) -> None:
    if files and not quiet:
        from recognition.recordings.source import named

        count = "a file is" if len(files) == 1 else f"{len(files)} files are"
        say(f"{NAME}: {count} of no known format: {named(files)}", to=sys.stderr)


def _report(summary: Summary, verbose: bool, quiet: bool) -> int:
    """Print what was made; the exit code."""
    from recognition.scenes import LIT

    if not quiet:
        unread = (
            f": {many(len(summary.failures), 'recording')} could not be read"
            if summary.failures
            else ""
        )
        print(
            f"{'scenarios':>9}  class" if summary.classes else f"no scenario was recognised{unread}"
        )
        for name, count in sorted(summary.classes.items(), key=lambda item: (-item[1], item[0])):
            say(f"{count:9}  {name}")
        if summary.passages:
            say(
                "passages: "
                + ", ".join(f"{count} {name}" for name, count in sorted(summary.passages.items()))
            )
        if summary.exclusions:
            print(
                f"{len(summary.exclusions)} vehicles are no ego of a scene"
                + ("" if verbose else "; -v or index.json say why")
            )
        for exclusion in summary.exclusions if verbose else []:
            say(f"  {exclusion['recording']}: vehicle {exclusion['what']}: {exclusion['reason']}")
        if summary.unlit:
            say(f"{LIT} ({many(summary.unlit, 'recording')})")
        if summary.removed:
            print(f"{len(summary.removed)} files of an earlier run were removed")
    for name in summary.colliding:
        say(
            f"{NAME}: {name}: the ego touches another one from the start, as it was recorded",
            to=sys.stderr,
        )
    for name, reason in summary.unplayable.items():
        say(f"{NAME}: {name} is left out: {reason}", to=sys.stderr)
    if summary.inconclusive and not quiet:
        name, reason = next(iter(summary.inconclusive.items()))
        several = many(len(summary.inconclusive), "replay has", "replays have")
        first = f"{name} first: {reason}; index.json says why"
        say(f"{NAME}: {several} no verdict as recorded, {first}", to=sys.stderr)
    for name in summary.edited:
        say(f"{NAME}: {name} was edited since it was written, it is left as it is", to=sys.stderr)
    for name, reason in summary.repaired.items() if not quiet else ():
        say(f"{NAME}: {name} was repaired: {reason}", to=sys.stderr)
    for name, doubts in summary.doubtful.items():
        say(f"{NAME}: {name}: {doubts}", to=sys.stderr)
    _print_skipped(summary.skipped, quiet)
    for error in summary.failures.values():
        say(f"{NAME}: {error}", to=sys.stderr)
    return max((error.exit_code for error in summary.failures.values()), default=0)


@protected("max_runs")
@with_settings
def inspect(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...", help="Recordings: files, or folders with all below them."
        ),
    ],
    given: RecordingOptions,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print a JSON object for each recording, one a line.")
    ] = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Check whether recordings are possible: a verdict for each (fit, repaired, refused), a quality
    from 0 to 1, and reasons.

    Checked are the step of the clock against speeds and places, speeds by category, overlaps of
    vehicles, missing frames, ids used twice, sizes, headings, and the map: the share of places on
    lanes and against the traffic. `catalogue` checks the same and refuses what is refused here
    (exit code 3).
    """
    from recognition.catalogue.recordings import inspected
    from recognition.recordings.intake import REFUSED
    from recognition.recordings.source import forget, listed, opened

    forget()
    code = 0
    for source in opened(tuple(paths), given.network, given.columns):
        found = inspected(source)
        code = 3 if found.verdict == REFUSED else code
        if as_json:
            say(found.as_json())
        else:
            say(f"{found.verdict:8}  {found.quality:.3f}  {found.name} ({found.format})")
            for reason in () if quiet else found.reasons:
                say(f"          {reason}")
    data_sets = listed(tuple(paths), given.columns)
    _print_skipped([file for data_set in data_sets for file in data_set.skipped], quiet)
    raise typer.Exit(code)


# findings first, scenarios on demand ------------------------------------------------------------


@protected("max_runs")
@with_settings
def find(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...", help="Recordings: files, or folders with all below them."
        ),
    ],
    out: Annotated[
        str, WRITTEN, typer.Option(metavar="DIR|URL", help="Store of the findings: folder or URL.")
    ],
    given: RecordingOptions,
    sorting: Sorting,
    scenes: Scenes = "events",
    keep_model: KeepModel = None,
    discover: Discover = False,
    jobs: Jobs = 1,
    ray: Ray = None,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Find scenarios in any number of recordings, without writing any of them.

    Findings are rows of Parquet with the columns of a catalogue's index, in folders by site and
    day, beside a table of the recordings with their exposure. The store may be on any file system
    that pyarrow reaches, as s3://bucket/findings. 'xosc-list STORE --where "..."' asks it,
    'xosc-recognize write STORE --where "..."' writes scenarios. The same command adds what is new.
    """
    from recognition.catalogue import findings
    from recognition.catalogue.recordings import CatalogueSettings
    from recognition.labels import Rules
    from runner.batch.pool import Workers

    rules = Rules(signalised=sorting.signalised)
    settings = CatalogueSettings(scenes, given.network, given.columns, rules)
    with _labelling(sorting, discover, keep_model, quiet) as recogniser:
        bar = partial(progress_bar, quiet=quiet)
        found = findings.find(paths, out, settings, bar, Workers(jobs, ray), recogniser)
    if not quiet:
        print(f"{'findings':>9}  class" if found.classes else "nothing new was found")
        for name, count in sorted(found.classes.items(), key=lambda item: (-item[1], item[0])):
            say(f"{count:9}  {name}")
        if found.excluded:
            print(f"{found.excluded} vehicles are no ego of a scene")
        before = f", {found.before:,} were in it" if found.before else ""
        say(f"{many(found.read, 'recording')} added to {out}{before}")
    _print_skipped(found.skipped, quiet)
    for error in found.failures.values():
        say(f"{NAME}: {error}", to=sys.stderr)
    raise typer.Exit(max((error.exit_code for error in found.failures.values()), default=0))


@protected("max_runs")
@with_settings
def write(
    store: Annotated[
        str,
        READ,
        typer.Argument(metavar="STORE", help="Findings: folder or URL of 'xosc-recognize find'."),
    ],
    out: Annotated[Path, out_folder("Folder of the catalogue.")],
    form: ScenarioFormat,
    where: Annotated[
        str | None,
        typer.Option(
            metavar="CONDITION",
            help="Findings that meet this condition only, as "
            "\"class = 'urban cut in' and gap < 9\".",
        ),
    ] = None,
    jobs: Jobs = 1,
    ray: Ray = None,
    verbose: Talkative = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Write a catalogue of those findings in a store that meet a condition.

    Conditions are those of 'xosc-list --where'. Recordings are read again from where they were.
    A catalogue of some findings has no exposure.
    """
    from recognition.catalogue import findings
    from recognition.catalogue.recordings import CatalogueSettings
    from recognition.catalogue.writing.write import CatalogueConfig
    from runner.batch.pool import Workers

    settings = CatalogueSettings(config=CatalogueConfig(version=form.version))
    bar = partial(progress_bar, quiet=quiet)
    summary = findings.write(store, out, where, settings, bar, Workers(jobs, ray))
    code = _report(summary, verbose, quiet)
    if not quiet and summary.classes:
        say(f"catalogue: {out}")
    raise typer.Exit(code)


# recordings of our own, and the application -----------------------------------------------------


@protected("max_runs")
@interruptible("xosc-recognize record")
def record(
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            callback=writable_folder,
            help="Folder for the recordings, one folder in it for each site.",
        ),
    ],
    scale: Annotated[
        float,
        typer.Option(metavar="FACTOR", help="How much: 1 gives about 2,600 events of each class."),
    ] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    site: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this site (repeatable).")
    ] = None,
    families: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="So many sites drawn from the seed instead, with a minute of traffic each.",
        ),
    ] = 0,
    jobs: Jobs = 1,
    _verbose: Verbose = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress bar and no summary.")
    ] = False,
    _version: Version = False,
) -> None:
    """Record SUMO's traffic on maps of our own, in the formats of highD
    (motorways) and INTERACTION (all else).
    """
    from rich.console import Console
    from rich.progress import Progress

    from recognition.recorder import record as record_traffic

    with Progress(
        console=Console(stderr=True), disable=quiet or not sys.stderr.isatty(), transient=True
    ) as bar:
        task = bar.add_task("Recording", total=None)
        found = record_traffic(
            out, scale=scale, seed=seed, sites=site, jobs=jobs, families=families,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )  # fmt: skip
    if not quiet:
        say(f"{len(found)} recordings in {out}")


_DEFAULT = "catalogue"
_EPILOG = (
    f"{NAME} PATH... --out DIR is short for {NAME} {_DEFAULT} PATH... --out DIR; a folder with "
    "the name of a command is given as "
    f"./NAME, or after {_DEFAULT}. Experiments: python -m studies.recognition. "
) + exit_codes("all recordings are in the catalogue", "")
_FORMATS = ", ".join(packages.described("recognition.recordings.formats", "TITLE").values())
_CATALOGUE = f"{cleandoc(catalogue.__doc__ or '')}\n\nFormats of recordings: {_FORMATS}."


class _CatalogueByDefault(CommandGroup):
    """Takes arguments that name no command for those of `catalogue`."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """The arguments of the group; what is left are those of the command."""
        own = (*self.commands, *ctx.help_option_names, "--version", "--formats")
        return super().parse_args(ctx, args if args and args[0] in own else [_DEFAULT, *args])


app = new_app(NAME, _CatalogueByDefault)


def _print_formats(wanted: bool) -> None:
    if wanted:
        from recognition.recordings.source import formats

        say(*formats())
        raise typer.Exit


@app.callback(epilog=_EPILOG)
def xosc_recognize(
    _formats: Annotated[
        bool,
        typer.Option(
            "--formats",
            callback=_print_formats,
            is_eager=True,
            help="List the formats of recordings that are read.",
        ),
    ] = False,
    _version: Version = False,
) -> None:
    """Inspect recordings, make catalogues or replays of them, find and write scenarios, label runs,
    record traffic, train models; each has --help."""


app.command(_DEFAULT, help=_CATALOGUE)(catalogue)
app.command("find")(find)
app.command("inspect")(inspect)
app.command("label")(label)
app.command("record")(record)
app.command("replay")(replay)
app.command("train")(train)
app.command("write")(write)


def main() -> None:
    """Entry point."""
    guarded(NAME, partial(app, prog_name=NAME))


if __name__ == "__main__":
    main()
