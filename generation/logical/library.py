"""The files of the library that are made from the tables: roads, logical scenarios and a variation file of each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import xodr
import xosc
from generation.logical.geometries import GEOMETRIES, Geometry
from generation.logical.maneuvers import MANEUVERS
from generation.logical.plot import Plot, header
from xosc.distributions import (
    Deterministic,
    DeterministicSingleParameterDistribution,
    DistributionSet,
    ParameterValueDistribution,
)

SCENARIOS = Path(xosc.__file__).parent / "library"
ROADS = Path(xodr.__file__).parent / "library"


def plots() -> Iterator[tuple[str, Plot]]:
    """Every manoeuvre on each geometry where it makes sense, with the name of its file."""
    for name, maneuver in MANEUVERS.items():
        for where in maneuver.geometries:
            place = "highway" if where in ("on_ramp", "off_ramp") else where
            yield f"{name}_{place}", Plot(maneuver, GEOMETRIES[where])


def write(scenarios: Path = SCENARIOS, roads: Path = ROADS) -> list[Path]:
    """Write the files into two folders that stand to each other as those of the library do; their paths."""
    written = [_road(geometry, roads) for geometry in GEOMETRIES.values()]
    for name, plot in plots():
        path = scenarios / f"{name}.xosc"
        road = f"../../xodr/library/{plot.geometry.file}.xodr"
        xosc.write(plot.document(path, road, "catalogs/vehicles"), path)
        written += [path, _variation(name, plot, scenarios)]
    return written


def _road(geometry: Geometry, folder: Path) -> Path:
    return geometry.build().write(folder / f"{geometry.file}.xodr")


def _variation(name: str, plot: Plot, folder: Path) -> Path:
    """One value, for a first run."""
    parameter, value = next(iter(plot.defaults().items()))
    values = DeterministicSingleParameterDistribution(parameter, DistributionSet((repr(value),)))
    path = folder / f"{name}_variation.xosc"
    distribution = ParameterValueDistribution(f"{name}.xosc", Deterministic((values,)))
    xosc.write_distribution(distribution, path, header(f"Variation of {name}"))
    return path
