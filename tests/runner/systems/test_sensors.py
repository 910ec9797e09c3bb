"""Sensor models: what a system sees of what is there, and parameters that scenarios give it."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import runner
from runner.batch.arrays import NotInArrays, structures
from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.surroundings import Environment
from runner.systems import Control, Observation, Participant, load_system
from runner.systems.base import SENSORS
from runner.systems.encounters import SensedSystem, SensorModel, rainy_reach
from schemas.common.errors import UsageError
from tests.runner.files import place, scenario

BOX = BoundingBox(0.0, 0.0, 0.75, 4.0, 2.0, 1.5)
EGO = Participant("Ego", "vehicle", "car", BOX, speed=20.0)


def car(name: str, x: float, y: float = 0.0) -> Participant:
    return EGO._replace(name=name, x=x, y=y)


def seen(others: list[Participant], time: float = 0.0, **weather: str) -> Observation:
    environment = Environment(
        weather={f"Precipitation.{key}": text for key, text in weather.items()}
    )
    return Observation(time, EGO, others, 20.0, None, environment)


def names(model: SensorModel, observation: Observation, seed: int = 0) -> list[str]:
    return [each.name for each in model.detected(observation, seed)]


def test_without_parameters_all_is_seen() -> None:
    everyone = [car("Near", 10.0), car("Behind", -300.0), car("Hidden", 40.0)]
    assert names(SensorModel(), seen(everyone)) == ["Near", "Behind", "Hidden"]
    assert tuple(asdict(SensorModel())) == SENSORS


def test_reach_and_field_of_view() -> None:
    everyone = [car("Ahead", 50.0), car("Far", 80.0), car("Beside", 0.0, 5.0), car("Behind", -20.0)]
    assert names(SensorModel(reach=60.0), seen(everyone)) == ["Ahead", "Beside", "Behind"]
    assert names(SensorModel(field=30.0), seen(everyone)) == ["Ahead", "Far"]
    # Its rear corner at 18 m ahead and 4.5 m aside is at 14.04°, its centre at 15.4°.
    crossing = [car("Crossing", 20.0, 5.5)]
    assert names(SensorModel(field=29.0), seen(crossing)) == ["Crossing"]
    assert names(SensorModel(field=20.0), seen(crossing)) == []


def test_boxes_hide_what_is_behind_them_as_a_whole() -> None:
    model = SensorModel(occlusion=True)
    assert names(model, seen([car("Lead", 15.0), car("Before", 40.0)])) == ["Lead"]
    aside = [car("Lead", 15.0), car("Aside", 40.0, 3.5)]
    assert names(model, seen(aside)) == ["Lead", "Aside"]  # a corner is in sight
    assert names(model, seen([car("Before", 40.0)])) == ["Before"]
    assert names(model, seen([car("Behind", -15.0), car("Before", 40.0)])) == ["Behind", "Before"]


def test_participants_are_missed_by_seed_for_a_share_of_the_time() -> None:
    model, lead = SensorModel(missed=0.3), [car("Lead", 20.0)]
    found = [bool(names(model, seen(lead, 0.05 * step))) for step in range(40_000)]
    assert sum(found) / len(found) == pytest.approx(0.7, abs=0.02)
    assert all(
        found[10 * spell] == found[10 * spell + 9] for spell in range(100)
    )  # of half a second
    assert found[:400] == [bool(names(model, seen(lead, 0.05 * step))) for step in range(400)]
    other = [bool(names(model, seen(lead, 0.05 * step), seed=1)) for step in range(400)]
    assert other != found[:400]


def test_ghosts_stand_ahead_and_come_as_often_as_said() -> None:
    model = SensorModel(ghosts=12.0)
    spells = [model.detected(seen([], 0.5 * spell), 0) for spell in range(12_000)]
    assert sum(map(len, spells)) == pytest.approx(12.0 * 100, rel=0.1)  # of 100 minutes
    ghosts = [each for spell in spells for each in spell]
    assert all(10.0 <= ghost.x <= 100.0 and ghost.y == 0.0 and not ghost.speed for ghost in ghosts)


@pytest.mark.parametrize(("intensity", "reach"), [(0.0, 100.0), (10.0, 93.8), (50.0, 83.4)])
def test_rain_takes_from_the_reach_what_the_echo_loses(intensity: float, reach: float) -> None:
    found = rainy_reach(100.0, intensity)
    assert found == pytest.approx(reach, abs=0.1)
    # 40 lg(100 m / r) = 2 k Rᵃ r
    lost = 2.0 * 1.13 * intensity**0.72 * found / 1000.0 if intensity else 0.0
    assert 40.0 * math.log10(100.0 / found) == pytest.approx(lost, abs=1e-6)


def test_rain_is_that_of_the_environment() -> None:
    model, lead = SensorModel(reach=100.0, rain=True), [car("Lead", 90.0)]
    wet = {"precipitationType": "rain", "precipitationIntensity": "50"}
    assert names(model, seen(lead)) == ["Lead"]
    assert names(model, seen(lead, **wet)) == []
    assert names(model, seen(lead, **wet | {"precipitationType": "snow"})) == ["Lead"]
    assert names(replace(model, rain=False), seen(lead, **wet)) == ["Lead"]


class Notes:
    """A system that notes what it sees."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.seen: list[float] = []

    def control(self, observation: Observation, dt: float) -> Control:
        self.seen.append(observation.others[0].x if observation.others else math.nan)
        return Control()


