"""The reference drivers of UN Regulation 157, `aeb` and `idm`: when they react,
and how they brake, worked out by hand.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import runner
from runner.engine.motion.rss import PARAMETERS, longitudinal_distance
from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.signals_ahead import StopLine
from runner.engine.worlds.surroundings import Environment
from runner.systems import Control, Observation, Participant, SystemUnderTest, load_system
from runner.systems.encounters import encounters
from runner.systems.kinds.aeb import EmergencyBraking
from runner.systems.kinds.idm import IntelligentDriver
from runner.systems.kinds.reference import (
    CarefulCompetent,
    FuzzySafety,
    Regulation157,
    SafeDistance,
)

CAR = BoundingBox(0.0, 0.0, 0.75, 4.0, 2.0, 1.5)
CUT_IN = Path(__file__).parents[3] / "xosc" / "library" / "r157_cut_in.xosc"


def entity(
    name: str, x: float, y: float, vx: float, vy: float = 0.0, h: float = 0.0
) -> Participant:
    speed = vx * math.cos(h) + vy * math.sin(h)
    return Participant(name, "vehicle", "car", CAR, x=x, y=y, h=h, speed=speed, vx=vx, vy=vy)


def seen(ego_speed: float, *others: Participant) -> Observation:
    return Observation(
        0.0, entity("Ego", 0.0, 0.0, ego_speed), others, ego_speed, None, Environment()
    )


def ready(system: SystemUnderTest, dt: float = 0.1) -> SystemUnderTest:
    system.reset(entity("Ego", 0.0, 0.0, 0.0), dt, 0)
    return system


def decelerations(
    system: SystemUnderTest, observation: Observation, steps: int, dt: float = 0.1
) -> list[float]:
    ready(system, dt)
    answers = [system.control(observation, dt) for _ in range(steps)]
    return [-(answer.acceleration or 0.0) for answer in answers]


def test_gaps_and_speeds_are_those_of_the_egos_frame() -> None:
    (left,) = encounters(seen(20.0, entity("Left", 24.0, 3.5, 15.0, -1.0)))
    assert left == ("Left", 20.0, 1.5, 8.0, 15.0, 5.0, 1.0)
    (right,) = encounters(seen(20.0, entity("Right", 24.0, -3.5, 15.0, -1.0)))
    assert (right.aside, right.approach) == (1.5, -1.0)
    (ahead,) = encounters(seen(20.0, entity("Ahead", 24.0, 1.0, 15.0)))
    assert (ahead.aside, ahead.time_to_collision) == (-1.0, 4.0)
    assert not list(encounters(seen(20.0, entity("Behind", -1.0, 0.0, 15.0))))


def test_an_encounter_turns_with_the_ego() -> None:
    ego = entity("Ego", 0.0, 0.0, 0.0, 10.0, math.pi / 2)
    observation = Observation(
        0.0, ego, (entity("Left", -3.5, 24.0, 1.0, 8.0, math.pi / 2),), 10.0, None, Environment()
    )
    (found,) = encounters(observation)
    assert found[1:] == pytest.approx((20.0, 1.5, 8.0, 8.0, 2.0, 1.0))


def test_careful_and_competent_reacts_after_its_time_and_builds_up_its_braking() -> None:
    danger = seen(20.0, entity("Lead", 4.0 + 15.0, 0.0, 10.0))
    found = decelerations(CarefulCompetent(), danger, 20)
    assert found[:8] == [0.4] * 8  # 0.75 s, in steps of 0.1 s
    assert found[8:10] == pytest.approx([0.4 + 1.265, 0.4 + 2 * 1.265])
    assert found[-1] == pytest.approx(0.774 * 9.81)


@pytest.mark.parametrize(
    ("gap", "aside", "reacts"), [(19.9, 0.0, True), (20.1, 0.0, False), (19.9, 0.1, False)]
)
def test_careful_and_competent_reacts_to_who_is_in_its_way_within_two_seconds(
    gap: float, aside: float, reacts: bool
) -> None:
    other = entity("Other", 4.0 + gap, 2.0 + aside if aside else 1.0, 10.0)
    assert any(decelerations(CarefulCompetent(), seen(20.0, other), 1)) == reacts


@pytest.mark.parametrize(
    ("gap", "aside", "reacts"), [(12.8, 0.5, True), (12.9, 0.5, False), (12.8, 0.6, False)]
)
def test_the_regulation_reacts_by_what_braking_to_the_others_speed_takes(
    gap: float, aside: float, reacts: bool
) -> None:
    # Δv = 10 m/s: 10/12 + 0.45 = 1.2833 s, so 12.83 m
    found = decelerations(
        Regulation157(), seen(20.0, entity("Other", 4.0 + gap, 2.0 + aside, 10.0)), 5
    )
    assert found == ([0.0] * 4 + [6.0] if reacts else [0.0] * 5)


def test_rss_reacts_below_both_safe_distances() -> None:
    safe = longitudinal_distance(20.0, 10.0, PARAMETERS["r157"])
    aside = 0.3 + 0.75**2 / 2 + 0.75**2 / 2  # margin, 0.75 s at 1 m/s², braking at 1 m/s²
    for gap, lateral, reacts in ((-0.1, -0.01, True), (0.1, -0.01, False), (-0.1, 0.01, False)):
        other = entity("Other", 4.0 + safe + gap, 2.0 + aside + lateral, 10.0)
        assert any(decelerations(SafeDistance(), seen(20.0, other), 12)) == reacts


def test_fuzzy_metrics_are_those_of_the_paper() -> None:
    ego = entity("Ego", 0.0, 0.0, 20.0)
    (found,) = encounters(seen(20.0, entity("Lead", 4.0 + 40.0, 0.0, 10.0)))
    safe, unsafe = 15.0 + 400.0 / 8 - 100.0 / 14 + 2.0, 15.0 + 400.0 / 12 - 100.0 / 14
    assert FuzzySafety().proactive(found, ego) == pytest.approx(
        (safe - 38.0) / (safe - unsafe) if unsafe < 38.0 else 1.0
    )
    near = found._replace(gap=18.0)
    assert FuzzySafety().critical(near, ego) == pytest.approx(
        (20.0 - 18.0) / (20.0 - (7.5 + 100.0 / 12))
    )
    assert FuzzySafety().critical(found._replace(gap=20.1), ego) == 0.0
    assert FuzzySafety().critical(found._replace(gap=15.0), ego) == 1.0


def test_fuzzy_driver_reacts_to_who_comes_into_its_way_before_it_has_passed() -> None:
    def reacts(approach: float) -> bool:
        return any(
            decelerations(
                FuzzySafety(), seen(20.0, entity("Other", 4.0 + 12.0, 3.0, 10.0, -approach)), 12
            )
        )

    # passing takes (12 + 8)/10 = 2 s, and 0.1 s: 1 m aside at 0.48 m/s is too late, at 0.47 m/s too
    assert reacts(0.5)
    assert not reacts(0.47)
    assert not reacts(-0.5)


def test_after_an_alarm_the_speed_is_kept() -> None:
    system = ready(Regulation157())
    system.control(seen(20.0, entity("Other", 8.0, 0.0, 10.0)), 0.1)
    assert system.control(seen(20.0), 0.1).acceleration == 0.0
    system.reset(entity("Ego", 0.0, 0.0, 0.0), 0.1, 0)
    assert system.control(seen(20.0), 0.1) == Control()


def test_idm_has_its_equilibrium_at_the_wanted_gap() -> None:
    speed, wanted = 20.0, 30.0
    gap = (2.0 + 1.5 * speed) / math.sqrt(1.0 - (speed / wanted) ** 4)
    ego, lead = entity("Ego", 0.0, 0.0, speed), entity("Lead", 4.0 + gap, 0.0, speed)
    answer = IntelligentDriver().control(
        Observation(0.0, ego, (lead,), wanted, None, Environment()), 0.1
    )
    assert answer.acceleration == pytest.approx(0.0, abs=1e-9)


def test_aeb_brakes_in_part_then_fully_and_not_for_who_is_beside() -> None:
    system = ready(EmergencyBraking())
    for gap, expected in ((17.0, None), (15.0, -4.0), (9.0, -9.0), (15.0, -9.0)):
        assert (
            system.control(seen(20.0, entity("Lead", 4.0 + gap, 0.0, 10.0)), 0.1).acceleration
            == expected
        )
    ready(system)
    assert system.control(seen(20.0, entity("Beside", 4.0 + 9.0, 3.5, 10.0)), 0.1) == Control()


def test_aeb_brakes_until_it_is_no_faster_then_keeps_behind() -> None:
    system = ready(EmergencyBraking())

    def answer(own: float, gap: float, other: float) -> float | None:
        return system.control(seen(own, entity("Lead", 4.0 + gap, 0.0, other)), 0.1).acceleration

    assert answer(8.0, 13.0, 0.0) is None
    assert answer(8.0, 12.0, 0.0) == -4.0
    assert answer(4.0, 8.0, 0.0) == -4.0, "2 s to the collision: braking works, and goes on"
    assert answer(0.0, 4.0, 0.0) == 0.0, "it stands, and the scenario's speed would drive it on"
    assert answer(0.0, 4.0, 5.0) == 0.0
    assert answer(0.0, 5.5, 5.0) is None, "the other one has driven off"
    assert answer(0.0, 4.0, 5.0) is None, "it keeps behind only after braking"


@pytest.mark.parametrize("name", ["aeb", "idm", "r157-cc", "r157-reg", "rss", "fsm"])
def test_each_is_found_by_name_and_avoids_what_everyone_can(name: str) -> None:
    assert load_system(name) is not None
    mild = {
        "Ego_Speed_kmh": 50.0,
        "CutIn_Speed_kmh": 40.0,
        "CutIn_Gap_m": 30.0,
        "CutIn_LateralSpeed_mps": 1.0,
    }
    assert not runner.run(CUT_IN, parameters=mild, sut=None, world="kinematic").verdict.passed
    assert runner.run(CUT_IN, parameters=mild, sut=name, world="kinematic").verdict.passed


PUBLISHED = [
    # ego and cut-in speed (km/h), gap (m), lateral speed (m/s), and who
    # collides, from the JRC's implementation
    (130, 100, 15, 1.4, {"r157-cc", "r157-reg"}),
    (90, 40, 43, 1.1, {"r157-cc"}),
    (90, 40, 37, 1.0, {"r157-cc"}),  # 0.5 m aside at a step: the limit itself is within
    (90, 10, 45, 1.5, {"r157-cc", "r157-reg", "fsm"}),
    (60, 10, 26, 0.4, {"rss"}),  # it stands, and is run into
    (50, 10, 7, 1.1, {"rss"}),
    (20, 10, 13, 0.2, set()),  # passes, except if it brakes beside the other
    (70, 10, 35, 0.7, {"r157-cc", "r157-reg", "fsm"}),
    (30, 20, 2, 0.9, {"r157-cc", "r157-reg", "fsm"}),
    (110, 100, 1, 1.7, {"r157-cc", "r157-reg", "rss"}),
]


@pytest.mark.parametrize(("ego", "other", "gap", "lateral", "collide"), PUBLISHED)
def test_who_collides_is_what_was_published(
    ego: int, other: int, gap: int, lateral: float, collide: set[str]
) -> None:
    values = {
        "Ego_Speed_kmh": ego,
        "CutIn_Speed_kmh": other,
        "CutIn_Gap_m": gap,
        "CutIn_LateralSpeed_mps": lateral,
    }
    for name in ("r157-cc", "r157-reg", "rss", "fsm"):
        given = values | ({"Ego_AccountableTTC_s": 2} if name == "r157-cc" else {})
        passed = runner.run(
            CUT_IN, parameters=given, sut=name, timestep=0.1, world="kinematic"
        ).verdict.passed
        assert passed == (name not in collide), name


@pytest.mark.parametrize("name", ["rss", "fsm", "r157-cc", "r157-reg"])
def test_an_ego_that_reverses_does_not_stop_at_a_line_ahead(name: str) -> None:
    system = ready(load_system(name))  # type: ignore[arg-type]
    observation = seen(-3.0)._replace(stop_line=StopLine("S1", 2.5))
    assert system.control(observation, 0.1).acceleration is None  # type: ignore[union-attr]
    standing = seen(0.0)._replace(stop_line=StopLine("S1", 2.5))
    assert system.control(standing, 0.1).acceleration == pytest.approx(-0.774 * 9.81)  # type: ignore[union-attr]
