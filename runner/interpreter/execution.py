"""Run one scenario."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from runner.interpreter.compiler import Scenario, compile_scenario
from runner.interpreter.departures import Departures
from runner.interpreter.ego import drive_ego, find_ego
from runner.interpreter.result import RunResult
from runner.interpreter.simulation import Simulation
from runner.interpreter.verdict import judge
from runner.sut import System, load_system, system_name
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from runner.worlds.base import World
    from xosc.resolve import Argument

MAX_TIME = 300.0
"""Time limit (s) of a run whose caller gives none: scenarios without a StopTrigger have no end of their own."""

_LONGEST = 1e6

WORLDS = ("sumo", "kinematic")


def run(
    scenario: str | PathLike[str],
    *,
    parameters: Mapping[str, Argument] | None = None,
    timestep: float = 0.05,
    sut: str | System | None = "cas",
    ego: str | None = None,
    seed: int = 0,
    max_time: float | None = None,
    world: str = "sumo",
    enforce_constraints: bool = False,
) -> RunResult:
    """Run a scenario file to its end.

    Args:
        scenario: an OpenSCENARIO file of kind scenario.
        parameters: values of its global parameters.
        timestep: s.
        sut: the system under test that drives the ego: a name of the entry-point group `xosc.sut`, `module:Class`,
            an instance, or None (as `none`) for what the scenario scripts alone.
        ego: name of the ego entity; found by `runner.interpreter.ego.find_ego` where not given.
        seed: of everything random in the run.
        max_time: time limit in simulated seconds (default `MAX_TIME`).
        world: `sumo`, or `kinematic` for scripted motion without a simulator.
        enforce_constraints: refuse parameter values that violate their constraint groups; otherwise they are noted in the
            event log.

    Raises:
        UsageError: an option or parameter is wrong.
        InvalidFile: a file is missing, malformed or breaks its standard.
        Unsupported: the scenario asks for something that the runner does not do.
    """
    check_settings(timestep, max_time, world)
    limit = MAX_TIME if max_time is None else max_time
    system = load_system(sut)
    compiled, driver = prepare(scenario, parameters, ego, enforce_constraints)
    sim = Simulation(compiled, open_world(world), timestep, seed)
    for violation in compiled.violations:
        sim.note("constraint", "parameters", str(violation))
    departures = Departures(driver)
    compiled.observers.append(departures)
    try:
        drive_ego(sim, driver, system)
        sim.begin()
        steps = math.floor(limit / timestep + 1e-6)
        while sim.step_index < steps and sim.tick():
            pass
    finally:
        sim.world.close()
    return RunResult(
        scenario=compiled.path,
        parameters={name: str(value) for name, value in (parameters or {}).items()},
        status="completed" if sim.finished else "timeout",
        end_time=sim.time,
        verdict=judge(sim, driver),
        remarks=departures.remarks,
        ego=driver.name if driver is not None else None,
        sut=system_name(sut) if driver is not None else "none",
        settings={"timestep": timestep, "seed": seed, "world": world, "max_time": limit},
        events=sim.log,
        recording=sim.recorder.recording(),
    )


def prepare(
    scenario: str | PathLike[str], parameters: Mapping[str, Argument] | None, ego: str | None, enforce_constraints: bool
) -> tuple[Scenario, Entity | None]:
    """Load, resolve and compile a scenario, and find its ego; arguments and errors as in `run`."""
    import xodr
    import xosc

    document = xosc.resolve(xosc.load(Path(scenario)), parameters, enforce_constraints=enforce_constraints)
    road_file = document.logic_file
    if road_file is not None and not os.path.exists(road_file):  # unlike Path.exists it takes names of any length
        raise document.node.need("RoadNetwork", "LogicFile").invalid(f"the road network {road_file} does not exist")
    network = xodr.load(road_file) if road_file is not None else None
    compiled = compile_scenario(document, network)
    return compiled, find_ego(compiled, ego)


def open_world(name: str) -> World:
    """The world of a name in `WORLDS`."""
    if name == "kinematic":
        from runner.worlds.kinematic import KinematicWorld

        return KinematicWorld()
    from runner.worlds.sumo import SumoWorld

    return SumoWorld()


def check_settings(timestep: float, max_time: float | None, world: str) -> None:
    """Refuse settings that no run can have; arguments as in `run`.

    Raises:
        UsageError: one of them is wrong.
    """
    if not 0.001 <= timestep <= 1.0:
        raise UsageError(f"the time step must be from 0.001 s to 1 s, not {timestep}")
    if max_time is not None and not 0.0 <= max_time <= _LONGEST:
        raise UsageError(f"the time limit must be from 0 s to {_LONGEST:g} s, not {max_time}")
    if world not in WORLDS:
        raise UsageError(f"the world {world!r} is not one of {', '.join(WORLDS)}")
