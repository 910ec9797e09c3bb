"""Scenarios loaded and compiled, and runs of them: as a whole, or step by step, the ego driven by
the caller if wanted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self, Unpack

from runner.engine.compile.compiler import Scenario, compile_scenario
from runner.engine.participants.scenario_objects import controller_remarks
from runner.engine.storyboard.departures import Departures, absences, egoless, jolts, standstill
from runner.engine.storyboard.simulation import Simulation
from runner.judging.criteria.criterion import Criterion, declared
from runner.judging.evidence.least import collect, missing
from runner.judging.evidence.progress import idleness, untested_remarks
from runner.judging.evidence.rows import Observed, not_driven
from runner.judging.result import RunResult
from runner.judging.settings import RunSettings, SettingChanges
from runner.judging.verdict import (
    apply_limits,
    criteria_remarks,
    judge,
    red_light_remarks,
    results_of_criteria,
)
from runner.systems import OF_SYSTEM, System, open_system, system_name, with_parameters
from runner.systems.base import RAISED, Control, Observation, Pose, is_finite, parameters_of, split
from runner.systems.drivers import cruise_speed, driver_of, failed, find_ego, observe
from runner.systems.kinds.commanded import Commanded
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.terminal.files import named

if TYPE_CHECKING:
    from runner.engine.participants.entity import Entity
    from runner.engine.worlds.base import World
    from runner.judging.result import Cause
    from xosc.resolve import Argument


@dataclass(frozen=True, eq=False)
class Compiled:
    """A scenario file compiled with certain parameter values.

    Args:
        scenario: what the file was compiled to.
        parameters: the values that it was given.
        criteria: declared in its stop triggers, for its ego.
    """

    scenario: Scenario
    parameters: Mapping[str, Argument]
    criteria: tuple[Criterion, ...] = ()

    def ego(self, name: str | None = None) -> Entity | None:
        """The ego: the entity of that name, or else found by `runner.systems.drivers.find_ego`."""
        return find_ego(self.scenario, name)


def compile_file(
    scenario: str | PathLike[str], parameters: Mapping[str, Argument] | None, settings: RunSettings
) -> Compiled:
    """Load, resolve and compile a scenario file; arguments and errors as in `runner.run`."""
    import xosc
    from runner.engine.compile.road_network import load_roads

    document = xosc.resolve(
        xosc.load(named(Path(scenario))),
        parameters,
        enforce_constraints=settings.enforce_constraints,
        strict=settings.strict,
        catalog_path=settings.catalog_path,
    )
    network, assumed = load_roads(document, settings.road, settings.road_path, settings.strict)
    document = replace(document, remarks=(*document.remarks, *assumed))
    compiled = compile_scenario(document, network, strict=settings.strict)
    criteria = declared(document.node.need("Storyboard"))
    return Compiled(compiled, dict(parameters or {}), criteria)


_AFTER_COLLISION = 1.0
"""Time that is played on after the ego's first contact, where that ends a run, s"""


