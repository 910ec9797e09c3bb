"""Runs step by step: the same as at once, driven by the caller, one on SUMO at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner.systems import Control
from runner.systems.kinds.commanded import Scripted
from schemas.common.errors import UsageError
from tests.conformance.support import at, track
from tests.runner.files import scenario

WORLDS = ("kinematic", "sumo")


@pytest.mark.parametrize("world", WORLDS)
def test_step_by_step_is_the_same_as_at_once(tmp_path: Path, world: str) -> None:
    file = scenario(tmp_path, stop=1.0)
    with runner.Session(file, world=world, sut="idm") as session:
        times = [session.time]
        while session.step():
            times.append(session.time)
    assert times == [round(0.05 * step, 9) for step in range(20)]
    result, whole = session.result(), runner.run(file, world=world, sut="idm")
    assert (result.status, result.end_time) == (whole.status, whole.end_time) == ("completed", 1.0)
    assert result.trajectories.equals(whole.trajectories)
    assert result.events == whole.events


@pytest.mark.parametrize("world", WORLDS)
def test_the_caller_drives_the_ego(tmp_path: Path, world: str) -> None:
    file = scenario(tmp_path, stop=3.0)
    with runner.Session(file, world=world) as session:
        while session.running:
            seen = session.observation
            assert (
                seen is not None
                and seen.time == session.time
                and [other.name for other in seen.others] == ["Lead"]
            )
            session.step(
                Control(acceleration=-2.0, reason="braking") if session.time >= 1.0 else None
            )
    braking = Scripted([(1.0, Control(acceleration=-2.0, reason="braking"))])
    scripted = runner.run(file, world=world, sut=braking)
    result = session.result()
    assert at(track(result, "Ego"), 3.0, "speed") == pytest.approx(16.0)
    assert result.trajectories.equals(scripted.trajectories)
    assert result.events == scripted.events


def test_contacts_of_the_ego_are_known_at_once(tmp_path: Path) -> None:
    file = scenario(tmp_path, stop=20.0)
    with runner.Session(file, world="kinematic", end_after_collision=True) as session:
        while session.step(Control(acceleration=1.0)) and not session.touched:
            pass
        collided = session.time
        result = session.finish()
    assert session.touched == ("Lead",)
    assert (result.status, result.end_time) == ("collision", pytest.approx(collided + 1.0))
    assert result.verdict.reasons == (f"collision with Lead at {collided:.2f} s",)


def test_a_prepared_scenario_and_settings(tmp_path: Path) -> None:
    prepared = runner.prepare(scenario(tmp_path, stop=1.0), {"Ego_Speed": 15})
    for _ in range(2):
        with runner.Session(
            prepared, runner.RunSettings(world="kinematic", sut="none", timestep=0.1)
        ) as session:
            assert session.observation is not None and session.observation.ego.speed == 15.0
            assert session.finish().sut == "none"


def test_wrong_calls_are_refused(tmp_path: Path) -> None:
    file = scenario(tmp_path, stop=0.1)
    with (
        runner.Session(file, world="kinematic", sut="cas") as session,
        pytest.raises(UsageError, match="'cas' drives the ego"),
    ):
        session.step(Control(acceleration=1.0))
    with runner.Session(file, world="kinematic") as session:
        with pytest.raises(UsageError, match="finite numbers are expected"):
            session.step(Control(steering=float("nan")))
        session.finish()
        with pytest.raises(UsageError, match=r"the run has ended at 0\.1 s"):
            session.step()
    with pytest.raises(UsageError, match=r"give them to runner\.prepare"):
        runner.Session(runner.prepare(file), parameters={"Gap": 3})


def test_a_second_session_on_sumo_is_refused_until_the_first_is_closed(tmp_path: Path) -> None:
    file = scenario(tmp_path, stop=0.2)
    with runner.Session(file) as first:
        with pytest.raises(UsageError, match="which can hold one: close it"):
            runner.Session(file)
        assert first.step()
    assert runner.run(file).status == "completed"
