"""Prepare a scenario, and run it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

from runner.interpreter.departures import Departures
from runner.interpreter.session import Compiled, Session, compile_file
from runner.interpreter.simulation import Simulation
from runner.interpreter.untested import at_beginning
from runner.settings import RunSettings
from runner.sut import system_name

if TYPE_CHECKING:
    from runner.interpreter.result import Cause, RunResult
    from xosc.resolve import Argument


def run(
    scenario: str | PathLike[str],
    settings: RunSettings | None = None,
    *,
    parameters: Mapping[str, Argument] | None = None,
    progress: Callable[[float], object] | None = None,
    **changes: Any,
) -> RunResult:
    """Run a scenario file to its end.

    Args:
        scenario: an OpenSCENARIO file of kind scenario.
        settings: how to run it; the defaults of `RunSettings` where not given.
        parameters: values of its global parameters.
        progress: called after each step with the simulation time (s).
        changes: settings by name, as `timestep=0.1, sut="none"`, that replace those of `settings`.

    Raises:
        UsageError: a setting or parameter is wrong.
        InvalidFile: a file is missing, malformed or breaks its standard.
        Unsupported: the scenario asks for something that the runner does not do.
    """
    chosen = replace(settings or RunSettings(), **changes)
    return prepare(scenario, parameters, chosen).run(chosen, progress=progress)


class Rehearsed(NamedTuple):
    """Facts known before a run: its assumptions, and causes for an inconclusive verdict."""

    remarks: tuple[str, ...]
    causes: tuple[Cause, ...]


@dataclass(frozen=True, eq=False)
class Prepared(Compiled):
    """A scenario file compiled with certain parameter values, to be run as often as one likes, one run at a time.

    Each run begins anew: it gives the same results as in a process of its own. Settings, and with them the system under test,
    the seed and the world, may differ from run to run. Other parameter values need another `prepare`, because any element may
    depend on them; the parsed files, the road network and SUMO's network are kept between these by the process.

    Args:
        scenario: what the file was compiled to.
        parameters: the values that it was given.
    """

    def rehearse(self, settings: RunSettings | None = None) -> Rehearsed:
        """Do what a run begins with, at time 0 and without a simulator.

        Raises:
            UsageError: there is no such ego.
            InvalidFile: an initial action, or one that starts at time 0, can't be done.
            Unsupported: likewise.
        """
        from runner.worlds.base import RehearsalWorld

        chosen = settings or RunSettings()
        sim = Simulation(self.scenario, RehearsalWorld(), chosen.timestep, chosen.seed, strict=chosen.strict)
        ego = self.ego(chosen.ego)
        departures = Departures(ego)
        sim.begin()
        departures(sim)
        recording, system = sim.recorder.recording(), system_name(chosen.sut)
        causes = tuple(at_beginning(self.scenario, sim, recording, departures, ego, system))
        return Rehearsed(tuple(map(str, (*self.scenario.remarks, *sim.remarks.found))), causes)

    def run(
        self, settings: RunSettings | None = None, *, progress: Callable[[float], object] | None = None, **changes: Any
    ) -> RunResult:
        """Run it to its end; arguments and errors as in `runner.run`."""
        return Session(self, settings or RunSettings(), **changes).finish(progress)


def prepare(
    scenario: str | PathLike[str],
    parameters: Mapping[str, Argument] | None = None,
    settings: RunSettings | None = None,
    **changes: Any,
) -> Prepared:
    """Load, resolve and compile a scenario file; arguments and errors as in `run`.

    Of the settings those count that say how files are read.
    """
    compiled = compile_file(scenario, parameters, replace(settings or RunSettings(), **changes))
    return Prepared(compiled.scenario, compiled.parameters)