class Session:
    """A run step by step: `with runner.Session("file.xosc") as session:
    session.step(Control(acceleration=-2.0))`.

    It begins at time 0, the initial actions done. A world on SUMO is one a process: close a session
    before the next.

    Args:
        scenario: an OpenSCENARIO file of kind scenario, or what `runner.prepare` made of it.
        settings: how to run it. The caller drives the ego where neither these nor `changes` name a
            system under test.
        parameters: values of the file's global parameters.
        changes: settings by name, that replace those of `settings`.

    Raises:
        UsageError: a setting or parameter is wrong, or parameters are given for a prepared
            scenario.
        InvalidFile: a file is missing, malformed or breaks its standard.
        Unsupported: the scenario asks for something that the runner does not do.

    Example:
        >>> import xosc_toolchain as xt
        >>> with xt.Session("xosc/library/simple_cut_in.xosc", world="kinematic") as session:
        ...     before = session.observation.ego.speed
        ...     more = session.step(xt.Control(acceleration=-2.0))
        ...     round(session.observation.ego.speed - before, 3)
        -0.1
    """

    def __init__(
        self,
        scenario: str | PathLike[str] | Compiled,
        settings: RunSettings | None = None,
        *,
        parameters: Mapping[str, Argument] | None = None,
        **changes: Unpack[SettingChanges],
    ) -> None:
        # Who commands the ego also decides when the run is over: a contact does not end it.
        if settings is None and "sut" not in changes:
            changes = {"sut": Commanded(), "end_after_collision": False, **changes}
        self.settings = chosen = RunSettings.chosen(settings, changes)
        if isinstance(scenario, Compiled):
            if parameters is not None:
                raise UsageError(
                    "a prepared scenario has its parameters already: give them to runner.prepare"
                )
            self._compiled = scenario
        else:
            self._compiled = compile_file(scenario, parameters, chosen)
        compiled = self._compiled.scenario
        # A prepared scenario may have been resolved without constraints, and run with them.
        if chosen.enforce_constraints and compiled.violations:
            raise compiled.violations[0]
        self._ego = ego = self._compiled.ego(chosen.ego)
        self._sim = sim = Simulation(
            compiled, open_world(chosen.world), chosen.timestep, chosen.seed, strict=chosen.strict
        )
        for violation in compiled.violations:
            sim.note("constraint", "parameters", str(violation))
        self._departures = Departures(ego)
        sim.observers.append(self._departures)
        # 0.3 / 0.1 is 2.999…: without the slack the last step of a time limit would be missing.
        self._steps = math.floor(chosen.max_time / chosen.timestep + 1e-6)
        self._status, self._seen = "timeout", 0
        self._ends_after_collision = chosen.ends_after_collision
        self._system: System | None = None
        try:
            sut, self._unused = with_parameters(chosen.sut, compiled.parameters)
            self._system = open_system(sut, chosen.sut_in_process, chosen.sut_timeout)
            if ego is not None and self._system is not None:
                sim.drive_ego(
                    ego, driver_of(compiled, ego, self._system, chosen.timestep, chosen.seed)
                )
            sim.begin()
        # A process has one SUMO: after an interruption, too, it must not stay open.
        except BaseException:
            with suppress(ToolchainError):  # what has failed first is told
                self.close()
            raise

    # stepping -------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulation time, s."""
        return self._sim.time

    @property
    def running(self) -> bool:
        """Whether there is a step left: false once the scenario or its time limit has ended the
        run."""
        return not self._sim.finished and self._sim.step_index < self._steps

    @property
    def observation(self) -> Observation | None:
        """Current observation of the ego's driver; None without an ego, or while it is absent."""
        ego = self._ego
        if ego is None or not (ego.active and ego.placed):
            return None
        return observe(self._sim, ego, ego.controls.target_speed)

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of the participants that the ego has touched, in the order of the first
        contacts."""
        ego = self._ego.name if self._ego is not None else None
        pairs = (names for _, *names in self._sim.contacts.history if ego in names)
        return tuple(dict.fromkeys(second if first == ego else first for first, second in pairs))

    def step(self, control: Control | Pose | None = None) -> bool:
        """Do one time step; whether there is another one.

        Args:
            control: of the ego in this step; fields left out, or all where it is None, stay
                scripted.

        Raises:
            UsageError: the run is over; or a control is given that has no finite numbers, or for an
                ego that a system under test drives, or that does not exist.
            ToolchainError: the system under test fails.
        """
        if not self.running:
            raise self._refused(f"the run has ended at {self.time:g} s")
        if control is not None:
            self._check(control)
        # A command holds for one step: one that is left out must not repeat the last.
        if isinstance(self._system, Commanded):
            self._system.command = control or Control()
        self._advance()
        return self.running

    def finish(self, progress: Callable[[float], object] | None = None) -> RunResult:
        """Step until the run ends, close it, and return its result.

        Args:
            progress: called after each step with the simulation time (s).
        """
        # The rest is the scenario's: the last command of the caller must not go on.
        if isinstance(self._system, Commanded):
            self._system.command = Control()
        try:
            while self.running:
                self._advance()
                if progress is not None:
                    progress(self.time)
        except BaseException:
            with suppress(ToolchainError):  # what has failed first is told
                self.close()
            raise
        self.close()
        return self.result()

    def _check(self, control: Control | Pose) -> None:
        """Refuse a control that the ego can't be given."""
        if self._ego is None:
            raise self._refused("the scenario has no ego that step() could control")
        if not isinstance(self._system, Commanded):
            raise self._refused(
                f"{system_name(self.settings.sut)!r} drives the ego: leave `sut` out to control "
                "it by step()"
            )
        if not is_finite(control):
            raise self._refused(f"step() was given {control}, finite numbers are expected")

    def _refused(self, message: str) -> UsageError:
        return UsageError(message, path=self._compiled.scenario.path)

    def _advance(self) -> None:
        sim = self._sim
        sim.tick()
        # `touched` walks the whole history, so it is asked only after a new contact of anyone.
        if (
            self._ends_after_collision
            and self._status != "collision"
            and len(sim.contacts.history) > self._seen
        ):
            self._seen = len(sim.contacts.history)
            last = sim.step_index + round(_AFTER_COLLISION / self.settings.timestep)
            # A time limit that comes first keeps its own status.
            if self.touched and last < self._steps:
                self._steps, self._status = last, "collision"
        # The last step of a limit: actions that are under way are told in the remarks.
        if self._status == "timeout" and sim.step_index == self._steps and not sim.finished:
            sim.leave_off()

    # what it leaves behind ------------------------------------------------------------------

    def result(self) -> RunResult:
        """The run so far."""
        sim, ego, system, compiled = self._sim, self._ego, self._system, self._compiled.scenario
        recording = sim.recorder.recording()
        driven = ego if system is not None else None
        asked = system_name(self.settings.sut)
        limits = (limit.criterion for limit in self.settings.limits)
        by_limits = (criterion for criterion in limits if criterion is not None)
        criteria = results_of_criteria(
            (*self._compiled.criteria, *by_limits), compiled, sim.contacts, recording, ego
        )
        observed = Observed(compiled, sim, recording, self._departures, ego, asked, criteria)
        verdict = judge(sim.contacts, ego, criteria, collect(observed, self.settings.least_values))
        sut = asked if ego is not None else "none"
        remarks = (
            *map(str, (*compiled.remarks, *sim.remarks.found)),
            *controller_remarks(
                compiled.entities.values(),
                compiled.activated,
                driven,
                cruise_speed(compiled, driven) if driven else None,
            ),
            *absences(compiled.path, compiled.entities.values()),
            *(
                egoless(compiled.entities.values(), asked, sim.contacts.history)
                if ego is None
                else ()
            ),
            *sim.rests,
            *self._departures.remarks,
            *standstill(recording.tracks.get(ego.name) if ego is not None else None, sut),
            *jolts(
                recording.tracks[entity.name]
                for entity in sim.entities.values()
                if entity is not ego and entity.at_road_end and entity.name in recording.tracks
            ),
            *idleness(compiled.storyboard, sim),
            *untested_remarks(sim),
            *not_driven(observed),
            *(
                f"{OF_SYSTEM}{name}: {split(asked)[0]} has no parameter {name}, and keeps its own"
                for name in self._unused
            ),
            *criteria_remarks(self._compiled.criteria),
            *red_light_remarks(self._compiled.criteria, compiled, recording, ego),
        )
        result = RunResult(
            scenario=compiled.path,
            parameters={name: str(value) for name, value in self._compiled.parameters.items()},
            status="completed" if sim.finished else self._status,
            end_time=sim.time,
            verdict=verdict,
            # Loading, running and judging may remark the same: each is told once, in order.
            remarks=tuple(dict.fromkeys(remarks)),
            ego=ego.name if ego is not None else None,
            sut=sut,
            settings={
                name: getattr(self.settings, name)
                for name in ("timestep", "seed", "world", "max_time")
            },
            events=sim.log,
            recording=recording,
            sut_parameters=parameters_of(system) if driven is not None else {},
            actors=compiled.storyboard.actors,
        )
        # Limits are last: measures are worked out from the finished result.
        apply_limits(result, self.settings.limits, self.settings.least_values)
        return result

    def close(self) -> None:
        """Free the simulator and the system under test; the results stay.

        Raises:
            ToolchainError: the system under test fails while it ends.
        """
        # The world goes first: a system that fails while it ends must not leave SUMO open.
        self._sim.world.close()
        end = getattr(self._system, "close", None)
        if end is not None and self._system is not None:
            try:
                end()
            except RAISED as error:
                raise failed(self._system, error, self.time) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def open_world(name: str) -> World:
    """The world of a name in `runner.judging.settings.WORLDS`."""
    if name == "kinematic":
        from runner.engine.worlds.base import KinematicWorld

        return KinematicWorld()
    from runner.engine.worlds.sumo import SumoWorld

    return SumoWorld()


