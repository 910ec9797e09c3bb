"""The SUMO network of an OpenDRIVE file: converted once, found in the cache ever after."""

from __future__ import annotations

from functools import lru_cache
from os import PathLike
from pathlib import Path

from schemas.errors import InvalidFile
from xodr.reader import load
from xodr.sumo_net.cache import Entry
from xodr.sumo_net.convert import convert
from xodr.sumo_net.net import SignalLink, SumoNet, Track

_REMEMBERED = 64


def build(path: str | PathLike[str] | None) -> SumoNet:
    """The SUMO network of an OpenDRIVE file.

    Args:
        path: the OpenDRIVE file; None for a plain without roads, on which there is only the dock.

    Raises:
        InvalidFile, Unsupported: the OpenDRIVE file cannot be read.
        UsageError: the cache folder cannot be written.
    """
    if path is None:
        return _build(None, 0, 0)
    path = Path(path)
    try:
        status = path.stat()
    except (OSError, ValueError):
        return _build(path, 0, 0)
    return _build(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=_REMEMBERED)
def _build(path: Path | None, _time: int, _size: int) -> SumoNet:
    entry = Entry(_content(path))
    index = entry.read()
    if index is None:
        network, index = convert(load(path) if path else None)
        entry.write(network, index)
    return SumoNet(
        entry.network,
        index["left_hand"],
        [(sumo_lane, Track(*track)) for sumo_lane, *track in index["tracks"]],
        {signal: tuple(SignalLink(*link) for link in links) for signal, links in index["signals"].items()},
        index["fallback"],
    )


def _content(path: Path | None) -> bytes:
    try:
        return path.read_bytes() if path else b""
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InvalidFile(f"the file cannot be read: {reason}", path=path) from None
