"""OpenDRIVE files of sites: where they are, or made of what the data set has instead."""

from __future__ import annotations

from pathlib import Path

from recognition.datasets import SiteRoad, Source
from runner.recording import Recording
from schemas.errors import UsageError
from schemas.storage import writing


def map_of(source: Source, recording: Recording, folder: Path) -> SiteRoad:
    """The road of a recording, made in `folder` where OpenDRIVE is missing.

    Raises:
        InvalidFile: a file is malformed, or a run's road is not where it was.
        UsageError: the source has no information about its roads, or the folder can't be written.
    """
    beside = source.path.parent / f"{source.site}.xodr"
    if recording.network is not None:
        return SiteRoad(Path(recording.network.path))
    if beside.is_file():
        return SiteRoad(beside)
    if source.road is not None:
        with writing("the road", folder):
            return source.road(recording, folder)
    what = f"{source.name} has no map: neither {beside.name} beside it nor a Lanelet2 map {source.site}.osm"
    raise UsageError(what, path=source.path)