def run(
    scenario: str | PathLike[str],
    settings: RunSettings | None = None,
    *,
    parameters: Mapping[str, Argument] | None = None,
    progress: Callable[[float], object] | None = None,
    **changes: Unpack[SettingChanges],
) -> RunResult:
    """Run a scenario file to its end.

    Args:
        scenario: an OpenSCENARIO file of kind scenario, or the name of a shipped one.
        settings: how to run it; those of the project (`RunSettings.of_project`) where not given.
        parameters: values of its global parameters.
        progress: called after each step with the simulation time (s).
        changes: settings by name, as `timestep=0.1, sut="none"`, that replace those of `settings`.

    Raises:
        UsageError: a setting or parameter is wrong.
        InvalidFile: a file is missing, malformed or breaks its standard.
        Unsupported: the scenario asks for something that the runner does not do.

    Example:
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", parameters={"CutIn_Gap_m": 12},
        ...                 sut="adas", world="kinematic")
        >>> result.status, result.verdict.outcome
        ('completed', 'passed')
    """
    chosen = RunSettings.chosen(settings, changes)
    return prepare(scenario, parameters, chosen).run(chosen, progress=progress)


class Rehearsed(NamedTuple):
    """Facts known before a run: its assumptions, and causes for an inconclusive verdict."""

    remarks: tuple[str, ...]
    causes: tuple[Cause, ...]


