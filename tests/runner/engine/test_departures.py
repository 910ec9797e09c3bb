"""What is said of entities that never appear, of controllers, of no ego, and of
one that leaves the road.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.report import summary
from runner.engine.storyboard.departures import Departures
from runner.judging.settings import RunSettings
from runner.systems import Control
from runner.systems.kinds.commanded import Scripted
from tests.commands import Command
from tests.conformance.support import events
from tests.runner.files import car, place, scenario
from tests.runner.scene import put, put_free, scene

LEFT, RIGHT = Control(steering=0.02), Control(steering=-0.02)


def ride(
    folder: Path, *script: tuple[float, Control], s: float = 100.0, stop: float = 6.0
) -> runner.RunResult:
    """The ego alone at 20 m/s."""
    path = scenario(folder, entities=[car("Ego")], init=place("Ego", s, 20), stories=" ", stop=stop)
    return runner.run(path, world="kinematic", timestep=0.01, sut=Scripted(script))


def test_ego_that_stays_on_its_road_gives_no_remark(tmp_path: Path) -> None:
    result = ride(tmp_path)
    assert result.remarks == ()
    assert not {entry.kind for entry in result.events} & {"offRoad", "onRoad", "roadEnd"}


def test_leaving_the_road_and_coming_back_are_events_and_the_first_leaving_is_a_remark(
    tmp_path: Path,
) -> None:
    result = ride(tmp_path, (0.0, RIGHT), (2.0, LEFT), stop=30.0)
    off, on = ([entry.time for entry in events(result, kind)] for kind in ("offRoad", "onRoad"))
    assert off[0] < on[0]
    assert result.remarks[0] == f"Ego has left the road at {off[0]:.2f} s"
    assert summary(result)["remarks"] == list(result.remarks)
    assert result.verdict.passed


@pytest.mark.parametrize(
    ("sut", "reason"),
    [
        (None, "nothing sets it in motion; SUMO's driver would drive it (--sut sumo)"),
        (
            "cas",
            (
                "neither the scenario nor cas sets it in motion; SUMO's driver would drive it "
                "(--sut sumo)"
            ),
        ),
    ],
)
def test_an_ego_that_nothing_sets_in_motion_is_a_remark(
    tmp_path: Path, sut: str | None, reason: str
) -> None:
    path = scenario(
        tmp_path, entities=[car("Ego")], init=place("Ego", 100, 0), stories=" ", stop=1.0
    )
    assert runner.run(path, world="kinematic", sut=sut).remarks == (
        f"Ego stands during the whole run: {reason}",
    )


def test_a_run_in_which_nobody_moves_the_ego_or_nobody_is_there_tests_nothing(
    tmp_path: Path,
) -> None:
    def causes(name: str, entities: list[str], init: str, sut: str) -> list[str]:
        path = scenario(tmp_path / name, entities=entities, init=init, stories=" ", stop=0.2)
        return [cause.name for cause in runner.run(path, world="kinematic", sut=sut).verdict.causes]

    standing = place("Ego", 100, 0)
    unsaid = standing[: standing.index("<PrivateAction><LongitudinalAction")] + "</Private>"
    assert causes("unsaid", [car("Ego")], unsaid, "cas") == ["standing"]
    assert causes("unsaid_none", [car("Ego")], unsaid, "none") == []
    assert causes("said", [car("Ego")], standing, "cas") == []
    assert (
        causes("empty", [" "], " ", "none") == causes("empty_cas", [" "], " ", "cas") == ["no-ego"]
    )


@pytest.mark.parametrize(
    ("sut", "gap", "said"),
    [
        (None, 50, ()),
        (
            "cas",
            50,
            ("no vehicle is known to be the ego: cas drives nobody; --ego A would make it that",),
        ),
        (
            None,
            1,
            (
                (
                    "no vehicle is known to be the ego: A touches B at 0.00 s, which fails "
                    "nothing; --ego A would make it that"
                ),
            ),
        ),
    ],
)
def test_no_ego_is_a_remark_where_one_was_needed(
    tmp_path: Path, sut: str | None, gap: int, said: tuple[str, ...]
) -> None:
    path = scenario(
        tmp_path,
        entities=[car("A"), car("B")],
        init=place("A", 100, 10) + place("B", 100 + gap, 10),
        stories=" ",
    )
    assert runner.run(path, world="kinematic", sut=sut).remarks == said


def test_end_of_the_road_is_a_remark(tmp_path: Path) -> None:
    result = ride(tmp_path, s=980.0)
    (entry,) = events(result, "roadEnd")
    assert entry.time == pytest.approx(1.0, abs=0.02)
    assert result.remarks == (f"Ego has come to the end of the road at {entry.time:.2f} s",)


def test_remarks_are_in_the_outcome_of_a_batch(tmp_path: Path) -> None:
    path = scenario(
        tmp_path, entities=[car("Ego")], init=place("Ego", 980, 20), stories=" ", stop=3.0
    )
    (outcome,) = run_batch(jobs_of([path], {}, True), RunSettings(world="kinematic"))
    assert (outcome.state, outcome.exit_code) == ("passed", 0)
    assert outcome.remarks == ["Ego has come to the end of the road at 1.05 s"]


def test_equal_remarks_are_printed_once_below_the_table(command: Command, tmp_path: Path) -> None:
    short = scenario(
        tmp_path, entities=[car("Ego")], init=place("Ego", 980, 20), stories=" ", stop=3.0
    )
    other = tmp_path / "other.xosc"
    other.write_bytes(short.read_bytes())
    answer = command(
        "xosc-run", short, other, "--world", "kinematic", "--junit", tmp_path / "junit.xml"
    )
    (remark,) = [line for line in answer.out.splitlines() if line.startswith("remark: ")]
    assert remark == "remark: Ego has come to the end of the road at 1.05 s (and 1 more like it)"
    assert answer.out.count("(1 remark)") == 2
    cases = etree.parse(tmp_path / "junit.xml").findall(".//testcase")
    assert [case.findtext("system-out") for case in cases] == [
        "Ego has come to the end of the road at 1.05 s"
    ] * 2


def test_an_entity_that_no_action_places_is_a_remark_of_its_line(tmp_path: Path) -> None:
    path = scenario(tmp_path, entities=(car("Ego"), car("Absent")), init=place("Ego", 100, 10))
    result = runner.run(path, sut="none", world="kinematic")
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if '"Absent"' in text)
    assert result.remarks[0].startswith(f"{path}:{line}: 'Absent' never appears") and [
        cause.name for cause in result.verdict.causes
    ] == ["absent"]


@pytest.mark.parametrize(
    ("sut", "text"),
    [("none", "is not executed"), ("idm", "takes the place of the controller 'driver'")],
)
def test_a_controller_that_is_not_executed_is_a_remark(tmp_path: Path, sut: str, text: str) -> None:
    path = scenario(
        tmp_path, entities=(car("Ego", controller="driver"), car("Lead", controller="human"))
    )
    first, second = runner.run(path, sut=sut, world="kinematic").remarks
    assert first.startswith("Ego: ") and text in first
    assert second == "Lead: the controller 'human' is not executed: it moves as scripted"


def test_an_activated_controller_that_is_nowhere_is_a_remark(tmp_path: Path) -> None:
    activate = (
        "<PrivateAction><ControllerAction><ActivateControllerAction "
        "longitudinal='{}'/></ControllerAction></PrivateAction>"
    )
    for active, remarks in (
        ("false", ()),
        ("true", ("Ego: a controller is activated, and the scenario gives it none",)),
    ):
        init = place("Ego", 100, 10, more=activate.format(active))
        path = scenario(tmp_path, active, entities=[car("Ego")], init=init)
        found = runner.run(path, sut="none", world="kinematic").remarks
        assert tuple(remark.rpartition(":")[0] for remark in found) == remarks


@given(
    st.floats(0.0, 500.0), st.floats(-12.0, 12.0), st.floats(0.0, 1.0), st.floats(-math.pi, math.pi)
)
def test_who_has_moved_less_than_its_clearance_is_still_on_the_road(
    x: float, y: float, share: float, way: float
) -> None:
    run = scene("Ego")
    ego = put_free(run, "Ego", x, y)
    if run.roads.is_off_road(ego):
        return
    clearance = max(run.roads.clearance(ego), 0.0)
    ego.x, ego.y = x + share * clearance * math.cos(way), y + share * clearance * math.sin(way)
    assert not run.roads.is_off_road(ego)


_PLACES = st.tuples(
    st.sampled_from([0.0, 0.0, 1.5, 2.0, 12.0]),
    st.sampled_from([-1, 1]),
    st.integers(0, 7),
    st.integers(0, 7),
)


@given(st.lists(_PLACES, max_size=30))
def test_what_is_remembered_of_the_road_changes_no_note(
    places: list[tuple[float, int, int, int]],
) -> None:
    sim = scene("Ego")
    ego = sim.entities["Ego"]
    remembering, plain, notes = Departures(ego), Departures(ego), ([], [])
    for step, (offset, lane, free, ended) in enumerate(places):
        if free:
            put(sim, "Ego", lane, 10.0 * step, offset)
        else:
            put_free(sim, "Ego", 10.0 * step, offset)
        ego.at_road_end = not ended
        for looks, lines in zip((remembering, plain), notes, strict=True):
            run: Any = SimpleNamespace(
                roads=sim.roads, changes=0, step_index=8 * step, time=float(step)
            )
            run.note = lambda *line, lines=lines, step=step: lines.append((step, *line))
            looks(run)
        plain._section, plain._judged = None, -1
    assert notes[0] == notes[1] and remembering.remarks == plain.remarks


def test_who_drives_in_the_middle_of_a_straight_road_has_clearance() -> None:
    run = scene("Ego")
    ego = put_free(run, "Ego", 100.0, -1.75)
    assert not run.roads.is_off_road(ego)
    assert run.roads.clearance(ego) > 1.0


def test_a_vehicle_that_the_end_of_the_road_stops_dead_is_told(tmp_path: Path) -> None:
    init = place("Ego", 100, 5) + place("Other", 950, 20)
    path = scenario(tmp_path, entities=[car("Ego"), car("Other")], init=init, stories=" ", stop=6.0)
    (remark,) = [
        each
        for each in runner.run(path, sut="none", world="kinematic").remarks
        if "physics" in each
    ]
    assert re.match(
        r"Other stops dead at the end of its road at 2\.\d\d s: -20\.00 m/s within 0\.05 s is "
        r"beyond physics",
        remark,
    )
