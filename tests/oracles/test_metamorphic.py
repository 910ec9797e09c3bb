"""Scenarios of the library under changes that must not matter: the same verdict,
and motion within bounds.

A new pick each week (XOSC_METAMORPHIC_SEED for another) in the quick tests, all in the slow ones.
"""

from __future__ import annotations

import os
from datetime import date
from pathlib import Path
from random import Random

import numpy as np
import pytest

import runner
from runner.judging.result import RunResult
from runner.systems import Control, Observation, Participant
from tests.oracles.metamorphic import CHANGES, PlaneMap, applies, names, same, write
from tests.oracles.mutants import LIBRARY
from tests.runner.files import car, scenario

WEEK = date.today().isocalendar()
SEED = int(os.environ.get("XOSC_METAMORPHIC_SEED", WEEK.year * 100 + WEEK.week))
QUICK = sorted(Random(SEED).sample(names(), 4))
BOUNDS = {"renamed": 0.0, "reordered": 0.0, "moved": 1e-3, "mirrored": 1e-3}
"""Distance (m) that a place may differ by at any time"""


def played(path: Path, **settings: object) -> RunResult:
    wanted = {"world": "kinematic", "sut": "none", "timestep": 0.1, "max_time": 30.0} | settings
    return runner.run(path, **wanted)  # type: ignore[arg-type]


def verdict(result: RunResult) -> str:
    return result.verdict.outcome


def distance(a: RunResult, b: RunResult, mapped: PlaneMap = same) -> float:
    """Greatest distance (m) of the participants of two runs at common times, in
    declared order of places at time 0.
    """
    worst = 0.0
    begin = {
        tuple(np.round(mapped(t.columns["x"][0], t.columns["y"][0]), 2) + 0.0): t
        for t in a.recording.tracks.values()
    }
    for track in b.recording.tracks.values():
        place = np.array([track.columns["x"][0], track.columns["y"][0]])
        own = begin[min(begin, key=lambda at: float(np.hypot(*(np.array(at) - place))))]
        _, rows, its = np.intersect1d(
            np.round(own.columns["time"], 6),
            np.round(track.columns["time"], 6),
            return_indices=True,
        )
        x, y = mapped(own.columns["x"][rows], own.columns["y"][rows])  # type: ignore[arg-type]
        off = np.hypot(x - track.columns["x"][its], y - track.columns["y"][its])
        worst = max(worst, float(off.max()))
    return worst


def check_change(name: str, change: str, folder: Path, sut: str = "none") -> None:
    """Changed files give the same verdict and end, and the mapped motion."""
    if not applies(change, name):
        pytest.skip("a route of a catalogue")
    before = played(LIBRARY / f"{name}.xosc", sut=sut)
    path, mapped = write(name, change, folder)
    after = played(path, sut=sut)
    assert verdict(after) == verdict(before), (after.verdict, before.verdict)
    assert after.end_time == pytest.approx(before.end_time, abs=1e-6)
    assert distance(before, after, mapped) <= BOUNDS[change]


def check_timestep(name: str, sut: str = "none") -> None:
    """Half the step: the same verdict; motion may differ by what is driven in
    three steps, as triggers fire by steps.
    """
    before = played(LIBRARY / f"{name}.xosc", sut=sut)
    after = played(LIBRARY / f"{name}.xosc", sut=sut, timestep=0.05)
    assert verdict(after) == verdict(before), (after.verdict, before.verdict)
    assert after.end_time == pytest.approx(before.end_time, abs=0.31)
    fastest = max(np.abs(t.columns["speed"]).max() for t in before.recording.tracks.values())
    assert distance(before, after) <= 0.3 * fastest + 0.5


def check_world(name: str) -> None:
    """SUMO beside the kinematic world: scripted motion is the same in both."""
    before = played(LIBRARY / f"{name}.xosc")
    after = played(LIBRARY / f"{name}.xosc", world="sumo")
    assert verdict(after) == verdict(before), (after.verdict, before.verdict)
    assert distance(before, after) <= 1e-3


@pytest.mark.parametrize("name", QUICK[:2])
@pytest.mark.parametrize("change", CHANGES)
def test_changes_that_do_not_matter(name: str, change: str, tmp_path: Path) -> None:
    check_change(name, change, tmp_path)


class Watching:
    """Keeps what it observes: time (s), and places (m) of the ego and the other one."""

    def __init__(self) -> None:
        self.seen: list[tuple[float, float, float]] = []

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        pass

    def control(self, observation: Observation, dt: float) -> Control:
        (other,) = observation.others
        self.seen.append((observation.time, observation.ego.x, other.x))
        return Control()


@pytest.mark.parametrize("order", [("Ego", "Lead"), ("Lead", "Ego")])
def test_a_system_observes_everyone_at_one_time(order: tuple[str, str], tmp_path: Path) -> None:
    system = Watching()
    path = scenario(tmp_path, entities=[car(name) for name in order])
    played(path, sut=system)
    assert len(system.seen) == 20
    for time, own, other in system.seen:
        assert (own, other) == pytest.approx((100 + 20 * time, 150 + 10 * time))


@pytest.mark.parametrize("name", QUICK[2:])
def test_half_the_timestep(name: str) -> None:
    check_timestep(name)


@pytest.mark.slow
@pytest.mark.parametrize("sut", ["none", "cas"])
@pytest.mark.parametrize("name", names())
@pytest.mark.parametrize("change", CHANGES)
def test_changes_that_do_not_matter_in_the_library(
    name: str, change: str, sut: str, tmp_path: Path
) -> None:
    check_change(name, change, tmp_path, sut)


@pytest.mark.slow
@pytest.mark.parametrize("name", names())
def test_half_the_timestep_in_the_library(name: str) -> None:
    check_timestep(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", names())
def test_both_worlds_in_the_library(name: str) -> None:
    check_world(name)
