"""From a manoeuvre scenario to files of failures that an adversary brings about
within the episode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from generation.search.outcomes import JUDGES, Outcomes, SimulationJob, Simulator
from generation.space import SpaceChoice
from generation.space.density.models import JUDGE
from generation.space.density.prior import until_possible
from generation.space.density.roles import EGO_SPEED, roles_of
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import CUT_IN
from runner.judging.settings import RunSettings
from runner.systems import system_name
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from schemas.common.storage import alone
from studies.generation.adversary.actions import DECISIONS, INTERVAL, OWN, Actions
from studies.generation.adversary.course import Scene
from studies.generation.adversary.driving import Driving
from studies.generation.adversary.environment import Episodes
from studies.generation.adversary.files import Writer
from studies.generation.adversary.search import AdversarySettings, Round, Starts, search
from xosc.writing.tags import Tag

_START = ("gap", "start_speed", EGO_SPEED)


@dataclass(frozen=True)
class Settings:
    """Settings of the search.

    Attributes:
        run: how scenarios are run, with the system under test.
        budget: most runs. most: most files.
        seed: of the search.
        recorded: a table of recorded actions; None for our own.
        processes, ray: as of `generation.search.outcomes.Simulator`.
        pinned: values of parameters of the scenario that are not drawn.
        search: how the adversary searches.
    """

    run: RunSettings = field(default_factory=RunSettings)
    budget: int = 300
    most: int = 100
    seed: int = 0
    recorded: Path | None = None
    processes: int = 2
    ray: str | None = None
    pinned: Mapping[str, str] = field(default_factory=dict)
    search: AdversarySettings = field(default_factory=AdversarySettings)


@dataclass(frozen=True)
class Written:
    """Result of the search.

    Attributes:
        files: scenarios, each of which fails as in the search. found: failures in arrays, those
            that were not run as well.
        tried: how many of these were run. rounds: how the search went.
        survived: how many of the files each of the judges survives. world: where they were run.
    """

    files: list[Path]
    found: int
    tried: int
    rounds: list[Round]
    survived: dict[str, int]
    world: str


def generate(
    scenario: Path,
    out: Path,
    settings: Settings,
    progress: Callable[[int], None] = lambda episodes: None,
) -> Written:
    """Have an adversary learn in arrays, write what it finds, and run every file: those that fail
    to the step stay.

    Raises:
        Unsupported: the scenario or the system is nothing that plays in arrays.
        UsageError: too little is recorded, or something is in the way in the folder.
        InvalidFile: a file is malformed.
    """
    with alone(out, "a search"):
        return _generated(scenario, out, settings, progress)


def _generated(
    scenario: Path, out: Path, settings: Settings, progress: Callable[[int], None]
) -> Written:
    run = settings.run
    scene = Scene.of(scenario, run)
    driving = Driving(Actions.read(settings.recorded or OWN))
    starts = starts_of(scenario, settings.pinned)
    found = search(
        scene, driving, starts, run.sut, run.timestep, settings.seed, settings.search, progress
    )
    count = min(len(found.failures.contact), settings.most, settings.budget // (1 + len(JUDGES)))
    writer, files = Writer(scenario, scene, out, run.timestep, run), []
    for row in range(count):
        files.append(
            writer.write(found.failures, row, row, _tags(found.failures, row, driving, settings))
        )
    outcomes = _run(files, settings)
    own = outcomes[system_name(run.sut)]
    same = np.abs(own.conflict - found.failures.contact[:count] * run.timestep) < 0.5 * run.timestep
    confirmed = (
        own.collision & same & np.any([outcomes[judge].survived for judge in JUDGES], axis=0)
    )
    for path in [path for path, kept in zip(files, confirmed, strict=True) if not kept]:
        writer.remove(path)
    files = [path for path, kept in zip(files, confirmed, strict=True) if kept]
    survived = {judge: int((outcomes[judge].survived & confirmed).sum()) for judge in JUDGES}
    return Written(files, len(found.failures.contact), count, found.rounds, survived, run.world)


def starts_of(scenario: Path, pinned: Mapping[str, str]) -> Starts:
    """Draws how episodes begin, as recorded cut-ins do: foreseeable points of the scenario's
    parameters, those of the start.

    Raises:
        UsageError: the scenario has no parameters of a cut-in, or nothing that is recorded is
            within its limits.
    """
    space = Space.of(scenario, SpaceChoice(pinned=pinned))
    prior = of_samples(of_recordings(None, CUT_IN), space).prior(space, JUDGE)
    names = {role.role: name for name, role in roles_of([*space.names, *space.pinned]).items()}
    missing = [role for role in _START if role not in names]
    if missing:
        raise UsageError(
            f"an adversary needs a scenario with a parameter that is the {missing[0]} of a cut-in",
            path=scenario,
        )

    def starts(n: int, generator: np.random.Generator) -> FloatArray:
        theta = until_possible(prior.sample, prior.foreseeable, n, generator)
        values = {
            **{name: np.full(n, float(value)) for name, value in space.pinned.items()},
            **space.by_name(theta),
        }
        return np.stack([values[names[role]] for role in _START], axis=1)

    return starts


def _run(files: list[Path], settings: Settings) -> dict[str, Outcomes]:
    """Run the files with the system under test, and with the judges."""
    systems = dict.fromkeys([system_name(settings.run.sut), *JUDGES])
    with Simulator(run=settings.run, processes=settings.processes, ray=settings.ray) as simulator:
        jobs = [
            SimulationJob(f"{name} {path.stem}", path, path, {}, sut=name)
            for name in systems
            for path in files
        ]
        outcomes = simulator.of(jobs)
    return {
        name: outcomes.take(np.arange(len(files)) + number * len(files))
        for number, name in enumerate(systems)
    }


def _tags(episodes: Episodes, row: int, driving: Driving, settings: Settings) -> list[Tag]:
    decisions = int(
        np.clip(np.ceil(episodes.contact[row] * settings.run.timestep / INTERVAL), 1, DECISIONS)
    )
    return [
        Tag("SearchMethod", "adversary"),
        Tag("SystemUnderTest", system_name(settings.run.sut)),
        Tag("Seed", float(settings.seed)),
        Tag("Timestep", settings.run.timestep),
        Tag("ConflictTime", round(float(episodes.contact[row]) * settings.run.timestep, 6)),
        Tag("LogLikelihood", round(float(episodes.log_density[row]), 6)),
        Tag("LeastLogLikelihood", round(float(driving.least[decisions - 1]), 6)),
    ]
