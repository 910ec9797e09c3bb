"""`xosc-recognize catalogue` and `xosc-recognize label`: scenarios of recordings, labels of runs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.commands.options import Verbose, Version, interruptible, out_folder, progress_bar
from schemas.errors import UsageError

if TYPE_CHECKING:
    from recognition.catalogue.pipeline import Recogniser, Summary
    from recognition.catalogue.stages import CatalogueSettings
    from xosc.versions import Version as Standard

NAME = "xosc-recognize"

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Labels = Annotated[
    Literal["auto", "model", "rules"],
    typer.Option(
        help="Who sorts: the model where it states good enough figures for sites not seen, else the rules, with its labels beside"
        " theirs (auto); the model in any case; or the rules, without a model."
    ),
]
Model = Annotated[Path | None, typer.Option(metavar="DIR", help="Model to label by.  [default: the one shipped]")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")]
Ray = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Read and write on this Ray cluster; 'local' starts one of --jobs processes here."),
]
Signalised = Annotated[bool, typer.Option("--signalised", help="Let the rules count junctions with traffic lights as well.")]


def catalogue(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Recordings: files, or folders with all below them.")],
    out: Annotated[Path, out_folder("Folder of the catalogue.")],
    scenes: Annotated[Literal["events", "vehicles"], typer.Option(help="What a scenario is made for.")] = "events",
    labels: Labels = "auto",
    model: Model = None,
    keep_model: Annotated[
        Path | None, out_folder("Folder for the model as it is afterwards, to label more recordings by.")
    ] = None,
    signalised: Signalised = False,
    jobs: Jobs = 1,
    ray: Ray = None,
    standard: Annotated[Literal["1.0", "1.1", "1.2", "1.3"], typer.Option(help="Version of OpenSCENARIO.")] = "1.3",
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print more, and tracebacks of errors.")] = False,
    quiet: Quiet = False,
    _version: Version = False,
) -> None:
    """Recognise scenarios in recordings and write a catalogue of them.

    A folder for each class: scenarios that replay what was recorded, the same as parametrised manoeuvres, the OpenSCENARIO
    catalogues that they use, and OpenLABEL tags; beside them the roads and an index. Files that a person has edited stay.
    A model that is kept knows the classes that it discovered, by the names that they have in the catalogue. Bytes are the same
    for any number of processes, and after an interruption the same command reads only recordings that were not read yet.
    """
    from recognition.catalogue.beside import Workers
    from recognition.catalogue.pipeline import ByRules, build

    settings, (made, note) = _settings(scenes, signalised, standard), _recogniser(labels, model)
    if keep_model and made is ByRules:
        raise UsageError("--keep-model is for a model that labels; rules learn nothing")
    recogniser = cache(made)
    with interruptible(NAME):
        summary = build(paths, out, settings, recogniser, partial(progress_bar, quiet=quiet), Workers(jobs, ray))
        if keep_model:
            from recognition.catalogue.recognisers.model import ByModel

            model_after = recogniser()
            assert isinstance(model_after, ByModel), "rules were refused"
            model_after.keep(keep_model)
        _print_note(note, quiet)
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

    Beside each scenario come an annotated copy and OpenLABEL tags; labels.json beside the results lists what was found when.
    """
    from recognition.catalogue.labelling import label_runs

    settings, (recogniser, note) = _settings("events", signalised, "1.3"), _recogniser(labels, model)
    with interruptible(NAME):
        labelled = label_runs(folder, settings, recogniser(), partial(progress_bar, quiet=quiet), in_place=in_place)
        _print_note(note, quiet)
        if not quiet:
            for name, found in labelled.findings.items():
                for each in found:
                    moment = each.moment
                    print(f"{name}: {moment.title} of {moment.ego} at {moment.time:.2f} s")
            for path in labelled.written:
                print(f"written: {path}")
        for path in labelled.edited:
            print(f"{NAME}: {path} was edited since it was written, it is left as it is", file=sys.stderr)


def _settings(scenes: str, signalised: bool, standard: str) -> CatalogueSettings:
    from recognition.catalogue.stages import CatalogueSettings
    from recognition.catalogue.writing.chapter import CatalogueConfig
    from recognition.labels import Rules

    major, minor = map(int, standard.split("."))
    version: Standard = (major, minor)
    return CatalogueSettings(scenes=scenes, rules=Rules(signalised=signalised), config=CatalogueConfig(version=version))


def _recogniser(labels: str, model: Path | None) -> tuple[Callable[[], Recogniser], str]:
    """Makes who labels and sorts; and why that is not the model, where it is not and was not asked for."""
    from recognition.catalogue.pipeline import SHIPPED, ByRules
    from recognition.catalogue.recognisers.findings import MODEL, RULES
    from recognition.catalogue.recognisers.trust import objection, unseen_sites

    if labels == "rules" and model is not None:
        raise UsageError("--model and --labels rules exclude each other")
    folder = model or SHIPPED
    if labels == "rules":
        return ByRules, ""
    if labels == "auto" and model is None and not folder.is_dir():
        return ByRules, "no model is shipped: the rules label alone"
    if not folder.is_dir():
        raise UsageError("there is no model in this folder; --labels rules needs none", path=folder)
    why = objection(unseen_sites(folder))
    sorts = labels == "model" or why is None
    return partial(_by_model, folder, sorts), f"scenarios are sorted by the {MODEL if sorts else RULES}: {why}" if why else ""


def _by_model(folder: Path, sorts: bool) -> Recogniser:
    """Labels by a model; what that takes is imported here only, which is seconds."""
    from recognition.catalogue.recognisers.model import load

    return load(folder, sorts=sorts)


def _print_note(note: str, quiet: bool) -> None:
    if note and not quiet:
        print(f"{NAME}: {note}", file=sys.stderr)


def _report(summary: Summary, verbose: bool, quiet: bool) -> int:
    """Print what was made; the exit code."""
    if not quiet:
        unread = f": {len(summary.failures)} recordings could not be read" if summary.failures else ""
        print(f"{'scenarios':>9}  class" if summary.classes else f"no scenario was recognised{unread}")
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
    for name in summary.colliding:
        print(f"{NAME}: {name}: the ego touches another one from the start, as it was recorded", file=sys.stderr)
    for name in summary.edited:
        print(f"{NAME}: {name} was edited since it was written, it is left as it is", file=sys.stderr)
    for error in summary.failures.values():
        print(f"{NAME}: {error}", file=sys.stderr)
    return max((error.exit_code for error in summary.failures.values()), default=0)
