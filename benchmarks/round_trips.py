"""Lanes, connections and places on earth after the way from OpenDRIVE to another format and back.

    python -m benchmarks.round_trips PATH... [--between lanelet2 sumo] [--largest-file 1000000]

For each road file and format a row: length of lanes (km), share of it whose borders are within
5 cm of the source's, 95 % distance of borders (cm), connections kept and gained, and the largest
difference of longitude and latitude (degrees) of places of one name. The sums are weighted by
length and by number. Files of one content count once.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from schemas.common.errors import ToolchainError
from xodr.formats.maps import files as maps
from xodr.formats.maps.comparing import compare
from xodr.formats.maps.lane_map import LaneMap
from xodr.formats.maps.projecting import Projector

_ENDINGS = {
    "lanelet2": "map.osm",
    "sumo": "map.net.xml",
    "commonroad": "map.xml",
    "geojson": "map.geojson",
}
_SQUARE = np.array([[x, y, 0.0] for x in (-1e3, 0.0, 1e3) for y in (-1e3, 0.0, 1e3)])
"""Places (m) whose longitude and latitude are compared"""


def main() -> None:
    """Print a row for each map and format, and the sums."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="OpenDRIVE files and folders")
    arguments.add_argument("--between", nargs="+", choices=_ENDINGS, default=["lanelet2", "sumo"])
    arguments.add_argument("--largest-file", type=int, default=1_000_000, help="bytes")
    given = arguments.parse_args()
    files = _distinct(given.paths, given.largest_file)
    print(f"{len(files)} different files")
    for between in given.between:
        _way(between, files)


def _distinct(paths: list[Path], largest: int) -> list[Path]:
    seen: dict[bytes, Path] = {}
    for path in paths:
        found = sorted(path.rglob("*.xodr")) if path.is_dir() else [path]
        for file in found:
            if file.is_file() and file.stat().st_size <= largest:
                seen.setdefault(file.read_bytes(), file)
    return list(seen.values())


def _way(between: str, files: list[Path]) -> None:
    length = close = 0.0
    connections = kept = gained = refused = 0
    away = 0.0
    for path in files:
        try:
            with TemporaryDirectory(prefix="round-trip-") as folder:
                there = maps.convert(path, Path(folder) / _ENDINGS[between])
                back = maps.convert(there.path, Path(folder) / "back.xodr")
        except ToolchainError as error:
            refused += 1
            print(f"{path.name}: {error}")
            continue
        difference = compare(there.source, back.result)
        lost = len(difference.connections_lost)
        degrees = _away(there.source, back.result)
        length += difference.length
        close += difference.within * difference.length
        connections += difference.connections
        kept += difference.connections - lost
        gained += len(difference.connections_gained)
        away = max(away, degrees or 0.0)
        print(
            f"{path.name}: {difference.length / 1e3:.2f} km, within 5 cm {difference.within:.2%},"
            f" 95 % {100.0 * difference.borders.most:.2f} cm, connections"
            f" {difference.connections - lost}/{difference.connections}"
            f" and {len(difference.connections_gained)} more,"
            f" {'no projection' if degrees is None else f'{degrees:.1e} degrees'}",
            flush=True,
        )
    print(
        f"by {between}: {len(files) - refused} maps, {length / 1e3:.1f} km,"
        f" within 5 cm {close / max(length, 1e-9):.2%}, connections kept {kept} of {connections}"
        f" and {gained} more, {away:.1e} degrees at most, {refused} refused"
    )


def _away(one: LaneMap, other: LaneMap) -> float | None:
    """Largest difference (degrees) of places on earth of equal coordinates; None without a
    projection."""
    here, there = Projector.of(one), Projector.of(other)
    if here is None:
        return None
    if there is None:
        return float("inf")
    pairs = zip(here.to_geodetic(_SQUARE)[:2], there.to_geodetic(_SQUARE)[:2], strict=True)
    return max(float(np.abs(ours - theirs).max()) for ours, theirs in pairs)


if __name__ == "__main__":
    main()