def test_what_is_seen_is_as_old_as_the_delay() -> None:
    notes = Notes()
    system = SensedSystem(notes, SensorModel(delay=0.2))
    for _ in range(2):  # a run leaves nothing to the next one
        system.reset(EGO, 0.1, 0)
        for step in range(6):
            system.control(seen([car("Lead", float(step))], 0.1 * step), 0.1)
        assert notes.seen[2:] == [0.0, 1.0, 2.0, 3.0]
        assert all(map(math.isnan, notes.seen[:2]))


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("cas:delay=-1", "the sensor's delay is from 0 to 10, not -1"),
        ("cas:missed=2", "the sensor's missed is from 0 to 1, not 2"),
        ("cas:field=wide", "the parameter field of 'cas' is a number, not 'wide'"),
        ("adas:occlusion=perhaps", "the parameter occlusion of 'adas' is true or false"),
        ("idm:delay=1", "'idm' has no parameter 'delay'"),
    ],
)
def test_wrong_parameters_are_refused(name: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        load_system(name)


def run(path: Path, sut: str | None, **parameters: float) -> runner.RunResult:
    return runner.run(path, world="kinematic", sut=sut, timestep=0.1, parameters=parameters)


def test_scenarios_give_the_system_its_parameters(tmp_path: Path) -> None:
    declared = (
        '<ParameterDeclaration name="sut_delay" parameterType="double" value="0"/>'
        '<ParameterDeclaration name="sut_colour" parameterType="string" value="red"/>'
    )
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 150, 0), stop=6.0)
    text = path.read_text()
    for before in ("<ParameterDeclarations/>", "<ParameterDeclarations></ParameterDeclarations>"):
        text = text.replace(before, "")
    path.write_text(
        text.replace(
            "<CatalogLocations",
            f"<ParameterDeclarations>{declared}</ParameterDeclarations><CatalogLocations",
            1,
        )
    )
    sut = "cas:sensor_range=60,delay=0.5"
    quick, late = run(path, sut), run(path, sut, sut_delay=2.5)
    assert quick.sut_parameters["delay"] == 0.0  # the scenario's value, not that of the name
    assert late.sut_parameters["delay"] == 2.5
    assert quick.verdict.passed and late.verdict.failures
    assert any("sut_colour: cas has no parameter colour" in each for each in quick.remarks)
    assert any(
        "sut_delay: r157-cc has no parameter delay" in each for each in run(path, "r157-cc").remarks
    )
    with pytest.raises(NotInArrays, match="sut_delay: systems get parameters in single runs only"):
        list(structures(path, [{}], runner.RunSettings(world="kinematic", sut=sut)))
