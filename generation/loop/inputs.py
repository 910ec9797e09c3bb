"""What a user's folder holds: recordings, and scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import xosc
from recognition import datasets
from recognition.datasets import Source
from schemas.errors import InvalidFile
from schemas.storage import digest


class Inputs(NamedTuple):
    """What is in a folder.

    Attributes:
        folder: the folder.
        recordings: of the formats that recognition reads.
        scenarios: OpenSCENARIO files that can be run: scenarios and variation files.
    """

    folder: Path
    recordings: list[Source]
    scenarios: list[Path]

    @classmethod
    def of(cls, folder: Path) -> Inputs:
        """Look through a folder and all below it.

        Raises:
            InvalidFile: it does not exist, holds neither recordings nor scenarios, or a file in it is malformed.
        """
        scenarios = [path for path in sorted(folder.rglob("*.xosc")) if xosc.load(path).kind != "catalog"]
        try:
            recordings = datasets.open(folder).sources
        except InvalidFile as error:
            if not scenarios or error.path != str(folder):  # a path of its own is that of a malformed file
                raise
            recordings = []
        return cls(folder, recordings, scenarios)

    @property
    def names(self) -> dict[Path, str]:
        """A name for each scenario, no two the same: its file's, with the folders below ours where others have that too."""
        stems = [path.stem for path in self.scenarios]
        inside = {path: path.relative_to(self.folder).with_suffix("") for path in self.scenarios}
        return {path: path.stem if stems.count(path.stem) == 1 else "_".join(inside[path].parts) for path in self.scenarios}

    @property
    def identity(self) -> str:
        """A short name for the files of the folder, by their names and sizes."""
        files = sorted(path for path in self.folder.rglob("*") if path.is_file())
        return digest(repr([(path.relative_to(self.folder).as_posix(), path.stat().st_size) for path in files]).encode())
