"""The command `xosc-recognize`: recordings become catalogues of scenarios; further commands record, train, evaluate and label."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.commands.options import Verbose, Version, guarded, interruptible, new_app, out_folder
from schemas.errors import UsageError

if TYPE_CHECKING:
    from recognition.catalogue.pipeline import Progress, Recogniser, Settings, Summary
    from recognition.datasets import Source
    from xosc.versions import Version as Standard

COMMANDS = {
    "record": ("recognition.recorder.command", "make recordings of SUMO's traffic on maps of our own"),
    "train": ("recognition.training.command", "train a model on recordings"),
    "evaluate": ("recognition.study.protocol.command", "evaluate TRFE and its baselines on recordings"),
    "label": ("recognition.cli", "label the results of xosc-run, and the scenarios that they are of"),
}
"""Further commands: the module that has a function of the command's name, and what it does. Imported when they are asked for."""

NAME = "xosc-recognize"
_EPILOG = (
    "Further commands, each with --help: "
    + "; ".join(f"{NAME} {name}: {does}" for name, (_, does) in COMMANDS.items())
    + ". Exit codes: 0 all recordings are in the catalogue, 2 wrong usage, 3 a recording is invalid, 4 one asks for what is "
    "not done here, 5 internal error."
)

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Labels = Annotated[
    Literal["auto", "model", "rules"], typer.Option(help="Who labels: a model (auto: where one is shipped), or the rules alone.")
]
Model = Annotated[Path | None, typer.Option(metavar="DIR", help="Model to label by.  [default: the one shipped]")]
Signalised = Annotated[bool, typer.Option("--signalised", help="Let the rules count junctions with traffic lights as well.")]


