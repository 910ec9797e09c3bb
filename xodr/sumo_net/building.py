"""The SUMO network of an OpenDRIVE file: converted once, found in the cache ever after."""

from __future__ import annotations

from functools import lru_cache
from os import PathLike
from pathlib import Path

from schemas.storage import Stamp, read_bytes, stamp
from xodr.reader import load
from xodr.sumo_net.cache import Entry
from xodr.sumo_net.net import SignalLink, SumoNet, Track

_REMEMBERED = 64
_NO_FILE: Stamp = (0, 0)


def build(path: str | PathLike[str] | None) -> SumoNet:
    """The SUMO network of an OpenDRIVE file.

    Args:
        path: the OpenDRIVE file; None for a plain without roads, on which there is only the dock.

    Raises:
        InvalidFile, Unsupported: the OpenDRIVE file cannot be read.
        UsageError: the cache folder cannot be written.
    """
    return _build(None, _NO_FILE) if path is None else _build(Path(path), stamp(path))


@lru_cache(maxsize=_REMEMBERED)
def _build(path: Path | None, _stamp: Stamp) -> SumoNet:
    entry = Entry(read_bytes(path) if path else b"")
    index = entry.read()
    if index is None:
        from xodr.sumo_net.convert import convert  # once for each road network

        network, index = convert(load(path) if path else None)
        entry.write(network, index)
    return SumoNet(
        entry.network,
        index["left_hand"],
        [(sumo_lane, Track(*track)) for sumo_lane, *track in index["tracks"]],
        {signal: tuple(SignalLink(*link) for link in links) for signal, links in index["signals"].items()},
        index["fallback"],
    )
