"""What a search leaves, made by hand: cut-ins on the kinematic world, two that
fail and one that does not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generation.estimation.estimate import Estimate
from generation.estimation.probability import Driving, Probability
from generation.pipeline import Generated, evidence, summary, summary_file
from generation.search.gate import Gate, Share
from generation.search.outcomes import REFERENCES, Cases, Episodes, Evaluator
from generation.search.problem import History
from generation.search.settings import SearchSettings
from generation.search.variations import Writer, Written
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import Recorded, of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.units import Exposure
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.storage import write_object

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)
HARD, WEAK, EASY = (
    [35.0, 12.0, 1.0, 12.0, 1.0, 12.0, 5.0, 40.0],
    [40.0, 18.0, 1.0, 18.0, 3.0, 18.0, 5.0, 30.0],
    [78.0, 36.0, 1.0, 36.0, 6.0, 36.0, 5.0, 30.0],
)
"""Gap, start speed, start time, end speed, duration, final speed, rest time, ego speed: nobody
prevents it, a system that brakes weakly fails, all survive"""
CHANCES = {
    "collision": Probability(2e-3, 2e-4, 90.0, 1.0),
    "preventable collision": Probability(1e-3, 2e-4, 60.0, 1.0),
    "impact at 0 to 5 m/s": Probability(2e-3, 2e-4, 90.0, 1.0),
}


def settings(sut: str) -> SearchSettings:
    return SearchSettings(RunSettings(sut=sut, timestep=0.1, world="kinematic"), processes=1)


def recorded() -> Recorded:
    return of_samples(of_recordings(None, "cut_in"), SPACE).within(SPACE)


def searched(sut: str, points: FloatArray, drawn: int = 0) -> Generated:
    """A search that has run these points, and others around them; those that
    collide are its edge cases.
    """
    theta = np.concatenate([points, SPACE.draw(drawn, np.random.default_rng(0))])
    chosen, real = settings(sut), recorded()
    with Evaluator(CUT_IN, SPACE, run=chosen.run, processes=1) as run:
        outcomes = run(theta)
        rows = np.flatnonzero(outcomes.collision)[: len(points)]
        drivers = {name: run(theta[rows], each) for name, each in REFERENCES.items()}
    cases = Cases(
        theta[rows], outcomes.take(rows), np.ones(len(rows)), -np.arange(len(rows)), drivers
    )
    history = History(theta, outcomes, np.ones(len(theta)))
    gate = Gate(Share(0, 30), Share(0, 30))
    driving = Driving(Exposure(10.0, 800.0, {"cut_in": 50}), "cut_in", 2, 50, 40)
    estimate = Estimate(CHANCES, 100, 0, 40, driving)
    prior = real.prior(SPACE, "gaussian")
    return Generated(
        SPACE, real, prior, history, Episodes(*history), cases, [], gate, 0, estimate,
        driving=driving,
    )  # fmt: skip


def written(generated: Generated, sut: str, folder: Path) -> Path:
    """The files of such a search."""
    writer = Writer(CUT_IN, SPACE, folder)
    writer.cases(generated.cases, evidence(settings(sut), len(generated.episodes.theta)))
    write_object(summary(CUT_IN, generated, settings(sut)), folder / summary_file(CUT_IN))
    Written(folder, CUT_IN.stem).note()
    return folder
