"""What a user's folder holds: recordings, and scenarios."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import xosc
from generation.declared import scenario_of
from generation.outcomes.inputs import files
from recognition import datasets
from recognition.datasets import Source
from runner.settings import RunSettings
from schemas.errors import InvalidFile, ToolchainError, UsageError
from schemas.storage import digest


class Inputs(NamedTuple):
    """What is in a folder.

    Attributes:
        folder: the folder.
        recordings: of the formats that recognition reads.
        scenarios: OpenSCENARIO files but catalogues: scenarios and variation files, those that can't be read among them.
    """

    folder: Path
    recordings: list[Source]
    scenarios: list[Path]

    @classmethod
    def of(cls, folder: Path) -> Inputs:
        """Look through a folder and all below it.

        Raises:
            UsageError: it is a file.
            InvalidFile: it does not exist, or holds neither recordings nor scenarios.
        """
        if folder.is_file():
            raise UsageError("a folder is expected, with recordings or scenarios in it", path=folder)
        if not folder.exists():
            raise InvalidFile("no such folder", path=folder)
        scenarios = [path for path in sorted(folder.rglob("*.xosc")) if not path.is_dir() and not _is_catalog(path)]
        try:
            recordings = datasets.open(folder).sources
        except InvalidFile as error:
            if error.path != str(folder):  # a recording whose name no scenario can have
                raise
            if not scenarios:
                raise InvalidFile(f"{error.message}, and no scenario (.xosc)", path=folder) from None
            recordings = []
        return cls(folder, recordings, scenarios)

    @property
    def names(self) -> dict[Path, str]:
        """A name for each scenario, no two the same: its file's, with the folders below ours where others have that too."""
        stems = [path.stem for path in self.scenarios]
        inside = {path: path.relative_to(self.folder).with_suffix("") for path in self.scenarios}
        return {path: path.stem if stems.count(path.stem) == 1 else "_".join(inside[path].parts) for path in self.scenarios}

    @property
    def recorded(self) -> str:
        """A short name for all files of the folder but scenarios, by their content; empty without recordings.

        Raises:
            InvalidFile: one of them can't be read.
        """
        if not self.recordings:
            return ""
        found = sorted(path for path in self.folder.rglob("*") if path.is_file() and path.suffix != ".xosc")
        return digest(repr([(path.relative_to(self.folder).as_posix(), _content(path)) for path in found]).encode())

    def played(self, run: RunSettings) -> str:
        """A short name for the scenarios, with the roads and catalogues that they refer to, by their content."""
        return digest(repr([played(path, run) for path in self.scenarios]).encode())


def played(path: Path, run: RunSettings, pinned: Mapping[str, str] = MappingProxyType({})) -> Any:
    """The content of a scenario, or of a variation file and its scenario, and what is wrong with it."""
    content = ""
    try:
        content = _content(path)
        return content, files(scenario_of(path), run, pinned)
    except ToolchainError as error:
        return content, str(error)


def _is_catalog(path: Path) -> bool:
    """A file that can't be read is none: each stage says so of it, and goes on with the others."""
    try:
        return xosc.load(path).kind == "catalog"
    except ToolchainError:
        return False


def _content(path: Path) -> str:
    """A digest of a file, which may be larger than memory."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "blake2b").hexdigest()
    except OSError as error:
        raise InvalidFile(f"the file can't be read: {error.strerror or error}", path=path) from None
