"""The cache of SUMO networks in the user's cache folder.

An entry is a network file and an index beside it, named after everything that they depend on. Both are written whole, and
the bytes depend on the entry alone, so parallel processes may write the same one.
The index carries a digest of the network: whatever is damaged counts as absent and is built again.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from schemas.errors import UsageError
from schemas.storage import keep
from xodr.sumo_net.netconvert import OPTIONS, program

FORMAT = 2
"""To be counted up when the same road network shall give another SUMO network or index."""


def folder() -> Path:
    """The cache folder: XOSC_CACHE_DIR, or xosc-toolchain in XDG_CACHE_HOME or in ~/.cache."""
    own = os.environ.get("XOSC_CACHE_DIR")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "xosc-toolchain"


class Entry:
    """One entry: the files of the network that is built from the given OpenDRIVE content."""

    def __init__(self, content: bytes) -> None:
        built_by = program().stat()
        salt = repr((FORMAT, OPTIONS, built_by.st_size, built_by.st_mtime_ns)).encode()
        key = hashlib.blake2b(content, digest_size=20, key=hashlib.blake2b(salt).digest()).hexdigest()
        self.network = folder() / "sumo" / f"{key}.net.xml"
        self.index = folder() / "sumo" / f"{key}.json"

    def read(self) -> dict[str, Any] | None:
        """The index, None where the entry is absent or damaged."""
        try:
            index = json.loads(self.index.read_bytes())
            intact = index["digest"] == _digest(self.network.read_bytes())
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return index if intact else None

    def write(self, network: bytes, index: dict[str, Any]) -> None:
        """Store the entry.

        Raises:
            UsageError: the cache folder cannot be written.
        """
        try:
            keep(network, self.network)
            keep(json.dumps({"digest": _digest(network), **index}).encode(), self.index)
        except OSError as error:
            message = f"the cache folder cannot be written ({error.strerror or error}); set XOSC_CACHE_DIR to another one"
            raise UsageError(message, path=self.network.parent) from None


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=20).hexdigest()
