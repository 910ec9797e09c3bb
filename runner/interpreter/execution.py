"""Prepare a scenario, and run it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.interpreter.compiler import Scenario, compile_scenario
from runner.interpreter.departures import Departures, absences
from runner.interpreter.ego import cruise_speed, driver_of, find_ego
from runner.interpreter.result import RunResult
from runner.interpreter.simulation import Simulation
from runner.interpreter.verdict import apply_limits, criteria_remarks, judge
from runner.participants.controllers import controller_remarks
from runner.settings import RunSettings
from runner.sut import load_system, system_name
from runner.sut.parameters import parameters_of

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from runner.worlds.base import World
    from xosc.resolve import Argument

_AFTER_COLLISION = 1.0
"""Time that is played on after the ego's first contact, where that ends a run, s"""


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
    return prepare(scenario, parameters, chosen).run(chosen)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scenario file compiled with certain parameter values, to be run as often as one likes, one run at a time.

    Each run begins anew: it gives the same results as in a process of its own. Settings, and with them the system under test,
    the seed and the world, may differ from run to run. Other parameter values need another `prepare`, because any element may
    depend on them; the parsed files, the road network and SUMO's network are kept between these by the process.

    Args:
        scenario: what the file was compiled to.
        parameters: the values that it was given.
    """

    scenario: Scenario
    parameters: Mapping[str, Argument]

    def ego(self, name: str | None = None) -> Entity | None:
        """The ego: the entity of that name, or else found by `runner.interpreter.ego.find_ego`."""
        return find_ego(self.scenario, name)

    def rehearse(self, settings: RunSettings | None = None) -> tuple[str, ...]:
        """Do what a run begins with, at time 0 and without a simulator; what it assumes.

        Raises:
            InvalidFile: an initial action, or one that starts at time 0, can't be done.
            Unsupported: likewise.
        """
        from runner.worlds.kinematic import RehearsalWorld

        chosen = settings or RunSettings()
        sim = Simulation(self.scenario, RehearsalWorld(), chosen.timestep, chosen.seed, strict=chosen.strict)
        sim.begin()
        return tuple(map(str, sim.remarks.found))

    def run(self, settings: RunSettings | None = None, **changes: Any) -> RunResult:
        """Run it to its end; arguments and errors as in `runner.run`."""
        chosen = replace(settings or RunSettings(), **changes)
        scenario, system = self.scenario, load_system(chosen.sut)
        if chosen.enforce_constraints and scenario.violations:
            raise scenario.violations[0]
        ego = self.ego(chosen.ego)
        sim = Simulation(scenario, open_world(chosen.world), chosen.timestep, chosen.seed, strict=chosen.strict)
        for violation in scenario.violations:
            sim.note("constraint", "parameters", str(violation))
        departures = Departures(ego)
        sim.observers.append(departures)
        try:
            if ego is not None and system is not None:
                sim.drive_ego(ego, driver_of(scenario, ego, system, chosen.timestep, chosen.seed))
            sim.begin()
            status = _play(sim, ego, chosen)
        finally:
            sim.world.close()
        recording = sim.recorder.recording()
        verdict = judge(scenario, sim.contacts, recording, ego)
        result = RunResult(
            scenario=scenario.path,
            parameters={name: str(value) for name, value in self.parameters.items()},
            status=status,
            end_time=sim.time,
            verdict=verdict,
            remarks=(
                *map(str, (*scenario.remarks, *sim.remarks.found)),
                *_controller_remarks(scenario, ego if system is not None else None),
                *absences(scenario.path, scenario.entities.values()),
                *departures.remarks,
                *criteria_remarks(scenario.criteria, verdict),
            ),
            ego=ego.name if ego is not None else None,
            sut=system_name(chosen.sut) if ego is not None else "none",
            settings={name: getattr(chosen, name) for name in ("timestep", "seed", "world", "max_time")},
            events=sim.log,
            recording=recording,
            sut_parameters=parameters_of(system) if ego is not None and system is not None else {},
        )
        apply_limits(result, chosen.limits)
        return result


def _play(sim: Simulation, ego: Entity | None, settings: RunSettings) -> str:
    """Step until the run ends; its status."""
    steps = math.floor(settings.max_time / settings.timestep + 1e-6)
    status, seen = "timeout", 0
    while sim.step_index < steps and sim.tick():
        if settings.end_after_collision and status != "collision" and ego is not None:
            touched = any(ego.name in contact[1:] for contact in sim.contacts.history[seen:])
            seen = len(sim.contacts.history)
            last = sim.step_index + round(_AFTER_COLLISION / settings.timestep)
            if touched and last < steps:
                steps, status = last, "collision"
    return "completed" if sim.finished else status


def _controller_remarks(scenario: Scenario, driven: Entity | None) -> tuple[str, ...]:
    cruise = cruise_speed(scenario, driven) if driven else None
    return controller_remarks(scenario.entities.values(), scenario.activated, driven, cruise)


def prepare(
    scenario: str | PathLike[str],
    parameters: Mapping[str, Argument] | None = None,
    settings: RunSettings | None = None,
    **changes: Any,
) -> Prepared:
    """Load, resolve and compile a scenario file; arguments and errors as in `run`.

    Of the settings those count that say how files are read.
    """
    import xosc
    from runner.interpreter.roads import load_roads

    chosen = replace(settings or RunSettings(), **changes)
    document = xosc.resolve(
        xosc.load(Path(scenario)), parameters, enforce_constraints=chosen.enforce_constraints, strict=chosen.strict
    )
    network, assumed = load_roads(document, chosen)
    document = replace(document, remarks=(*document.remarks, *assumed))
    return Prepared(compile_scenario(document, network, strict=chosen.strict), dict(parameters or {}))


def open_world(name: str) -> World:
    """The world of a name in `runner.settings.WORLDS`."""
    if name == "kinematic":
        from runner.worlds.kinematic import KinematicWorld

        return KinematicWorld()
    from runner.worlds.sumo import SumoWorld

    return SumoWorld()
