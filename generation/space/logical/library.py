"""The files of the library that are made from the tables: roads, catalogues, logical scenarios and
a variation file of each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import xodr
import xosc
from generation.space.logical.encounters import ENCOUNTERS, EncounterScenario
from generation.space.logical.maneuvers import MANEUVERS, ManeuverScenario
from generation.space.logical.pairs import PAIRS, PairScenario
from generation.space.logical.roads import (
    AUTHOR,
    GEOMETRIES,
    Course,
    header,
    write_catalogs,
    write_roads,
)
from xosc.distributions import (
    Deterministic,
    DeterministicSingleParameterDistribution,
    DistributionSet,
    ParameterValueDistribution,
)

SCENARIOS = Path(xosc.__file__).parent / "library"
ROADS = Path(xodr.__file__).parent / "library"
Made = ManeuverScenario | EncounterScenario | PairScenario
"""Scenarios that are made from tables."""


def maneuver_scenarios() -> Iterator[tuple[str, ManeuverScenario]]:
    """Every manoeuvre on each geometry where it makes sense, with the name of its file."""
    for name, maneuver in MANEUVERS.items():
        for where in maneuver.geometries:
            geometry = GEOMETRIES[where]
            file = f"{name}_{'highway' if geometry.is_motorway else where}"
            yield file, ManeuverScenario(file, name.replace("_", " "), maneuver, geometry)


def pair_scenarios() -> Iterator[tuple[str, PairScenario]]:
    """Both adversaries of each pair at once, on a motorway, with the name of its file."""
    for name, pair in PAIRS.items():
        yield f"{name}_highway", PairScenario(f"{name}_highway", pair)


def encounter_scenarios(roads: Path = ROADS) -> Iterator[tuple[str, EncounterScenario]]:
    """Every encounter, with the name of its file; on the roads in a folder."""
    networks = {
        file: xodr.load(roads / f"{file}.xodr")
        for file in sorted({encounter.file for encounter in ENCOUNTERS.values()})
    }
    for name, encounter in ENCOUNTERS.items():
        yield name, EncounterScenario(name, encounter, networks[encounter.file])


def write(scenarios: Path = SCENARIOS, roads: Path = ROADS) -> list[Path]:
    """Write the files into two folders that stand to each other as those of the library do; their
    paths."""
    written = [*write_roads(roads, AUTHOR), *write_catalogs(scenarios, _courses())]
    made: list[tuple[str, Made]] = [
        *maneuver_scenarios(),
        *encounter_scenarios(roads),
        *pair_scenarios(),
    ]
    for name, scenario in made:
        path = scenarios / f"{name}.xosc"
        xosc.write(scenario.document(path, f"../../xodr/library/{_road(scenario)}.xodr"), path)
        written += [path, _variation(scenario, scenarios)]
    return written


def _road(scenario: Made) -> str:
    """Name of the road's file."""
    if isinstance(scenario, PairScenario):
        return scenario.file
    return (
        scenario.geometry.file
        if isinstance(scenario, ManeuverScenario)
        else scenario.encounter.file
    )


def _variation(scenario: Made, folder: Path) -> Path:
    """One value, for a first run."""
    name, (parameter, value) = scenario.name, next(iter(scenario.defaults().items()))
    values = DeterministicSingleParameterDistribution(parameter, DistributionSet((repr(value),)))
    path = folder / f"{name}_variation.xosc"
    distribution = ParameterValueDistribution(f"{name}.xosc", Deterministic((values,)))
    xosc.write_distribution(distribution, path, header(f"Variation of {name}", scenario.tags))
    return path


def _courses() -> Iterator[tuple[str, Course]]:
    """Road files and courses on them that scenarios refer to."""
    for encounter in ENCOUNTERS.values():
        yield from (
            (encounter.file, course)
            for course in (encounter.ego, encounter.way)
            if isinstance(course, Course)
        )
    for geometry in GEOMETRIES.values():
        if geometry.turn is not None:
            yield geometry.file, geometry.turn
