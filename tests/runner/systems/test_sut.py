"""Systems under test: by name, by module:Class, by entry point; those that fail; and `cas`."""

from __future__ import annotations

import math
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runner
from runner.engine.motion.rss import PARAMETERS, lateral_distance, longitudinal_distance
from runner.engine.participants.boxes import gap as gap_between
from runner.engine.participants.boxes import outlook
from runner.engine.participants.declaration import BoundingBox
from runner.engine.worlds.surroundings import Environment
from runner.systems import (
    Control,
    Observation,
    Participant,
    Pose,
    find_system,
    load_system,
    system_name,
)
from runner.systems.base import seen
from runner.systems.kinds.cas import CollisionAvoidance
from runner.systems.kinds.commanded import Scripted
from schemas.common.errors import ToolchainError, UsageError
from tests.conformance.support import at, events, track
from tests.runner.files import car, place, scenario


class HalfSpeed:
    """As in docs/systems-under-test.md."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.settings = ego.name, timestep, seed

    def control(self, observation: Observation, dt: float) -> Control:
        target = 0.5 * observation.target_speed
        return Control(acceleration=(target - observation.ego.speed) / dt, reason="half speed")


class NeedsArguments(HalfSpeed):
    def __init__(self, needed: int) -> None: ...


NOT_A_CLASS = 3


# how they are found -------------------------------------------------------------------------


@pytest.mark.parametrize("name", [None, "none"])
def test_none_is_nobody(name: str | None) -> None:
    assert load_system(name) is None


def test_the_default_is_cas(tmp_path: Path) -> None:
    assert runner.run(scenario(tmp_path, stop=0.1), world="kinematic").sut == "cas"
    assert isinstance(load_system("cas"), CollisionAvoidance)


def test_a_class_of_any_module(tmp_path: Path) -> None:
    name = f"{__name__}:HalfSpeed"
    result = runner.run(scenario(tmp_path, stop=3), world="kinematic", sut=name)
    assert result.sut == name
    assert at(track(result, "Ego"), 3.0, "speed") == pytest.approx(10.0)


def test_an_entry_point_of_another_package(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("half-speed", f"{__name__}:HalfSpeed", "xosc.sut")
    monkeypatch.setattr("runner.systems._installed", lambda: {entry.name: entry})
    assert isinstance(load_system("half-speed"), HalfSpeed)
    with pytest.raises(
        UsageError,
        match=r"there are adas, aeb, bridge, cas, .*half-speed, .*none, .*and module:Class",
    ):
        load_system("full-speed")


def test_an_instance(tmp_path: Path) -> None:
    system = HalfSpeed()
    result = runner.run(
        scenario(tmp_path, stop=0.1), world="kinematic", sut=system, timestep=0.02, seed=9
    )
    assert system.settings == ("Ego", 0.02, 9)
    assert result.sut == system_name(system) == f"{__name__}:HalfSpeed"


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        (
            "absent",
            "no system under test is called 'absent'; "
            "there are adas, aeb, bridge, cas, fmu, fsm, idm, none, r157-cc, r157-reg, rss, sumo, "
            "and module:Class",
        ),
        ("", "no system"),
        (":", "no system"),
        ("a b:C", "no system"),
        ("absent_module:Class", "No module named 'absent_module'"),
        (f"{__name__}:Absent", "it has no class 'Absent'"),
        (f"{__name__}:NOT_A_CLASS", "is not a class"),
        (f"{__name__}:NeedsArguments", "can't be built: TypeError"),
        ("pathlib:Path", "has no method reset"),
    ],
)
def test_what_can_not_be_loaded_is_named(name: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        load_system(name)


def test_a_module_with_an_error_in_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "unfinished_system.py").write_text("class (:")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(
        UsageError, match="arguments follow a second colon: module:Class:NAME=VALUE"
    ):
        find_system("unfinished_system:X,brake=4")
    with pytest.raises(UsageError, match="'unfinished_system:X' can't be imported: SyntaxError"):
        find_system("unfinished_system:X")


def test_a_class_that_a_module_lacks_is_named_with_the_most_similar_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "half_system.py").write_text("class HalfSpeed: pass")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(UsageError, match="it has no class 'Half'; did you mean 'HalfSpeed'"):
        find_system("half_system:Half")


# those that fail ----------------------------------------------------------------------------


class Failing(HalfSpeed):
    """Answers with whatever it is given, or raises it."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def control(self, observation: Observation, dt: float) -> Control:
        if isinstance(self.answer, Exception):
            raise self.answer
        answer: Control = self.answer
        return answer


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (KeyError("lidar"), "KeyError: 'lidar'"),
        (None, "returned None"),
        (Control(acceleration=math.nan), "finite numbers"),
        (Control(acceleration=math.inf), "finite numbers"),
        (Control(steering=math.nan), "finite numbers"),
        (Control(acceleration="full"), r"control\(\) returned .*, numbers are expected"),  # type: ignore[arg-type]
        (Pose(1.0, math.nan, 0.0), "finite numbers"),
        (Pose(1.0, 2.0, 0.0, speed=math.inf), "finite numbers"),
    ],
)
def test_a_failing_system_is_named(tmp_path: Path, answer: object, complaint: str) -> None:
    with pytest.raises(ToolchainError, match=complaint) as error:
        runner.run(scenario(tmp_path), world="kinematic", sut=Failing(answer))
    assert f"{__name__}:Failing failed at 0.00 s" in str(error.value)
    assert error.value.exit_code == 5