def recognise(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Recordings: files, or folders with all below them.")],
    out: Annotated[Path, out_folder("Folder of the catalogue.")],
    scenes: Annotated[Literal["events", "vehicles"], typer.Option(help="What a scenario is made for.")] = "events",
    labels: Labels = "auto",
    model: Model = None,
    keep_model: Annotated[
        Path | None, out_folder("Folder for the model as it is afterwards, to label more recordings by.")
    ] = None,
    signalised: Signalised = False,
    standard: Annotated[Literal["1.0", "1.1", "1.2", "1.3"], typer.Option(help="Version of OpenSCENARIO.")] = "1.3",
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print more, and tracebacks of errors.")] = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Recognise scenarios in recordings (highD, INTERACTION, CommonRoad, NGSIM, results of xosc-run), write a catalogue of them.

    A folder for each class: scenarios that replay what was recorded, the same as parametrised manoeuvres, the OpenSCENARIO
    catalogues that they use, and OpenLABEL tags; beside them the roads and an index. Files that a person has edited stay.
    A model that is kept knows the classes that it discovered, by the names that they have in the catalogue.
    """
    from recognition.catalogue.pipeline import build
    from recognition.catalogue.recognisers.model import ByModel

    settings, recogniser = _settings(scenes, signalised, standard), _recogniser(labels, model, quiet)
    if keep_model and not isinstance(recogniser, ByModel):
        raise UsageError("--keep-model is for a model that labels; rules learn nothing")
    with interruptible(NAME):
        summary = build(paths, out, settings, recogniser, _progress(quiet))
        if keep_model and isinstance(recogniser, ByModel):
            recogniser.keep(keep_model)
        code = _report(summary, verbose, quiet)
    raise typer.Exit(code)


def label(
    folder: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="Results of xosc-run --out.")],
    labels: Labels = "auto",
    model: Model = None,
    signalised: Signalised = False,
    in_place: Annotated[bool, typer.Option("--in-place", help="Write the tags into the scenarios themselves.")] = False,
    _verbose: Verbose = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Label the results of runs, and annotate the scenarios that they are of.

    Beside each scenario come an annotated copy and OpenLABEL tags; labels.json beside the results tells what was found when.
    """
    from recognition.catalogue.labelling import label_runs

    settings = _settings("events", signalised, "1.3")
    with interruptible(NAME):
        labelled = label_runs(folder, settings, _recogniser(labels, model, quiet), _progress(quiet), in_place=in_place)
        if not quiet:
            for name, found in labelled.findings.items():
                for each in found:
                    moment = each.moment
                    print(f"{name}: {moment.title} of {moment.ego} at {moment.time:.2f} s")
            for path in labelled.written:
                print(f"written: {path}")
        for path in labelled.edited:
            print(f"{NAME}: {path} was edited since it was written, it is left as it is", file=sys.stderr)


def _settings(scenes: str, signalised: bool, standard: str) -> Settings:
    from recognition.catalogue.pipeline import Settings
    from recognition.catalogue.writing.catalogue import Config
    from recognition.labels import Rules

    major, minor = map(int, standard.split("."))
    wanted: Standard = (major, minor)
    return Settings(scenes=scenes, rules=Rules(signalised=signalised), config=Config(version=wanted))


def _recogniser(labels: str, model: Path | None, quiet: bool) -> Recogniser:
    """Who labels; the rules where no model is shipped and none is asked for."""
    from recognition.catalogue.pipeline import SHIPPED, ByRules

    if labels == "rules" and model is not None:
        raise UsageError("--model and --labels rules exclude each other")
    folder = model or SHIPPED
    if labels == "rules" or (labels == "auto" and model is None and not folder.is_dir()):
        if labels == "auto" and not quiet:
            print("no model is shipped: the rules label alone", file=sys.stderr)
        return ByRules()
    from recognition.catalogue.recognisers.model import load

    return load(folder)


def _progress(quiet: bool) -> Progress:
    """A bar on standard error, where that is a terminal."""

    def plain(sources: Sequence[Source], doing: str) -> Iterable[Source]:
        return sources

    def bar(sources: Sequence[Source], doing: str) -> Iterable[Source]:
        from rich.console import Console
        from rich.progress import track

        return track(sources, doing, total=len(sources), console=Console(stderr=True), transient=True)

    return plain if quiet or not sys.stderr.isatty() else bar


def _report(summary: Summary, verbose: bool, quiet: bool) -> int:
    """Print what was made; the exit code."""
    if not quiet:
        print(f"{'scenarios':>9}  class" if summary.classes else "no scenario was recognised")
        for name, count in sorted(summary.classes.items(), key=lambda item: (-item[1], item[0])):
            print(f"{count:9}  {name}")
        if summary.passages:
            print("passages: " + ", ".join(f"{count} {name}" for name, count in sorted(summary.passages.items())))
        if summary.exclusions:
            print(f"{len(summary.exclusions)} vehicles are no ego of a scene" + ("" if verbose else "; -v or index.json say why"))
        for exclusion in summary.exclusions if verbose else []:
            print(f"  {exclusion['recording']}: vehicle {exclusion['what']}: {exclusion['reason']}")
        if summary.removed:
            print(f"{len(summary.removed)} files of an earlier run were removed")
    for name in summary.edited:
        print(f"{NAME}: {name} was edited since it was written, it is left as it is", file=sys.stderr)
    for error in summary.failures.values():
        print(f"{NAME}: {error}", file=sys.stderr)
    return max((error.exit_code for error in summary.failures.values()), default=0)


def app_of(name: str | None = None) -> typer.Typer:
    """The app of a further command; without a name, of the one for catalogues."""
    app = new_app()
    if name is None:
        app.command(NAME, epilog=_EPILOG)(recognise)
    else:
        module, _ = COMMANDS[name]
        app.command(f"{NAME} {name}")(getattr(import_module(module), name))
    return app


def _run() -> None:
    """The command that the first argument names, else that for catalogues."""
    name, *rest = sys.argv[1:] or [""]
    if name in COMMANDS:
        app_of(name)(args=rest, prog_name=f"{NAME} {name}")
    else:
        app_of()(prog_name=NAME)


def main() -> None:
    """Entry point."""
    guarded(NAME, _run)


if __name__ == "__main__":
    main()
