"""What all commands share: their app and common options, errors as one line and an exit code, interruptions, progress bars."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperGroup
from typer.models import OptionInfo

from schemas.errors import ToolchainError, UsageError, describe
from schemas.extras import missing
from schemas.packages import version
from schemas.storage import writing

Bar = Callable[[str, int], AbstractContextManager[Callable[[float], None]]]
"""Shows progress: takes a description and the number of steps, gives a function to call with how many more of them are done."""
INTERRUPTED, PIPE_CLOSED = 130, 141
"""Exit codes that shells give to what SIGINT and SIGPIPE have ended"""
_DIGITS = 6


def new_app(name: str | None = None, group: type[TyperGroup] = TyperGroup) -> typer.Typer:
    """An app that leaves errors to its caller, and prints plain text; with a name and a group where it has subcommands."""
    return typer.Typer(
        name=name,
        cls=group,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )


def _print_version(context: typer.Context, requested: bool) -> None:
    if requested:
        names = [each.command.name for each in (context.parent, context) if each is not None]
        print(f"{' '.join(filter(None, names))} {version()}")
        raise typer.Exit


RoadPath = Annotated[
    list[str] | None,
    typer.Option(
        "--road-path",
        metavar="DIR",
        help="Folder with road networks that are not where the scenario says (repeatable; also XOSC_ROAD_PATH).",
    ),
]
CatalogPath = Annotated[
    list[str] | None,
    typer.Option(
        "--catalog-path",
        metavar="DIR",
        help="Folder with catalogues that are not where the scenario says (repeatable; also XOSC_CATALOG_PATH).",
    ),
]
Version = Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print tracebacks of errors.")]


def writable_folder(path: Path | None) -> Path | None:
    """Callback of what names a folder to write into, which need not be there.

    Raises:
        UsageError: a file is in the way.
    """
    there = next((place for place in (path, *path.parents) if os.path.exists(place)), None) if path else None
    if there and not there.is_dir():
        raise UsageError("a folder to write into is expected, this is a file", path=there)
    return path


def out_folder(help: str) -> OptionInfo:
    """An option that names a folder to write into."""
    return typer.Option(metavar="DIR", callback=writable_folder, help=help)


def print_anything() -> None:
    """Let output hold what the terminal's encoding has no characters for: names of files may be of any bytes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def guarded(name: str, app: Callable[[], object], extra: str | None = None) -> None:
    """Run a command's app: errors become one line and an exit code, after a traceback with -v or for an unexpected error.

    Args:
        extra: the extra of the package that brings all that the command needs.
    """
    print_anything()
    try:
        app()
    except Exception as raised:
        error = missing(raised, extra) or raised
        expected = isinstance(error, ToolchainError | OSError)
        if not expected or "-v" in sys.argv or "--verbose" in sys.argv:
            traceback.print_exc()
        message, code = describe(error)
        print(f"{name}: {message}", file=sys.stderr)
        raise SystemExit(code) from None


def guarded_reader(name: str, app: Callable[[], object]) -> None:
    """Run the app of a command that reads files and prints: errors become one line and an exit code, a closed pipe the code 1."""
    print_anything()
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # a pipe may close before the last of it, which at exit would be a message
    except ToolchainError as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        _close_output()  # the reader has seen enough
        sys.exit(1)


def _close_output() -> None:
    """Send what is still to be printed nowhere, or the interpreter reports an error when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def deliver(content: str, what: str, output: Path | None) -> None:
    """Write a text to a file, or print it where none is given.

    Raises:
        UsageError: it can't be written; the message says what.
    """
    if output is None:
        print(content, end="")
        return
    with writing(what, output):
        output.write_text(content, encoding="utf-8", newline="\n", errors="backslashreplace")


@contextmanager
def interruptible(name: str, hint: str = "") -> Iterator[None]:
    """End the command in good order when it is interrupted (with a hint what to do then), or its output is no longer read."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"\n{name}: interrupted{hint and f'; {hint}'}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:
        _close_output()
        raise typer.Exit(PIPE_CLOSED) from None


@contextmanager
def progress_bar(doing: str, total: int, quiet: bool) -> Iterator[Callable[[float], None]]:
    """A bar on standard error, where that is a terminal; yields a function to advance it by finished items, or shares of one.

    It tells the time that has passed, which goes on where an item takes long, and the time that is left.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda count: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task, done = bar.add_task(doing, total=total), 0.0

        def advance(count: float) -> None:
            nonlocal done
            done += count
            bar.update(task, completed=round(done, _DIGITS))  # shares of an item add up to it

        yield advance


def parameters_of(pairs: Iterable[str], option: str = "--param") -> dict[str, str]:
    """Values of parameters by name, from the texts of an option.

    Raises:
        UsageError: one is not of the form NAME=VALUE.
    """
    values: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals):
            raise UsageError(f"{option} {pair!r}: NAME=VALUE is expected")
        values[name] = value
    return values
