"""Systems under test in many runs at once: observations as arrays, and how any system is asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.surroundings import Environment
from runner.systems import Control, Observation, Participant
from runner.systems.array_systems import decides_together, open_arrays
from runner.systems.arrays import BatchControl, BatchObservation, BatchParticipants, stack
from runner.systems.base import SystemUnderTestError
from runner.systems.isolation.messages import ArrayReader, ArrayWriter
from runner.systems.kinds.commanded import SumoDriver
from runner.systems.kinds.fmu import Fmu
from schemas.common.errors import Unsupported, UsageError
from tests.runner.systems.situations import observations, situation

CAR = BoundingBox(0.0, 0.0, 0.75, 4.0, 2.0, 1.5)
ONE_BY_ONE = '''
from runner.systems import Control, Pose

class Counting:
    """Brakes by the number of its steps; some runs fail."""

    def __init__(self, gain: float = 1.0):
        self.gain = gain

    def reset(self, ego, timestep, seed):
        self.count, self.seed = 0, seed
        if seed == 3:
            raise ValueError("no run of mine")

    def control(self, seen, dt):
        self.count += 1
        if self.seed == 1 and self.count == 2:
            raise RuntimeError("in run 1")
        if self.seed == 2:
            return Pose(0.0, 0.0, 0.0)
        return Control(acceleration=-self.gain * self.count) if self.seed != 4 else Control(steering=0.1)
'''


def equal(one: Observation, other: Observation) -> bool:
    """Whether two observations hold the same; participants may be in a tuple or a list."""
    return one._replace(others=tuple(one.others)) == other._replace(others=tuple(other.others))


@settings(max_examples=50)
@given(st.lists(observations, min_size=1, max_size=5))
def test_what_is_stacked_is_there_again_run_by_run(many: list[Observation]) -> None:
    stacked = stack(many)
    assert stacked.others.x.shape == (max(len(each.others) for each in many), len(many))
    for place, each in enumerate(many):
        assert equal(stacked.observation(place), each)
    assert all(map(equal, stacked.observations(), many))


@settings(max_examples=50)
@given(st.lists(observations, min_size=2, max_size=5), st.data())
def test_some_runs_are_those_of_a_smaller_stack(many: list[Observation], data: Any) -> None:
    places = data.draw(st.lists(st.integers(0, len(many) - 1), min_size=1, unique=True))
    some = stack(many).take(sorted(places))
    assert some.run.tolist() == sorted(places)
    for place, number in enumerate(sorted(places)):
        assert equal(some.observation(place), many[number])


def test_nothing_can_not_be_stacked() -> None:
    with pytest.raises(ValueError, match="no observations"):
        stack([])


def several(n: int) -> BatchObservation:
    ego = Participant("Ego", "vehicle", "car", CAR, speed=10.0, vx=10.0)
    one = Observation(0.0, ego, (), 10.0, None, Environment())
    return stack([one] * n)


class Halving:
    """Decides in arrays, with a state for each run."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.wanted = ego.speed

    def control(self, observation: Observation, dt: float) -> Control:
        self.wanted *= 0.5
        return Control(acceleration=(self.wanted - observation.ego.speed) / dt)

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: Any) -> None:
        self.speeds = egos.speed.copy()

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        self.speeds[observations.run] *= 0.5
        return BatchControl((self.speeds[observations.run] - observations.ego.speed) / dt)


def test_a_system_that_decides_in_arrays_keeps_the_state_of_runs_that_are_absent() -> None:
    system, many = open_arrays(Halving()), several(3)
    assert system is not None
    system.reset(many.ego, 0.1, np.arange(3))
    assert system.control(many, 0.1).acceleration.tolist() == [-50.0, -50.0, -50.0]
    assert system.control(many.take([1]), 0.1).acceleration.tolist() == [-75.0]
    assert system.control(many, 0.1).acceleration.tolist() == [-75.0, -87.5, -75.0]


