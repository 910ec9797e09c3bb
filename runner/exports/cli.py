"""The command `xosc-export`: scenarios and their runs for other tools."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.exports import TARGETS
from runner.run_options import Only, Param, Sample, selection_of, with_run_settings
from runner.settings import RunSettings
from schemas.commands.options import Verbose, Version, guarded, interruptible, new_app, out_folder, parameters_of
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.exports.exporting import Exported

_EPILOG = (
    "Exit codes: 0 all exported, 2 wrong usage, 3 invalid file, 4 a file says what the target cannot say; with several files "
    "the gravest. What each target keeps, changes and loses is told in docs/exports.md."
)
_GRAVEST_FIRST = (5, 3, 4, 2, 0)

app = new_app()


def _print_targets(wanted: bool) -> None:
    if wanted:
        for target in TARGETS.values():
            print(f"{target.name:12}{'a run' if target.of_run else 'the file':10}{target.summary}")
        raise typer.Exit


@app.command(epilog=_EPILOG)
@with_run_settings("fail_if")
def xosc_export(
    paths: Annotated[list[str], typer.Argument(metavar="PATH...", help="Scenarios, distributions, catalogues; folders, globs.")],
    to: Annotated[str, typer.Option(metavar="TARGET", help=f"One of {', '.join(TARGETS)}.")],
    out: Annotated[Path, out_folder("Folder to write into; nothing in it is overwritten.")],
    settings: RunSettings,
    param: Param = None,
    only: Only = None,
    sample: Sample = None,
    _verbose: Verbose = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print what is not exported only.")] = False,
    _targets: Annotated[
        bool, typer.Option("--targets", callback=_print_targets, is_eager=True, help="List all targets.")
    ] = False,
    _version: Version = False,
) -> None:
    """Export OpenSCENARIO files, or runs of them, to what other tools read."""
    from runner.exports.exporting import export_documents, export_runs
    from xosc.exports.folder import Folder

    target = TARGETS.get(to)
    if target is None:
        raise UsageError(f"there is no target {to!r}, only {', '.join(TARGETS)}")
    sources, selection = _sources(paths), selection_of(only, sample, settings.seed)
    if target.of_run:
        exports = export_runs(sources, target, Folder(out), settings, parameters_of(param or []), selection)
    elif param:
        raise UsageError(f"--param is for runs, and {to} is written without one")
    else:
        exports = export_documents(sources, target, Folder(out), settings, selection)
    with interruptible("xosc-export"):
        raise typer.Exit(_tell(exports, quiet))


def _sources(paths: list[str]) -> list[Path]:
    """The files meant; roads, which are taken along by the scenarios on them, only where they are named themselves."""
    from schemas.commands.files import expand

    return [path for path in expand(paths) if path.suffix.lower() != ".xodr" or str(path) in paths]


def _tell(exports: Iterator[Exported], quiet: bool) -> int:
    """Print exports as they are done; the exit code.

    Raises:
        UsageError: there are none.
    """
    code, counts = 0, {True: 0, False: 0}
    for name, exit_code, remarks in exports:
        done = exit_code == 0
        counts[done] += 1
        code = min(code, exit_code, key=_GRAVEST_FIRST.index)
        if not done:
            reason = "; ".join(remarks)
            told = reason if reason.startswith(f"{name}:") else f"{name}: {reason}"  # errors in a file name it, and the line
            print(f"xosc-export: not exported: {told}", file=sys.stderr, flush=True)
        elif not quiet:
            print("\n  ".join([f"{name}: exported", *remarks]), flush=True)
    if not sum(counts.values()):
        raise UsageError("nothing here can be run: the entries of catalogues are part of the scenarios that use them")
    if sum(counts.values()) > 1 and not quiet:
        print(f"{counts[True]} exported, {counts[False]} not")
    return code


def main() -> None:
    """Entry point."""
    guarded("xosc-export", app)


if __name__ == "__main__":
    main()