def test_a_system_may_complain_in_its_own_words(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no map"):
        runner.run(scenario(tmp_path), world="kinematic", sut=Failing(UsageError("no map")))


# poses --------------------------------------------------------------------------------------


class Gliding(HalfSpeed):
    """Moves by so many m in each step, and from a time on by a jump (m) once
    more; says this speed (m/s).
    """

    def __init__(
        self, forward: float, aside: float = 0.0, jump: float = 0.0, speed: float | None = None
    ) -> None:
        self.forward, self.aside, self.jump, self.speed = forward, aside, jump, speed

    def control(self, observation: Observation, dt: float) -> Pose:  # type: ignore[override]
        ego, jump = observation.ego, self.jump if abs(observation.time - 0.5) < 1e-9 else 0.0
        return Pose(ego.x + self.forward, ego.y + self.aside + jump, ego.h, self.speed, "gliding")


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_system_may_answer_with_poses(tmp_path: Path, world: str) -> None:
    result = runner.run(scenario(tmp_path, stop=1.0), world=world, sut=Gliding(0.95, 0.02))
    ego = track(result, "Ego")
    assert at(ego, 1.0, "x") - at(ego, 0.0, "x") == pytest.approx(19.0)
    assert at(ego, 1.0, "y") - at(ego, 0.0, "y") == pytest.approx(0.4)
    assert at(ego, 1.0, "speed") == pytest.approx(19.0)
    assert result.verdict.outcome == "passed"
    assert [event.text for event in events(result, "interventionStart")] == ["gliding"]


@pytest.mark.parametrize(
    ("system", "told"),
    [
        (Gliding(1.0, jump=3.5), "Ego is put 3.50 m from where it would be at 0.55 s"),
        (Gliding(0.0, speed=20.0), "Ego is put 0.00 m further at 0.05 s, at a speed of 20.00 m/s"),
        (Gliding(2.1), "Ego is put 1.10 m from where it would be at 0.05 s"),
        (
            Gliding(1.0, aside=0.3),
            "Ego has moved sideways at more than 3 m/s for 0.5 s at 0.50 s",
        ),
    ],
)
def test_poses_that_no_vehicle_reaches_test_nothing(
    tmp_path: Path, system: Gliding, told: str
) -> None:
    result = runner.run(scenario(tmp_path, stop=1.0), world="kinematic", sut=system)
    assert result.verdict.outcome == "inconclusive"
    assert result.verdict.causes[0].name == "performance"
    assert told in result.verdict.causes[0].text
    assert [event.text for event in events(result, "implausiblePose")] == [
        f"{told}: no vehicle moves so"
    ]


def test_a_pose_needs_both_domains(tmp_path: Path) -> None:
    activate = (
        '<PrivateAction><ControllerAction><ActivateControllerAction longitudinal="true" '
        'lateral="false"/></ControllerAction>'
        "</PrivateAction>"
    )
    init = place("Ego", 100, 20, more=activate) + place("Lead", 150, 10)
    file = scenario(tmp_path, entities=[car("Ego", "driver"), car("Lead")], init=init)
    with pytest.raises(
        ToolchainError,
        match="a Pose, which needs both domains; the scenario hands over the longitudinal one",
    ):
        runner.run(file, world="kinematic", sut=Gliding(1.0))


def test_what_comes_after_poses_follows_the_lane(tmp_path: Path) -> None:
    pose = Pose(101.0, -1.5, 0.0)
    result = runner.run(
        scenario(tmp_path, stop=1.0),
        world="kinematic",
        sut=Scripted([(0.0, pose), (0.05, Control())]),
    )
    ego = track(result, "Ego")
    assert (at(ego, 0.05, "x"), at(ego, 1.0, "y")) == (101.0, pytest.approx(-1.5)) and at(
        ego, 1.0, "x"
    ) == pytest.approx(120.0)


# what they see ------------------------------------------------------------------------------


class Remembering(HalfSpeed):
    """Keeps what it has seen."""

    def __init__(self) -> None:
        self.seen: list[Observation] = []

    def control(self, observation: Observation, dt: float) -> Control:
        self.seen.append(observation)
        return Control()


def test_what_a_system_has_seen_stays_as_it_was(tmp_path: Path) -> None:
    system = Remembering()
    result = runner.run(scenario(tmp_path, stop=1.0), world="kinematic", sut=system)
    assert [observation.ego.x for observation in system.seen] == list(
        track(result, "Ego")["x"][:-1]
    )
    assert [observation.others[0].x for observation in system.seen] == list(
        track(result, "Lead")["x"][:-1]
    )


def test_a_participant_has_the_values_of_its_entity_by_name() -> None:
    of_declared = {"kind", "category", "performance", "front_axle", "max_steering", "mass"}
    declared = SimpleNamespace(**{name: name for name in of_declared})
    own = {name: name for name in Participant._fields if name not in {*of_declared, "overrides"}}
    entity = SimpleNamespace(
        **own, declared=declared, controls=SimpleNamespace(overrides="overrides")
    )
    assert seen(entity)._asdict() == {name: name for name in Participant._fields}  # type: ignore[arg-type]


def test_what_a_system_sees_can_not_be_changed(tmp_path: Path) -> None:
    system = Remembering()
    runner.run(scenario(tmp_path, stop=0.1), world="kinematic", sut=system)
    observation = system.seen[0]
    for owner, name in (
        (observation, "ego"),
        (observation.ego, "speed"),
        (observation.environment, "friction"),
    ):
        with pytest.raises(AttributeError):
            setattr(owner, name, 0.0)
    with pytest.raises(TypeError):
        observation.ego.overrides["Brake"] = 1.0  # type: ignore[index]


# the test double ----------------------------------------------------------------------------


def test_the_double_plays_its_script() -> None:
    double = Scripted([(0.0, Control(acceleration=1.0)), (0.3, Control(steering=0.1))])
    played = [double.control(SimpleNamespace(time=0.1 * step), 0.1) for step in range(5)]  # type: ignore[arg-type]
    assert played == [Control(acceleration=1.0)] * 3 + [Control(steering=0.1)] * 2
    assert Scripted().control(SimpleNamespace(time=1.0), 0.1) == Control()  # type: ignore[arg-type]


# cas ----------------------------------------------------------------------------------------

CAR = BoundingBox(1.5, 0.0, 0.75, 5.0, 2.0, 1.5)
WALKER = BoundingBox(0.0, 0.0, 0.9, 0.4, 0.6, 1.8)


def entity(
    name: str,
    x: float,
    y: float,
    vx: float,
    vy: float = 0.0,
    h: float = 0.0,
    box: BoundingBox = CAR,
) -> Participant:
    speed = vx * math.cos(h) + vy * math.sin(h)
    return Participant(name, "vehicle", "car", box, x=x, y=y, h=h, speed=speed, vx=vx, vy=vy)


@given(
    st.floats(-20.0, 20.0),
    st.floats(-20.0, 20.0),
    st.floats(-4.0, 4.0),
    st.floats(0.0, 15.0),
    st.sampled_from([CAR, WALKER]),
)
def test_cas_sees_as_far_as_the_gap_says(
    x: float, y: float, h: float, sensor_range: float, box: BoundingBox
) -> None:
    ego, other = entity("Ego", 0, 0, 5), entity("Other", x, y, 0, h=h, box=box)
    system = CollisionAvoidance(sensor_range=sensor_range)
    assert system._in_range(ego, other, outlook(ego, other)) == (
        gap_between(ego, other) <= sensor_range
    )


def brakes(ego: Participant, *others: Participant, **parameters: Any) -> float | None:
    observation = Observation(0.0, ego, others, ego.speed, None, Environment())
    return CollisionAvoidance(**parameters).control(observation, 0.05).acceleration


def test_it_brakes_when_the_lead_is_nearer_than_rss_allows() -> None:
    p = PARAMETERS["ad-rss"]
    safe = longitudinal_distance(5.0, 4.0, p)
    assert 5.0 < safe < 20.0
    assert (
        brakes(entity("Ego", 0, 0, 5), entity("Lead", 5 + safe - 0.01, 0, 4), sensor_range=50.0)
        == -8.0
    )
    assert (
        brakes(entity("Ego", 0, 0, 5), entity("Lead", 5 + safe + 0.01, 0, 4), sensor_range=50.0)
        is None
    )


def test_it_sees_no_further_than_its_sensors() -> None:
    assert brakes(entity("Ego", 0, 0, 30), entity("Lead", 15.01, 0, 0)) is None
    assert brakes(entity("Ego", 0, 0, 30), entity("Lead", 14.99, 0, 0)) == -8.0
    assert (
        brakes(entity("Ego", 0, 0, 30), entity("Lead", 54.99, 0, 0), sensor_range=50.0, brake=6.0)
        == -6.0
    )


def test_the_range_is_measured_between_the_boxes() -> None:
    aside = math.sqrt(10.0**2 - 6.0**2)  # 6 m ahead and 8 m aside is 10 m away
    cutting_in = entity("Other", 11.0, 2.0 + aside - 0.01, 20, -6)
    assert brakes(entity("Ego", 0, 0, 20), cutting_in) == -8.0
    cutting_in = cutting_in._replace(y=cutting_in.y + 0.02)
    assert brakes(entity("Ego", 0, 0, 20), cutting_in) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_neighbour_counts_when_it_comes_closer_than_rss_allows_laterally(side: float) -> None:
    p = PARAMETERS["ad-rss"]
    calm = lateral_distance(0.0, 0.0, p.response, p.response_other, p)
    coming = lateral_distance(0.0, -1.0, p.response, p.response_other, p)
    assert calm < coming
    for gap, speed, expected in [
        (calm + 0.01, 0.0, None),
        (calm - 0.01, 0.0, -8.0),
        (coming + 0.01, 1.0, None),
        (coming - 0.01, 1.0, -8.0),
    ]:
        other = entity("Other", 6.0, side * (2.0 + gap), 20, -side * speed)
        assert brakes(entity("Ego", 0, 0, 20), other) == expected


@pytest.mark.parametrize("sideways", [-3.0, 0.0, 3.0])
def test_boxes_in_each_others_way_are_dangerous_however_they_move_sideways(sideways: float) -> None:
    oncoming = entity("Oncoming", 12.0, 0.5, -9, sideways, h=math.pi)
    assert brakes(entity("Ego", 0, 0, 3), oncoming) == -8.0


def test_it_does_not_mind_who_is_behind_or_parallel_in_the_next_lane() -> None:
    ego = entity("Ego", 0, 0, 20)
    assert brakes(ego, entity("Behind", -6.0, 0, 40)) is None
    assert brakes(ego, entity("Beside", 1.0, 3.5, 20)) is None
    assert brakes(ego, entity("Opposite", 10.0, 3.5, -20, h=math.pi)) is None
    assert brakes(ego) is None


def test_it_brakes_for_oncoming_traffic_in_its_own_lane() -> None:
    assert brakes(entity("Ego", 0, 0, 5), entity("Oncoming", 18.0, 0, -5, h=math.pi)) == -8.0


def test_it_brakes_for_a_pedestrian_who_walks_into_its_way_and_not_for_one_who_leaves() -> None:
    def pedestrian(vy: float) -> Participant:
        return entity("Walker", 8.0, -2.2, 0.0, vy, h=math.pi / 2, box=WALKER)

    assert brakes(entity("Ego", 0, 0, 10), pedestrian(1.5)) == -8.0
    assert brakes(entity("Ego", 0, 0, 10), pedestrian(-1.5)) is None


def test_it_works_the_same_whatever_the_heading() -> None:
    for h in (0.0, 1.0, math.pi, -2.5):
        c, s = math.cos(h), math.sin(h)
        ego = entity("Ego", 3.0, 4.0, 5 * c, 5 * s, h=h)
        for ahead, expected in ((5 + 9.0, -8.0), (5 + 15.0, None)):
            other = entity("Lead", 3.0 + ahead * c, 4.0 + ahead * s, 4 * c, 4 * s, h=h)
            assert brakes(ego, other, sensor_range=20.0) == expected


def test_reversing_it_minds_who_is_behind() -> None:
    ego = entity("Ego", 0, 0, -3)
    assert brakes(ego, entity("Behind", -8.0, 0, 0)) == 8.0
    assert brakes(ego, entity("Ahead", 8.0, 0, 0)) is None


def test_it_says_why() -> None:
    observation = Observation(
        0.0, entity("Ego", 0, 0, 10), (entity("Lead", 12.0, 0.5, 5),), 10.0, None, Environment()
    )
    reason = CollisionAvoidance().control(observation, 0.05).reason
    assert reason == "Lead is 7.0 m ahead and 0.0 m aside, RSS asks for 33.0 m or 0.7 m"


def test_parameters_are_checked() -> None:
    with pytest.raises(UsageError, match=r"ad-rss, r157"):
        CollisionAvoidance(rss="absent")
    with pytest.raises(UsageError, match=r"jerk of cas is more than 0 m/s³, not 0"):
        CollisionAvoidance(jerk=0.0)


def test_braking_builds_up_by_its_jerk_and_anew_after_the_danger() -> None:
    system, ego, lead = CollisionAvoidance(jerk=20.0), entity("Ego", 0, 0, 10), 12.0
    near, far = (
        Observation(0.0, ego, (entity("Lead", x, 0.5, 5),), 10.0, None, Environment())
        for x in (lead, lead + 80.0)
    )
    seen = [near, near, near, near, near, far, near]
    answers = [system.control(each, 0.1).acceleration for each in seen]
    assert answers == [-2.0, -4.0, -6.0, -8.0, -8.0, None, -2.0]
    system.reset(ego, 0.1, 0)
    assert system.control(near, 0.1).acceleration == -2.0


# blame --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "line", "complaint"),
    [
        ("import absent_package\n", 1, "can't be imported: ModuleNotFoundError"),
        ("class Odd\n", 1, "can't be imported: SyntaxError"),
        (
            "class Odd:\n    def __init__(self):\n        self.x = open('absent')\n",
            3,
            "can't be built: FileNotFoundError",
        ),
        (
            "class Odd:\n    def reset(self, *_):\n        1 / 0\n    def control(self, *_): ...\n",
            3,
            "failed at 0.00 s: ZeroDivisionError",
        ),
        (
            (
                "import json\nclass Odd:\n    def reset(self, *_): ...\n    def control(self, "
                "*_):\n        json.loads('{')\n"
            ),
            5,
            "failed at 0.00 s: JSONDecodeError",
        ),
    ],
)
def test_what_a_system_does_wrong_is_told_with_its_file_and_line(
    source: str, line: int, complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = f"odd_system_{abs(hash(source))}"
    (tmp_path / f"{module}.py").write_text(source)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ToolchainError, match=complaint) as error:
        runner.run(scenario(tmp_path), world="kinematic", sut=f"{module}:Odd")
    assert f"({tmp_path / module}.py:{line})" in str(error.value)