def test_one_without_is_asked_run_by_run_with_an_instance_each(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(ONE_BY_ONE)
    system, many = open_arrays(f"{tmp_path}/mine.py:Counting:gain=2", in_process=True), several(5)
    assert system is not None
    system.reset(many.ego, 0.1, np.arange(5))
    first, second = system.control(many, 0.1), system.control(many.take([0, 1, 4]), 0.1)
    assert first.acceleration.tolist() == [-2.0, -2.0, 0.0, 0.0, 0.0]
    assert first.accelerates.tolist() == [True, True, False, False, False]
    assert first.steering.tolist() == [0.0, 0.0, 0.0, 0.0, 0.1]
    assert first.steers.tolist() == [False, False, False, False, True]
    assert first.unanswered.tolist() == [False, False, True, True, False]
    assert second.acceleration.tolist() == [-4.0, 0.0, 0.0]
    assert second.unanswered.tolist() == [False, True, False]
    system.close()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (lambda n: None, "BatchControl is expected"),
        (lambda n: BatchControl(np.zeros(n + 1)), r"acceleration of shape \(3,\)"),
        (lambda n: BatchControl(np.array([1.0, np.nan])), "acceleration nan at place 1"),
        (lambda n: BatchControl(np.array(["a", "b"])), "other types than numbers"),
        # type: ignore[arg-type]
        (lambda n: BatchControl(np.zeros(n), np.zeros(n)), "other types than numbers"),
        # type: ignore[arg-type]
        (lambda n: BatchControl(steering=np.zeros((n, 1))), r"steering of shape \(2, 1\)"),
        (lambda n: 1 / 0, "division by zero"),
    ],
)
def test_a_fault_in_arrays_is_an_error_of_the_system_by_name(
    answer: Callable[[int], Any], told: str
) -> None:
    class Faulty(Halving):
        def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
            found: BatchControl = answer(len(observations.run))
            return found

        def control(self, observation: Observation, dt: float) -> Control:
            return Control()

    system, many = open_arrays(Faulty()), several(2)
    assert system is not None
    system.reset(many.ego, 0.1, np.arange(2))
    with pytest.raises(SystemUnderTestError, match=f"control_batch .*Faulty failed: .*{told}"):
        system.control(many, 0.1)


def test_numbers_that_do_not_count_may_be_anything() -> None:
    class Masked(Halving):
        def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
            return BatchControl(np.array([np.nan, -1.0]), np.array([False, True]))

    system = open_arrays(Masked())
    assert system is not None
    found = system.control(several(2), 0.1)
    assert (found.acceleration.tolist(), found.accelerates.tolist()) == ([0.0, -1.0], [False, True])


def test_a_law_that_replaces_control_alone_does_not_drive_by_the_arrays_of_its_base() -> None:
    class Mine(Halving):
        def control(self, observation: Observation, dt: float) -> Control:
            return Control()

    class Begins(Halving):
        def reset(self, ego: Participant, timestep: float, seed: int) -> None:
            self.wanted = 1.0

    assert decides_together(Halving)
    assert not decides_together(Mine)
    assert not decides_together(Begins)
    with pytest.raises(Unsupported, match="without a control_batch of its own"):
        open_arrays(Mine())


@pytest.mark.parametrize("name", ["sumo", "bridge", "fmu:none.fmu"])
def test_systems_of_one_run_a_process_are_refused_by_name(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Fmu, "check", lambda path: None)
    with pytest.raises(Unsupported, match=f"{name} can't drive many runs at once"):
        open_arrays(name)
    with pytest.raises(Unsupported, match="SumoDriver can't drive many runs at once"):
        open_arrays(SumoDriver())


def test_names_are_those_of_one_run() -> None:
    assert open_arrays("none") is None
    assert open_arrays(None) is None
    with pytest.raises(UsageError, match="no system under test is called 'nonesuch'"):
        open_arrays("nonesuch")
    with pytest.raises(UsageError, match="sensor_range of cas"):
        open_arrays("cas:sensor_range=-1")


def test_an_answer_is_read_run_by_run() -> None:
    control = BatchControl(np.array([-1.0, 2.0]), np.array([True, False]), np.array([0.1, 0.2]))
    assert control.control(0) == Control(-1.0, 0.1)
    assert control.control(1) == Control(None, 0.2)


