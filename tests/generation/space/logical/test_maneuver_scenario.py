"""What the logical scenarios script happens, seen from the trajectories of runs
without a system under test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import runner
from generation.space.logical.library import SCENARIOS, maneuver_scenarios
from generation.space.logical.maneuvers import ManeuverScenario
from recognition.labels.maneuvers.parameters import JERK, PARAMETERS, declared_name
from runner.judging.measures.relations import MotionRows, relations
from runner.recording import Track

PLOTS = dict(maneuver_scenarios())
STEP = 0.05
CLOSING, OPENING = -1.0, 1.5


@dataclass(frozen=True)
class Run:
    """A run with what was asked for, by role, and the tracks of the actor, the
    ego and its leader.
    """

    asked: dict[str, float]
    kept: float
    end: float
    tracks: dict[str, Track]
    plot: ManeuverScenario

    def row(self, time: float) -> int:
        return round(time / STEP)

    def actor(self, column: str, time: float) -> Any:
        return self.tracks[self.plot.maneuver.actor].columns[column][self.row(time)]

    def gap(self, time: float) -> float:
        ego, leader = (self.tracks[name] for name in ("Ego", self.plot.maneuver.leader))
        follower, lead = (
            MotionRows.from_columns(each.name, each.box, each.columns) for each in (ego, leader)
        )
        view = relations(follower, [lead]).view
        return float(view.ahead[self.row(time)])


def run(
    name: str,
    opening: float,
    gap: float = 20.0,
    time: float = 4.0,
    jerk: float = 15.0,
    rest: float = 2.0,
) -> Run:
    """A run in which leader and ego move apart with `opening` m/s before the
    manoeuvre, whose jerk is as great as may be.
    """
    plot = PLOTS[name]
    slow = plot.geometry.speeds[0] + 2.0
    actor_is_ego = plot.maneuver.actor == "Ego"
    start = slow - opening if actor_is_ego else slow + opening
    end = min(slow, plot.maneuver.braking[1] if plot.maneuver.braking else slow)
    values = (
        max(gap, plot.geometry.gaps[0]),
        start,
        time,
        end,
        3.0,
        min(end + 1.0, 10.0) if plot.maneuver.braking else end + 1.0,
        rest,
    )
    asked = dict(zip(PARAMETERS, values, strict=True))
    given = {declared_name(plot.maneuver.actor, role): str(value) for role, value in asked.items()}
    if plot.maneuver.jerk is not None:
        given[declared_name(plot.maneuver.actor, JERK)] = str(jerk)
    given[f"{plot.maneuver.leader if actor_is_ego else 'Ego'}_Speed_mps"] = str(slow)
    done = runner.run(
        SCENARIOS / f"{name}.xosc", parameters=given, sut=None, world="kinematic", timestep=STEP
    )
    assert done.verdict.passed, done.verdict.reasons
    return Run(asked, slow, done.end_time, done.recording.locate().tracks, plot)


@pytest.mark.parametrize("opening", [CLOSING, OPENING])
@pytest.mark.parametrize("name", PLOTS)
def test_the_gap_is_the_one_asked_for_when_the_manoeuvre_begins(name: str, opening: float) -> None:
    done = run(name, opening)
    assert done.gap(done.asked["start_time"]) == pytest.approx(done.asked["gap"], abs=0.01)
    assert done.gap(0.0) == pytest.approx(
        done.asked["gap"] - opening * done.asked["start_time"], abs=0.01
    )


@pytest.mark.parametrize("name", PLOTS)
def test_speeds_and_times_are_those_asked_for(name: str) -> None:
    done = run(name, OPENING)
    asked = done.asked
    start, end = asked["start_time"], asked["start_time"] + asked["duration"]
    assert (
        done.actor("speed", 0.0)
        == done.actor("speed", start)
        == pytest.approx(asked["start_speed"])
    )
    assert done.actor("speed", end) == pytest.approx(asked["end_speed"], abs=0.05)
    assert done.end == pytest.approx(end + asked["rest_time"], abs=2 * STEP)
    assert done.actor("speed", done.end) == pytest.approx(asked["final_speed"], abs=0.05)
    halfway = (asked["start_speed"] + asked["end_speed"]) / 2
    assert done.actor("speed", (start + end) / 2) == pytest.approx(halfway, abs=0.05)


@pytest.mark.parametrize("name", PLOTS)
def test_the_lane_changes_between_start_and_end_and_at_no_other_time(name: str) -> None:
    done = run(name, OPENING)
    plot, start = done.plot, done.asked["start_time"]
    columns = done.tracks[plot.maneuver.actor].columns
    rows = slice(0, done.row(start + done.asked["duration"]) + 1)
    lanes, offset = columns["lane_id"][rows], columns["lane_offset"][rows]
    before, after = (plot.geometry.left, plot.geometry.right)[
        :: -1 if plot.maneuver.change > 0 else 1
    ]
    if plot.maneuver.change == 0:
        assert set(lanes) == {plot.geometry.right}
        assert np.abs(offset).max() < 1e-6
        return
    assert set(lanes[: done.row(start)]) == {before}
    assert lanes[-1] == after
    assert np.abs(offset[: done.row(start) + 1]).max() < 1e-6
    assert abs(offset[-1]) < 0.05
    assert lanes[done.row(start + done.asked["duration"] / 2 + 0.1)] == after


def leads_in_lane(plot: ManeuverScenario) -> bool:
    return (
        plot.maneuver.actor == plot.maneuver.leader
        and plot.maneuver.ego_lane == plot.maneuver.leader_lane
    )


def begins_near(plot: ManeuverScenario) -> bool:
    return plot.geometry.gaps[0] <= 20.0


@pytest.mark.parametrize(
    "name", [name for name, plot in PLOTS.items() if leads_in_lane(plot) and begins_near(plot)]
)
def test_a_faster_leader_begins_with_a_gap_and_sooner(name: str) -> None:
    opening, gap = 6.0, 20.0
    done = run(name, opening, gap, time=9.0)
    assert done.gap(0.0) == pytest.approx(2.0, abs=0.01)
    assert done.gap(18.0 / opening) == pytest.approx(gap, abs=0.01)
    assert done.actor("speed", 18.0 / opening + 1.0) < done.actor("speed", 18.0 / opening)


@pytest.mark.parametrize(
    "name", [name for name, plot in PLOTS.items() if plot.maneuver.jerk is not None]
)
def test_a_change_with_a_jerk_lasts_longer_around_the_same_middle(name: str) -> None:
    opening, jerk = -OPENING, 0.5
    done = run(name, opening, jerk=jerk)
    asked = done.asked
    start, end = asked["start_time"], asked["start_time"] + asked["duration"]
    slope = (asked["end_speed"] - asked["start_speed"]) / asked["duration"]
    early = abs(slope) / jerk / 2.0
    speed = done.tracks[done.plot.maneuver.actor].columns["speed"]
    assert speed[done.row(start - early)] == pytest.approx(asked["start_speed"])
    assert (
        abs(speed[done.row(start - early + 0.2)] - asked["start_speed"]) > 0.5 * 0.5 * jerk * 0.2**2
    )
    assert speed[done.row(end + early)] == pytest.approx(asked["end_speed"], abs=0.01)
    assert done.actor("speed", (start + end) / 2) == pytest.approx(
        (asked["start_speed"] + asked["end_speed"]) / 2, abs=0.03
    )
    rates = np.diff(speed[: done.row(end + early)], n=2) / STEP**2
    assert np.abs(rates).max() <= jerk + 1e-3
    assert done.gap(0.0) - (asked["gap"] - opening * start) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("name", PLOTS)
def test_the_last_change_of_speed_is_comfortable_whatever_the_rest_time(name: str) -> None:
    done = run(name, OPENING, rest=0.1)
    speed = done.tracks[done.plot.maneuver.actor].columns["speed"]
    assert speed[-1] == pytest.approx(done.asked["final_speed"], abs=0.05)
    settling = np.flatnonzero(done.tracks["Ego"].columns["time"] > done.end - 1.0)[0]
    rates = np.abs(np.diff(speed[settling:], n=2)) / STEP**2
    assert 1.5 < rates.max() < 2.6
    assert done.end > done.asked["start_time"] + done.asked["duration"] + 1.3


def test_the_gap_is_waited_for_when_the_ego_is_late() -> None:
    values = {
        "CutIn_Gap_m": "10",
        "CutIn_StartTime_s": "2",
        "Ego_Speed_mps": "30",
        "CutIn_StartSpeed_mps": "20",
    }
    name = "cut_in_highway"
    late = runner.run(
        SCENARIOS / f"{name}.xosc", parameters=values, sut=Late(), world="kinematic", timestep=STEP
    )
    columns = late.recording.locate().tracks["CutIn"].columns
    begun = float(columns["time"][np.flatnonzero(np.abs(columns["lane_offset"]) > 0.001)[0]])
    ego = late.recording.tracks["Ego"].columns
    row = round(begun / STEP)
    assert begun > 3.0
    assert columns["s"][row] - ego["s"][row] - 4.5 == pytest.approx(10.5, abs=1.0)


class Late:
    """Brakes in the first second."""

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to forget."""

    def control(self, observation: Any, dt: float) -> Any:
        """Full braking, then nothing."""
        from runner.systems import Control

        return Control(acceleration=-8.0) if observation.time < 1.0 else Control()


