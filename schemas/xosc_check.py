"""The command `xosc-check`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from schemas.checks import LEVELS, Problem
from schemas.common.errors import ExitCode, InvalidFile, UsageError, exit_codes
from schemas.common.packages import offered
from schemas.common.storage import MAX_BYTES
from schemas.common.terminal.command_line import (
    CatalogPath,
    RoadPath,
    Version,
    deliver,
    epilog,
    guarded,
    new_app,
    progress_bar,
    protected,
    say,
)
from schemas.common.terminal.options import READ, WRITTEN
from schemas.common.terminal.text import one_line

_STYLES = {"error": "bold red", "warning": "yellow", "info": "cyan"}
_EXAMPLES = (
    "xosc-check xosc/library xodr/library",
    "xosc-check --format sarif --output check.sarif xosc/library",
    "xosc-check --triage --format html --output triage.html scenarios",
)
_EPILOG = (
    exit_codes("all files are accepted (no error; with --strict no warning either)", "some are not")
    + " Repaired files are written by xosc-export --to VERSION, roads by xosc-road repair."
)

_CHECKED, _TRIAGED = ("text", "json", "junit", "xqar", "sarif"), ("text", "json", "html")
"""Formats without --triage, and with it"""

_PIPE, _HEAD = "-", 4096
"""Name of standard input, and the bytes of a file that show its standard"""

app = new_app()


def _print_rules(requested: bool) -> None:
    if requested:
        from schemas.checks.osi import all_osi_rules
        from schemas.checks.registry import all_rules
        from schemas.checks.report import listing

        print(listing([*all_rules(), *all_osi_rules()]), end="")
        raise typer.Exit


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
def xosc_check(
    paths: Annotated[
        list[str],
        READ,
        typer.Argument(
            metavar="PATH...",
            help="Files, folders with all below, globs, names of shipped scenarios; "
            "- is standard input.",
        ),
    ],
    format: Annotated[
        Literal["text", "json", "junit", "xqar", "sarif", "html"],
        typer.Option(help="Format of the report; html of --triage."),
    ] = "text",
    output: Annotated[
        Path | None, WRITTEN, typer.Option(metavar="FILE", help="Write the report to a file.")
    ] = None,
    severity: Annotated[
        Literal["error", "warning", "info"],
        typer.Option(help="Least severe level that is reported."),
    ] = "info",
    strict: Annotated[
        bool, typer.Option("--strict", help="Do not accept files with warnings.")
    ] = False,
    triage: Annotated[
        bool,
        typer.Option(
            "--triage",
            help="Load the files too, and group them: fine, plays with repairs, refused by cause.",
        ),
    ] = False,
    road_path: RoadPath = None,
    catalog_path: CatalogPath = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Name the sound files as well.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No summary and no progress.")
    ] = False,
    _rules: Annotated[
        bool, typer.Option("--rules", callback=_print_rules, is_eager=True, help="List all rules.")
    ] = False,
    _version: Version = False,
) -> None:
    """Check OpenSCENARIO and OpenDRIVE files against the official schemas and semantic rules, OSI
    traces against OSI's rules."""
    from schemas.checks.checker import check_many
    from schemas.common.terminal.files import expand

    piped = _piped() if _PIPE in paths else {}
    if piped and triage:
        raise UsageError("--triage plays files, and standard input is none")
    files = [*expand(path for path in paths if path != _PIPE), *piped]
    # A missing file has exit code 3, as in all commands; it is listed as a problem, too.
    missing = any(not os.path.lexists(path) for path in files if path not in piped)
    if triage != (format in _TRIAGED) and format not in ("text", "json"):
        which = ", ".join(_TRIAGED if triage else _CHECKED)
        raise UsageError(f"{'with' if triage else 'without'} --triage, --format is one of {which}")
    if triage:
        some = _triaged(files, catalog_path or (), road_path or (), format, output, quiet)
        raise typer.Exit(
            ExitCode.INVALID if missing else ExitCode.FINDING if some else ExitCode.PASSED
        )
    checked = check_many(files, catalog_path or (), road_path or (), piped)
    results = _progressing(checked, len(files), shown=not quiet and sys.stderr.isatty())
    refused = {"error", "warning"} if strict else {"error"}
    failed = any(problem.level in refused for _, problems in results for problem in problems)
    reported = LEVELS[: LEVELS.index(severity) + 1]
    # After the verdict: --severity hides problems, it does not accept files.
    results = [
        (path, [problem for problem in problems if problem.level in reported])
        for path, problems in results
    ]
    if format == "text" and output is None:
        _print(results, verbose=verbose, quiet=quiet)
    else:
        _write(results, format, output, quiet)
    raise typer.Exit(
        ExitCode.INVALID if missing else ExitCode.FINDING if failed else ExitCode.PASSED
    )