# classes of users, in a process of their own ------------------------------------------------

TOGETHER = '''
import os
import numpy as np
from runner.systems import Control, WorldDriven
from runner.systems.arrays import BatchControl

class Keeps:
    """Brakes by what it sees."""

    def reset(self, ego, timestep, seed):
        self.before = ego.speed

    def control(self, seen, dt):
        raise AssertionError("run by run")

    def reset_batch(self, egos, timestep, seeds):
        self.seeds, self.names = seeds, egos.name

    def control_batch(self, observations, dt):
        there = observations.others.present.sum(axis=0)
        red = np.array([len(each) for each in observations.signals])
        wet = np.array([each.friction for each in observations.environment])
        wanted = self.seeds[observations.run] + there + 10.0 * red + 100.0 * wet + observations.time
        return BatchControl(wanted, observations.ego.name == "Ego")

class Exits(Keeps):
    def control_batch(self, observations, dt):
        os._exit(3)

class World(WorldDriven):
    pass
'''


@settings(max_examples=30)
@given(st.lists(observations, min_size=1, max_size=4), st.integers(0, 1 << 30))
def test_messages_of_a_batch_hold_all_that_is_seen(many: list[Observation], seed: int) -> None:
    writer, reader = ArrayWriter(), ArrayReader(lambda path, file: pytest.fail("no roads"))
    egos, timestep, seeds = reader.begin(
        writer.begin(stack(many).ego, 0.1, np.arange(len(many), dtype=np.int64))
    )
    assert (egos.participants(), timestep) == ([each.ego for each in many], 0.1)
    assert seeds.tolist() == list(range(len(many)))
    again = [each._replace(time=1.0, target_speed=3.0) for each in many]
    for step in (many, again, again[1:] or again):
        found, dt = reader.step(writer.step(stack(step), 0.1))
        assert dt == 0.1
        assert all(map(equal, found.observations(), step))


def test_a_class_of_the_user_decides_in_arrays_in_one_process_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "keeps.py").write_text(TOGETHER)
    many = stack([situation(seed, seed % 3) for seed in range(6)])
    found = []
    for in_process in (False, True):
        system = open_arrays(f"{tmp_path}/keeps.py:Keeps", in_process=in_process)
        assert system is not None
        assert system.together
        system.reset(many.ego, 0.1, np.arange(6))
        some = [many, many.take([1, 4]), many._replace(time=many.time + 1.0)]
        found.append([system.control(each, 0.1) for each in some])
        system.close()
    for one, other in zip(*found, strict=True):
        assert [each.tolist() for each in one] == [each.tolist() for each in other]


def test_one_without_arrays_is_asked_run_by_run_in_one_process(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(ONE_BY_ONE)
    system, many = open_arrays(f"{tmp_path}/mine.py:Counting:gain=2"), several(5)
    assert system is not None
    assert not system.together
    for _ in range(2):  # the second time begins anew
        system.reset(many.ego, 0.1, np.arange(5))
        assert system.control(many, 0.1).acceleration.tolist() == [-2.0, -2.0, 0.0, 0.0, 0.0]
        found = system.control(many.take([0, 1]), 0.1)
        assert (found.acceleration.tolist(), found.unanswered.tolist()) == (
            [-4.0, 0.0],
            [False, True],
        )
    system.close()


def test_a_process_that_ends_is_an_error_of_the_system_and_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(TOGETHER)
    system, many = open_arrays(f"{tmp_path}/mine.py:Exits"), several(2)
    assert system is not None
    system.reset(many.ego, 0.1, np.arange(2))
    with pytest.raises(SystemUnderTestError, match=r"mine.py:Exits failed .*ended with code 3"):
        system.control(many, 0.1)
    system.close()
    again = open_arrays(f"{tmp_path}/mine.py:Keeps")
    assert again is not None
    again.reset(many.ego, 0.1, np.arange(2))
    assert again.control(many, 0.1).acceleration.tolist() == [100.0, 101.0]
    again.close()
    with pytest.raises(Unsupported, match="World can't drive many runs at once"):
        open_arrays(f"{tmp_path}/mine.py:World")