@pytest.mark.parametrize("name", [name for name, plot in PLOTS.items() if plot.maneuver.ahead])
def test_the_leader_that_cuts_out_just_evades_the_slower_one(name: str) -> None:
    plot = PLOTS[name]
    speed = plot.geometry.speeds[0] + 4.0
    given = {
        "CutOut_StartSpeed_mps": speed,
        "CutOut_EndSpeed_mps": speed,
        "CutOut_FinalSpeed_mps": speed,
        "Slow_Speed_mps": 2.0,
    }
    given |= {"CutOut_Duration_s": 3.0, "CutOut_StartTime_s": 2.0, "Ego_Speed_mps": speed}
    parameters = {name: str(value) for name, value in given.items()}
    done = runner.run(
        SCENARIOS / f"{name}.xosc",
        parameters=parameters,
        sut=None,
        world="kinematic",
        timestep=STEP,
    )
    tracks = done.recording.locate().tracks
    motions = [
        MotionRows.from_columns(name, tracks[name].box, tracks[name].columns)
        for name in ("CutOut", "Slow")
    ]
    assert float(relations(motions[0], motions[1:]).view.ahead[round(5.0 / STEP)]) == pytest.approx(
        10.0, abs=0.7
    )


@pytest.mark.parametrize("name", [name for name, plot in PLOTS.items() if plot.maneuver.turns])
def test_the_leader_turns_off_when_it_has_braked(name: str) -> None:
    given = {
        "TurnOff_StartTime_s": "1",
        "TurnOff_RestTime_s": "6",
        "TurnOff_FinalSpeed_mps": "6",
        "Ego_Speed_mps": "4",
    }
    done = runner.run(
        SCENARIOS / f"{name}.xosc", parameters=given, sut=None, world="kinematic", timestep=STEP
    )
    tracks = done.recording.locate().tracks
    roads, plot = (
        {each: list(dict.fromkeys(tracks[each].columns["road_id"])) for each in ("Ego", "TurnOff")},
        PLOTS[name],
    )
    assert plot.geometry.turn is not None
    assert (roads["TurnOff"][0], roads["TurnOff"][-1]) == (
        plot.geometry.road,
        plot.geometry.turn.target.road,
    )
    assert roads["Ego"] == [plot.geometry.road]