def _triaged(
    paths: Sequence[Path],
    catalog_path: Sequence[str],
    road_path: Sequence[str],
    format: str,
    output: Path | None,
    quiet: bool,
) -> bool:
    """Write the triage of files; whether one is refused."""
    try:
        module = offered("triage")
    except KeyError:
        told = "--triage plays files, which needs the whole toolchain: call xosc-check"
        raise UsageError(told) from None
    with progress_bar("trying", len(paths), quiet) as advance:
        triaged = []
        for file in module.triage(paths, catalog_path, road_path):
            triaged.append(file)
            advance(1)
    deliver(module.FORMATS[format](triaged), "the triage", output)
    if output is not None and not quiet:
        print(module.summary(triaged))
        say(f"triage: {output}")
    return any(file.group == module.REFUSED for file in triaged)


def _piped() -> dict[Path, bytes]:
    """Content of standard input, by a name that says its standard.

    Raises:
        InvalidFile: it is larger than a file may be.
    """
    # One byte beyond the limit shows that the input is larger.
    content = sys.stdin.buffer.read(MAX_BYTES + 1)
    # By its root element: what comes through a pipe has no ending.
    name = Path("stdin.xodr" if b"<OpenDRIVE" in content[:_HEAD] else "stdin.xosc")
    if len(content) > MAX_BYTES:
        raise InvalidFile(f"at most {MAX_BYTES} bytes are read", path=name)
    return {name: content}


def _progressing(
    checked: Iterable[tuple[Path, list[Problem]]], total: int, shown: bool
) -> list[tuple[Path, list[Problem]]]:
    """Return all results, with a bar while they are made."""
    if shown:
        from rich.console import Console
        from rich.progress import track

        checked = track(
            checked, "checking", total=total, console=Console(stderr=True), transient=True
        )
    return list(checked)


def _print(results: Sequence[tuple[Path, list[Problem]]], verbose: bool, quiet: bool) -> None:
    """The report for people; in colours on a terminal."""
    from schemas.checks import report

    # Without rich, of which a pipe has no use.
    if not sys.stdout.isatty():
        sound = (
            one_line(f"{path}: accepted") for path, problems in results if verbose and not problems
        )
        lines = [*sound, *report.text(results).splitlines()]
        print(
            "\n".join(lines[:-1] if quiet else lines), end="\n" if not quiet or lines[:-1] else ""
        )
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(soft_wrap=True, highlight=False)
    for path, problems in results:
        if verbose and not problems:
            console.print(Text.assemble(one_line(str(path)), ": ", ("accepted", "green")))
        for problem in problems:
            place = one_line(str(path) if problem.line is None else f"{path}:{problem.line}")
            level = (problem.level, _STYLES[problem.level])
            console.print(
                Text.assemble(
                    (place, "bold"),
                    ": ",
                    level,
                    f": {one_line(problem.message)} ",
                    (f"[{problem.rule}]", "dim"),
                )
            )
    if not quiet:
        console.print(Text(report.summary(results)))


def _write(
    results: Sequence[tuple[Path, list[Problem]]], format: str, output: Path | None, quiet: bool
) -> None:
    from schemas.checks import report

    deliver(report.FORMATS[format](results), "the report", output)
    if output is not None and not quiet:
        print(report.summary(results))
        say(f"report: {output}")


def main() -> None:
    """Entry point."""
    guarded("xosc-check", app, traced=False)


if __name__ == "__main__":
    main()
