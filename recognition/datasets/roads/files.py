"""Roads made for sites, as files whose names tell their content."""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path

from recognition.datasets.source import SiteRoad
from schemas.storage import digest, keep


def keep_road(content: bytes, site: str, folder: Path) -> Path:
    """Write the OpenDRIVE file of a site; named by its own content, so that roles that a person edited stay with it."""
    name = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in site)
    return keep(content, folder / f"{name}-{digest(content)}.xodr")


def converted(osm: Path, origin: tuple[float, float] | None, folder: Path) -> SiteRoad:
    """The road of a Lanelet2 map, made once for each content of the map.

    Args:
        origin: latitude and longitude (degrees) of the origin of its coordinates, where they are known.
    """
    return _converted(osm, osm.stat().st_mtime_ns, origin, folder)


@lru_cache(maxsize=64)
def _converted(osm: Path, _version: int, origin: tuple[float, float] | None, folder: Path) -> SiteRoad:
    from xodr.lanelet2 import convert

    target = folder / f"{osm.stem}-{digest(osm.read_bytes() + repr(origin).encode())}.xodr"
    with tempfile.TemporaryDirectory() as drafts:
        made = convert(osm, origin, Path(drafts) / target.name)
        return SiteRoad(keep(made.path.read_bytes(), target), notes=tuple(f"{osm.name}: {note}" for note in made.notes))
