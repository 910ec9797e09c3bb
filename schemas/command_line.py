"""What all commands share: their app, the options that each of them has, output of any characters."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Annotated

import typer
from typer.models import OptionInfo

from schemas.errors import UsageError
from schemas.version import version


def new_app() -> typer.Typer:
    """An app that leaves errors to its caller, and prints plain text."""
    return typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


def _print_version(context: typer.Context, wanted: bool) -> None:
    if wanted:
        print(f"{context.command.name} {version()}")
        raise typer.Exit


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
