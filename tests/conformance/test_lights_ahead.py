"""One red light, written in each way: what a system sees of it, whether it
stops, and what is said of a run through it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner.engine.worlds.aspects import Aspect, aspect_of
from runner.systems import Control, Observation, Participant
from tests.conformance.support import SCENARIOS, at, changed, events, track

LINE = 400.0
DT = 0.05


def scenario(folder: Path, state: str, semantics: str = "") -> Path:
    """The scenario of Phase, whose light 1 has one state for 30 s and then is green."""
    return changed(
        SCENARIOS / "Phase.xosc",
        folder,
        ('semantics="$First"', semantics),
        ('semantics="go"', ""),
        ('state="state 1"', f'state="{state}"'),
        ('state="state 2"', 'state="green"'),
    )


class Witness:
    """Keeps what it sees."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        self.seen: list[Observation] = []

    def control(self, observation: Observation, dt: float) -> Control:
        self.seen.append(observation)
        return Control()


@pytest.mark.parametrize(
    ("state", "semantics"),
    [
        ("state 1", 'semantics="stop"'),
        ("red", ""),
        ("on;off;off", ""),
        ("on;off", ""),
        ("STOP", ""),
        ("red;yellow", ""),
    ],
)
def test_a_red_light_is_seen_obeyed_and_judged_however_it_is_written(
    state: str, semantics: str, tmp_path: Path
) -> None:
    path = scenario(tmp_path, state, semantics)
    witness = Witness()
    through = runner.run(path, sut=witness, timestep=DT, max_time=20.0)
    first = witness.seen[0]
    assert first.stop_line is not None and first.stop_line.signal == "1"
    assert first.stop_line.distance == pytest.approx(LINE - first.ego.x)
    (light, *_) = first.signals
    assert (light.signal, light.distance, light.state) == (
        "1",
        pytest.approx(LINE - first.ego.x),
        state,
    )
    assert light.aspect in (Aspect.RED, Aspect.RED_YELLOW)
    assert any("ran the red light 1" in remark for remark in through.remarks)
    stopped = runner.run(path, sut="idm", timestep=DT, max_time=29.0)
    ego = track(stopped, "Ego")
    assert ego["x"][-1] < LINE and at(ego, 28.0, "speed") < 0.1
    assert not any("red light" in remark for remark in stopped.remarks)


def test_a_green_light_is_seen_and_passed(tmp_path: Path) -> None:
    witness = Witness()
    result = runner.run(scenario(tmp_path, "off;off;on"), sut=witness, timestep=DT, max_time=20.0)
    assert all(seen.stop_line is None for seen in witness.seen)
    assert witness.seen[0].signals[0].aspect is Aspect.GREEN
    assert [
        [each.signal for each in seen.signals] for seen in (witness.seen[0], witness.seen[-1])
    ] == [["1", "2"], []]
    assert not any("red light" in remark for remark in result.remarks)


def test_a_state_that_is_not_understood_is_said_to_be(tmp_path: Path) -> None:
    result = runner.run(scenario(tmp_path, "banana"), sut=None, timestep=DT, max_time=1.0)
    assert "banana (not understood by drivers)" in [
        each.text for each in events(result, "trafficSignal", "1")
    ]


@pytest.mark.parametrize(
    ("state", "aspect"),
    [
        ("off;on", Aspect.GREEN), ("on;on;off", Aspect.RED_YELLOW),
        ("off;flashing;off", Aspect.CAUTION),
        ("Amber", Aspect.YELLOW),
        ("attention_stop", Aspect.YELLOW), ("off;off;off", Aspect.OFF), ("on;off;on", None),
        ("7", None),
    ],
)  # fmt: skip
def test_states_have_aspects(state: str, aspect: Aspect | None) -> None:
    assert aspect_of(state) is aspect
