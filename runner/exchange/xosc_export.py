"""The command `xosc-export`: scenarios and their runs for other tools."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runner.batch.options import Only, Param, Sample, selection_of
from runner.exchange.exports import GROUP, TARGETS, target_lines, target_of
from runner.judging.settings import RunSettings
from schemas.common.errors import ExitCode, InvalidFile, UsageError, exit_codes, gravest, nearest
from schemas.common.plugins import installed
from schemas.common.remarks import told_quietly
from schemas.common.terminal.command_line import (
    AllowInconclusive,
    Overwrite,
    Verbose,
    Version,
    epilog,
    guarded,
    new_app,
    out_folder,
    protected,
    say,
)
from schemas.common.terminal.files import complete_name
from schemas.common.terminal.options import READ, completed, parameters_of, with_settings
from schemas.common.terminal.text import shown

if TYPE_CHECKING:
    from runner.batch.jobs import Job
    from runner.exchange.exports import ExportTarget
    from runner.exchange.exports.exporting import Exported

_EXAMPLES = (
    "xosc-export simple_cut_in --to carla --out for_carla",
    "xosc-export --targets",
)
_EPILOG = exit_codes("all exported", "", "an exported run did not test what its file describes") + (
    " 4 also for a file with what the target cannot express. What each target keeps, changes and "
    "loses is told in docs/exports.md."
)

app = new_app()


def _print_targets(wanted: bool) -> None:
    if wanted:
        for name, source, summary in target_lines():
            print(f"{name:12}{source:10}{summary}")
        raise typer.Exit


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected()
@with_settings
def xosc_export(
    paths: Annotated[
        list[str],
        READ,
        typer.Argument(
            metavar="PATH...",
            autocompletion=complete_name,
            help="Scenarios, distributions, catalogues; folders, globs, names of shipped ones; "
            "results of runs.",
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            metavar="TARGET",
            autocompletion=completed(lambda: TARGETS),
            help=f"One of {', '.join(TARGETS)}.",
        ),
    ],
    out: Annotated[Path, out_folder("Folder to write into.")],
    settings: RunSettings,
    param: Param = None,
    only: Only = None,
    sample: Sample = None,
    overwrite: Overwrite = False,
    allow_inconclusive: AllowInconclusive = False,
    _verbose: Verbose = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print what is not exported or inconclusive only.")
    ] = False,
    _targets: Annotated[
        bool,
        typer.Option("--targets", callback=_print_targets, is_eager=True, help="List all targets."),
    ] = False,
    _version: Version = False,
) -> None:
    """Export OpenSCENARIO files, or runs of them, to what other tools read."""
    from runner.batch.journal import run_settings
    from runner.exchange.exports.exporting import export_documents, export_jobs, export_runs
    from xosc.exports.draft import Folder

    target = target_of(to)
    if target is None:
        raise UsageError(
            f"there is no target {to!r}; {nearest(to, (*TARGETS, *installed(GROUP)))} (--targets "
            "explains them)"
        )
    recorded = _recorded(paths, target)
    sources = _sources(paths) if not recorded else []
    selection = selection_of(only, sample, settings.seed, sources)
    exports: Iterator[Exported]
    if recorded:
        folder = Folder(out, overwrite)
        exports = chain.from_iterable(
            export_jobs(jobs, target, folder, run_settings(batch)) for batch, jobs in recorded
        )
    elif target.of_run:
        exports = export_runs(
            sources, target, Folder(out, overwrite), settings, parameters_of(param or []), selection
        )
    elif param:
        raise UsageError(f"--param is for runs, and {to} is written without one")
    else:
        exports = export_documents(sources, target, Folder(out, overwrite), settings, selection)
    code = _tell(exports, sources, quiet, out)
    raise typer.Exit(
        ExitCode.PASSED if allow_inconclusive and code == ExitCode.INCONCLUSIVE else code
    )


def _recorded(paths: list[str], target: ExportTarget) -> list[tuple[Path, list[Job]]]:
    """Batches and their runs that paths stand for, where all do and runs are exported.

    Runs are not read but made again, by the settings of their batch: targets need more than is
    recorded.
    """
    from runner.batch.journal import jobs_at

    found = [jobs_at(Path(path)) for path in paths] if target.of_run else []
    return found if all(jobs for _, jobs in found) else []


def _sources(paths: list[str]) -> list[Path]:
    """Expand the given names; roads only if they are named themselves, since scenarios take theirs
    along."""
    from runner.batch import journal
    from schemas.common.terminal.files import expand

    for path in paths:
        if journal.repeated_by(Path(path)):
            told = (
                "results of runs are here, which targets of runs alone export; one with the "
                "values of a run is written by "
            )
            raise UsageError(f"{told}xosc new scenario NAME --like FILE -p NAME=VALUE", path=path)
    return [path for path in expand(paths) if path.suffix.lower() != ".xodr" or str(path) in paths]


def _tell(exports: Iterator[Exported], sources: Sequence[Path], quiet: bool, out: Path) -> int:
    """Print exports as they are done, and where they are; the exit code.

    Raises:
        InvalidFile: there are none, as all files are catalogues.
    """
    code, counts = 0, {True: 0, False: 0}
    for name, exit_code, remarks, trace, untested in exports:
        done = exit_code in (ExitCode.PASSED, ExitCode.INCONCLUSIVE)
        counts[done] += 1
        code = gravest((code, exit_code))
        if not done:
            reason = "; ".join(remarks)
            told = (
                reason if reason.startswith(f"{name}:") else f"{name}: {reason}"
            )  # errors in a file name it, and the line
            say(*trace.splitlines(), f"xosc-export: not exported: {told}", to=sys.stderr)
        elif untested:
            say(
                f"xosc-export: {name}: exported, but inconclusive: {'; '.join(shown(untested))}",
                to=sys.stderr,
            )
        if done and quiet and (repaired := told_quietly(remarks)):
            say(f"xosc-export: {name}: exported; {repaired}", to=sys.stderr)
        elif done and not quiet:
            say(f"{name}: exported", *(f"  {remark}" for remark in remarks))
    if not sum(counts.values()):
        more = f" (and {len(sources) - 1} more)" if len(sources) > 1 else ""
        told = (
            "this is a catalog, nothing in it can be run: its entries are part of the scenarios "
            "that use them"
        )
        raise InvalidFile(told + more, path=sources[0])
    if sum(counts.values()) > 1 and not quiet:
        print(f"{counts[True]} exported, {counts[False]} not")
    if counts[True] and not quiet:
        say(f"files: {out}")
    return code


def main() -> None:
    """Entry point."""
    guarded("xosc-export", app)


if __name__ == "__main__":
    main()