@dataclass(frozen=True, eq=False)
class Prepared(Compiled):
    """Scenario file compiled with parameter values, for any number of consecutive runs.

    Each run begins anew: it gives the same results as in a process of its own. Settings, and with
    them the system under test, the seed and the world, may differ from run to run. Other parameter
    values need another `prepare`, because any element may depend on them; the parsed files, the
    road network and SUMO's network are kept between these by the process.

    Args:
        scenario: what the file was compiled to.
        parameters: the values that it was given.
        criteria: declared in its stop triggers, for its ego.

    Example:
        >>> import xosc_toolchain as xt
        >>> prepared = xt.prepare("xosc/library/simple_cut_in.xosc")
        >>> [prepared.run(sut=sut, world="kinematic", max_time=1.0).sut for sut in ("cas", None)]
        ['cas', 'none']
    """

    def rehearse(self, settings: RunSettings | None = None) -> Rehearsed:
        """Make the initial step of a run, at time 0 and without a simulator.

        Raises:
            UsageError: there is no such ego.
            InvalidFile: an initial action, or one that starts at time 0, can't be done.
            Unsupported: likewise.
        """
        from runner.engine.worlds.base import RehearsalWorld

        chosen = settings or RunSettings.of_project()
        sim = Simulation(
            self.scenario, RehearsalWorld(), chosen.timestep, chosen.seed, strict=chosen.strict
        )
        ego = self.ego(chosen.ego)
        departures = Departures(ego)
        sim.begin()
        departures(sim)
        recording, system = sim.recorder.recording(), system_name(chosen.sut)
        observed = Observed(self.scenario, sim, recording, departures, ego, system, ended=False)
        causes = missing(collect(observed, chosen.least_values))
        return Rehearsed(tuple(map(str, (*self.scenario.remarks, *sim.remarks.found))), causes)

    def run(
        self,
        settings: RunSettings | None = None,
        *,
        progress: Callable[[float], object] | None = None,
        **changes: Unpack[SettingChanges],
    ) -> RunResult:
        """Run it to its end; arguments and errors as in `runner.run`."""
        return Session(self, settings or RunSettings.of_project(), **changes).finish(progress)


def prepare(
    scenario: str | PathLike[str],
    parameters: Mapping[str, Argument] | None = None,
    settings: RunSettings | None = None,
    **changes: Unpack[SettingChanges],
) -> Prepared:
    """Load, resolve and compile a scenario file; arguments and errors as in `run`.

    Of the settings those count that say how files are read.

    Example:
        >>> import xosc_toolchain as xt
        >>> prepared = xt.prepare("xosc/library/simple_cut_in.xosc", {"CutIn_Gap_m": 12})
        >>> prepared.parameters
        {'CutIn_Gap_m': 12}
    """
    compiled = compile_file(scenario, parameters, RunSettings.chosen(settings, changes))
    return Prepared(compiled.scenario, compiled.parameters, compiled.criteria)
