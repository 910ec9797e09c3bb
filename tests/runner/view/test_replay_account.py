"""What a run comes to in sentences, what braking would have been needed, and
whom the ego has to do with.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import runner
from runner.batch.outputs.report import summary
from runner.engine.participants.declaration import BoundingBox
from runner.judging.measures.contacts import FULL, Conflict
from runner.judging.measures.relations import MotionRows
from runner.judging.result import RunResult
from runner.view.replay.account import account, main_partner, partners, stretches
from runner.view.replay.frames import frames
from runner.view.replay.player import preview
from tests.runner.files import car, place, scenario, speed_action, story

BOX = BoundingBox(0.0, 0.0, 0.75, 4.0, 2.0, 1.5)
DT = 0.05


def motion(
    name: str, x: np.ndarray, y: np.ndarray, speed: float, heading: float = 0.0
) -> MotionRows:
    nothing = np.zeros(len(x))
    time, no_road = np.arange(len(x)) * DT, np.full(len(x), None, object)
    return MotionRows(
        name,
        BOX,
        time,
        x,
        y,
        nothing,
        nothing + heading,
        nothing + speed,
        no_road,
        nothing,
        nothing,
    )


def approach(gap: float, speed: float) -> Conflict:
    """An ego that drives into somebody who stands so far (m) ahead of its front."""
    count = round(gap / speed / DT) + 2
    way = np.arange(count) * DT * speed
    ego, other = (
        motion("Ego", way, np.zeros(count), speed),
        motion("B", np.full(count, gap + 4.0), np.zeros(count), 0.0),
    )
    return Conflict(ego, other, int(np.flatnonzero(way >= gap)[0]))


@pytest.mark.parametrize(("gap", "speed"), [(40.0, 10.0), (60.0, 20.0)])
def test_a_standing_obstacle_needs_the_braking_of_the_textbook(gap: float, speed: float) -> None:
    conflict = approach(gap, speed)
    assert conflict.least(0.0) == pytest.approx(speed**2 / (2 * gap), abs=0.01)
    assert conflict.latest(FULL) == pytest.approx((gap - speed**2 / (2 * FULL)) / speed, abs=0.051)


def test_what_tyres_do_not_give_is_unavoidable() -> None:
    conflict = approach(4.0, 10.0)  # 12.5 m/s²
    assert conflict.least(0.0) is None
    assert conflict.latest(FULL) is None


def test_one_who_crosses_is_let_pass() -> None:
    """Slowing down a little is enough, since the other one leaves the way again."""
    count = 81
    time = np.arange(count) * DT
    ego = motion("Ego", 10.0 * time - 30.0, np.zeros(count), 10.0)
    other = motion("B", np.zeros(count), 5.0 * time - 15.0, 5.0, np.pi / 2)
    row = int(np.flatnonzero(np.abs(ego.x) < 3.0)[0])
    least = Conflict(ego, other, row).least(0.0)
    assert least is not None
    assert 0.0 < least < 2.0 < 10.0**2 / (2 * 27.0) + 1.0


def test_a_rear_end_hit_is_not_avoided_by_braking() -> None:
    count = 61
    time = np.arange(count) * DT
    ego, other = (
        motion("Ego", 5.0 * time, np.zeros(count), 5.0),
        motion("B", 15.0 * time - 24.0, np.zeros(count), 15.0),
    )
    conflict = Conflict(ego, other, int(np.flatnonzero(ego.x - other.x <= 4.0)[0]))
    assert conflict.latest(FULL) is None


def run(folder: Path, gap: float, sut: str | None) -> RunResult:
    entities, init = [car("Ego"), car("B")], place("Ego", 100, 20) + place("B", 100 + gap, 0)
    path = scenario(
        folder,
        "street",
        entities=entities,
        init=init,
        stories=story("B", [(0.5, speed_action(0))]),
        stop=6.0,
    )
    return runner.run(path, sut=sut, world="kinematic")


def test_a_contact_is_told_with_who_when_how_fast_and_what_was_needed(tmp_path: Path) -> None:
    first, *others = account(run(tmp_path, 45.0, None))
    assert first.text == "Ego hit B with its front at 2.00 s, relative speed 20.0 m/s (72 km/h)."
    assert first.time == pytest.approx(2.0)
    assert [each.text for each in others] == [
        "Ego did not brake.",
        "Full braking (8 m/s²) from 0.70 s on (1.30 s before the contact) would have avoided it.",
    ]


def test_late_braking_is_told(tmp_path: Path) -> None:
    texts = [each.text for each in account(run(tmp_path, 45.0, "cas"))]
    assert texts[1].startswith("Ego began to brake at ")
    assert texts[1].endswith("with up to 8.0 m/s².")
    assert texts[2] == "By then no braking avoided it any more (more than 9.8 m/s² was needed)."


def test_without_contact_the_nearest_is_told(tmp_path: Path) -> None:
    texts = [each.text for each in account(run(tmp_path, 300.0, None))]
    assert texts[0].startswith("Ego had no contact; the least distance was ")
    assert "to B, at 6.00 s" in texts[0]


def test_actors_of_groups_are_kept_with_the_result(tmp_path: Path) -> None:
    result = run(tmp_path, 300.0, None)
    assert set(result.actors.values()) == {("B",)}
    assert summary(result)["actors"] == result.actors


def test_the_partner_is_whom_the_contact_is_with_or_who_is_near(tmp_path: Path) -> None:
    measures = run(tmp_path, 45.0, None).criticality
    assert measures is not None
    assert main_partner(measures) == "B"
    assert partners(measures, DT, 1) == [(0, "B")]
    far = run(tmp_path, 190.0, None).criticality
    assert far is not None
    assert [name for _, name in partners(far, DT, 1)] == ["", "B"]


def test_stretches_are_where_names_change() -> None:
    assert stretches(np.arange(6) * 0.1, ["", "", "A", "A", "A", "B"], 0.1, 1) == [
        (0, ""),
        (2, "A"),
        (5, "B"),
    ]
    assert stretches(np.arange(6) * 0.1, ["", "", "A", "A", "A", "B"], 0.1, 2) == [
        (0, ""),
        (1, "A"),
    ]


def test_a_preview_is_the_seconds_around_the_worst_moment(tmp_path: Path) -> None:
    found = preview(run(tmp_path, 45.0, None))
    assert found is not None
    assert (found["from"], found["to"]) == (0.0, pytest.approx(3.0))
    assert found["pair"] == ["Ego", "B"]
    assert found["told"].startswith("Ego hit B with its front at 2.00 s")
    assert [track["name"] for track in found["tracks"]] == ["Ego", "B"]
    assert len(json.dumps(found)) < 20_000


def test_there_is_no_preview_of_one_who_met_nobody(tmp_path: Path) -> None:
    path = scenario(
        tmp_path, "alone", entities=[car("Ego")], init=place("Ego", 100, 20), stories=" ", stop=0.5
    )
    assert preview(runner.run(path, sut=None, world="kinematic")) is None


def frame(result: RunResult, time: float) -> Image.Image:
    return next(frames([result], [time, time + 0.1]))


def test_frames_tell_the_contact_in_the_strip_above_the_road(tmp_path: Path) -> None:
    """Red is used for contacts only."""
    result = run(tmp_path, 45.0, None)
    red = (196, 33, 33)
    before, after = (frame(result, time).getcolors(1 << 20) or [] for time in (1.0, 2.2))
    assert red not in [colour for _, colour in before]
    assert red in [colour for _, colour in after]


def test_a_contact_within_a_step_is_told_with_its_time(tmp_path: Path) -> None:
    """At 20 m/s from 100 m on: the bumpers meet after 64.6 m, and no row shows it."""
    path = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 169.6, 0), stop=10.0)
    result = runner.run(path, world="kinematic", sut="none", timestep=1.0)
    assert result.verdict.failures == ("collision with Lead at 3.23 s",)
    assert [str(sentence.text) for sentence in account(result)][:2] == [
        "Ego touches Lead at 3.23 s, between two steps.",
        "The least distance was 4.60 m to Lead, at 3.00 s.",
    ]
