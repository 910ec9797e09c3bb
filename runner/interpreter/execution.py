"""Run one scenario."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.interpreter.compiler import Scenario, compile_scenario
from runner.interpreter.departures import Departures
from runner.interpreter.ego import driver_of, find_ego
from runner.interpreter.result import RunResult
from runner.interpreter.simulation import Simulation
from runner.interpreter.verdict import criteria_remarks, judge
from runner.settings import RunSettings
from runner.sut import load_system, system_name

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from runner.worlds.base import World
    from xosc.resolve import Argument


def run(
    scenario: str | PathLike[str],
    settings: RunSettings | None = None,
    *,
    parameters: Mapping[str, Argument] | None = None,
    **changes: Any,
) -> RunResult:
    """Run a scenario file to its end.

    Args:
        scenario: an OpenSCENARIO file of kind scenario.
        settings: how to run it; the defaults of `RunSettings` where not given.
        parameters: values of its global parameters.
        changes: settings by name, as `timestep=0.1, sut="none"`, that replace those of `settings`.

    Raises:
        UsageError: a setting or parameter is wrong.
        InvalidFile: a file is missing, malformed or breaks its standard.
        Unsupported: the scenario asks for something that the runner does not do.
    """
    chosen = replace(settings or RunSettings(), **changes)
    system = load_system(chosen.sut)
    compiled, driver = prepare(scenario, parameters, chosen)
    sim = Simulation(compiled, open_world(chosen.world), chosen.timestep, chosen.seed)
    for violation in compiled.violations:
        sim.note("constraint", "parameters", str(violation))
    departures = Departures(driver)
    sim.observers.append(departures)
    try:
        if driver is not None and system is not None:
            sim.drive_ego(driver, driver_of(compiled, driver, system, chosen.timestep, chosen.seed))
        sim.begin()
        steps = math.floor(chosen.max_time / chosen.timestep + 1e-6)
        while sim.step_index < steps and sim.tick():
            pass
    finally:
        sim.world.close()
    recording = sim.recorder.recording()
    verdict = judge(compiled, sim.contacts, recording, driver)
    return RunResult(
        scenario=compiled.path,
        parameters={name: str(value) for name, value in (parameters or {}).items()},
        status="completed" if sim.finished else "timeout",
        end_time=sim.time,
        verdict=verdict,
        remarks=(*departures.remarks, *criteria_remarks(compiled.criteria, verdict)),
        ego=driver.name if driver is not None else None,
        sut=system_name(chosen.sut) if driver is not None else "none",
        settings={name: getattr(chosen, name) for name in ("timestep", "seed", "world", "max_time")},
        events=sim.log,
        recording=recording,
    )


def prepare(
    scenario: str | PathLike[str], parameters: Mapping[str, Argument] | None, settings: RunSettings
) -> tuple[Scenario, Entity | None]:
    """Load, resolve and compile a scenario, and find its ego; arguments and errors as in `run`."""
    import xodr
    import xosc

    document = xosc.resolve(xosc.load(Path(scenario)), parameters, enforce_constraints=settings.enforce_constraints)
    road_file = document.logic_file
    if road_file is not None and not os.path.exists(road_file):  # unlike Path.exists it takes names of any length
        raise document.node.need("RoadNetwork", "LogicFile").invalid(f"the road network {road_file} does not exist")
    network = xodr.load(road_file) if road_file is not None else None
    compiled = compile_scenario(document, network)
    return compiled, find_ego(compiled, settings.ego)


def open_world(name: str) -> World:
    """The world of a name in `runner.settings.WORLDS`."""
    if name == "kinematic":
        from runner.worlds.kinematic import KinematicWorld

        return KinematicWorld()
    from runner.worlds.sumo import SumoWorld

    return SumoWorld()
