"""Which files the user means to run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from schemas.common.errors import ToolchainError, UsageError


def runnable(arguments: Iterable[str]) -> list[Path]:
    """The files that are meant by names of files, folders and globs; of folders and globs only what can be run.

    Raises:
        UsageError: a folder or glob stands for nothing that can be run.
    """
    from schemas.common.command_line import expand

    found: dict[Path, None] = {}
    for argument in arguments:
        files = expand([argument])
        alone = files == [Path(argument)]
        meant = files if alone else [file for file in files if file.suffix.lower() == ".xosc" and not _is_catalog(file)]
        if not meant:
            raise UsageError("this stands for no scenario or variation file", path=argument)
        found |= dict.fromkeys(meant)
    return list(found)


def _is_catalog(path: Path) -> bool:
    import xosc

    try:
        return xosc.load(path).kind == "catalog"
    except ToolchainError:
        return False  # reported when it is run
