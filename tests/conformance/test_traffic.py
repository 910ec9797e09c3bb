"""Traffic actions: when and where traffic appears and vanishes, and that SUMO's
drivers drive it.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from schemas.common.errors import InvalidFile, Unsupported
from tests.conformance.support import SCENARIOS, at, events, track
from tests.conformance.support import run as run_scenario

ROAD = SCENARIOS.parent / "roads" / "straight.xodr"
run = functools.partial(run_scenario, timestep=0.05)


def variant(
    folder: Path, element: str, *changes: tuple[str, str], **options: Any
) -> runner.RunResult:
    """Run the scenario of an element with parts of its text replaced."""
    text = (SCENARIOS / f"{element}.xosc").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / f"{element}.xosc"
    path.write_text(text)
    return runner.run(
        path, parameters={"Road": str(ROAD)}, **{"sut": None, "timestep": 0.05, **options}
    )


def between(text: str, tag: str) -> str:
    """The first element of that tag in a text."""
    return text[text.index(f"<{tag}") : text.index(f"</{tag}>") + len(f"</{tag}>")]


def spawned(result: runner.RunResult) -> dict[str, float]:
    """Time at which each participant was brought in."""
    return {event.subject: event.time for event in events(result, "spawned")}


# sources ------------------------------------------------------------------------------------


def test_a_source_brings_in_traffic_at_its_rate_from_its_start_on() -> None:
    times = spawned(run("TrafficSourceAction", parameters={"Rate": 0.25}, max_time=21.0))
    assert times == {f"Inflow_{k + 1}": pytest.approx(4.0 * k) for k in range(6)}


def test_traffic_appears_within_the_radius_in_its_lane_at_the_speed_given_and_drives_on() -> None:
    result = run("TrafficSourceAction", parameters={"Speed": 12}, max_time=10.0)
    first = track(result, "Inflow_1")
    assert first["time"][0] == pytest.approx(0.05)
    assert math.hypot(first["x"][0] - 12.0 * 0.05 - 100.0, first["y"][0] + 1.75) <= 3.0
    assert first["speed"][0] == pytest.approx(12.0)
    assert set(first["lane_id"]) <= {-1, -2}
    assert at(first, 8.0, "speed") > 15.0  # to the limit of the road
    assert at(first, 8.0, "x") > 200.0


def test_traffic_does_not_run_into_scripted_participants() -> None:
    result = run("TrafficSourceAction", parameters={"EgoS": 300, "EgoSpeed": 3})
    assert len(spawned(result)) > 5
    assert not events(result, "collision")


def test_runs_with_traffic_are_repeatable_and_depend_on_the_seed() -> None:
    first, second, other = (
        run("TrafficSwarmAction", max_time=6.0, seed=seed).trajectories for seed in (1, 1, 2)
    )
    assert first.equals(second)
    assert not first.equals(other)


def test_a_source_waits_while_there_is_no_room() -> None:
    times = spawned(
        run("TrafficSourceAction", parameters={"Rate": 100, "EgoS": 900}, max_time=10.0)
    )
    gaps = np.diff(sorted(times.values()))
    assert 3 <= len(times) <= 20
    assert min(gaps) > 0.5


def test_version_1_0_writes_velocity_and_a_traffic_definition(tmp_path: Path) -> None:
    text = (SCENARIOS / "TrafficSourceAction.xosc").read_text()
    definition = between((SCENARIOS / "TrafficSinkAction.xosc").read_text(), "TrafficDefinition")
    result = variant(
        tmp_path,
        "TrafficSourceAction",
        (between(text, "TrafficDistribution"), definition),
        ('speed="$Speed"', 'velocity="9"'),
        ('revMinor="3"', 'revMinor="0"'),
        max_time=30.0,
    )
    first = track(result, "Inflow_1")
    assert first["speed"][0] == pytest.approx(9.0)
    assert {event.text for event in events(result, "spawned")} == {"car", "truck"}


def test_without_any_distribution_traffic_consists_of_cars(tmp_path: Path) -> None:
    text = (SCENARIOS / "TrafficSourceAction.xosc").read_text()
    result = variant(
        tmp_path, "TrafficSourceAction", (between(text, "TrafficDistribution"), ""), max_time=6.0
    )
    assert {event.text for event in events(result, "spawned")} == {"car"}


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (('radius="3"', 'radius="-3"'), InvalidFile, "radius=-3 must not be negative"),
        (('rate="$Rate"', 'rate="-1"'), InvalidFile, "rate=-1 must not be negative"),
        (('rate="$Rate"', 'rate="NaN"'), InvalidFile, "rate"),
        (('weight="3"', 'weight="-3"'), InvalidFile, "weight=-3 must not be negative"),
        (('vehicleCategory="van"', 'vehicleCategory="trailer"'), Unsupported, "but no trailer"),
        (('vehicleCategory="van"', 'vehicleCategory="train"'), Unsupported, "but no train"),
    ],
)
def test_what_a_source_can_not_do_is_refused(
    tmp_path: Path,
    change: tuple[str, str],
    error: type[InvalidFile] | type[Unsupported],
    message: str,
) -> None:
    with pytest.raises(error, match=message) as caught:
        variant(tmp_path, "TrafficSourceAction", change, max_time=0.1)
    assert caught.value.line


def test_a_source_beside_the_road_is_refused(tmp_path: Path) -> None:
    aside = (
        '<LanePosition roadId="1" laneId="-1" s="100" offset="0"/>',
        '<WorldPosition x="100" y="80"/>',
    )
    with pytest.raises(InvalidFile, match="no lane within the radius"):
        variant(tmp_path, "TrafficSourceAction", aside, max_time=0.1)


def test_a_world_without_drivers_refuses_traffic() -> None:
    with pytest.raises(Unsupported, match=r"TrafficSourceAction\.xosc:\d+: .*no driver of its own"):
        run("TrafficSourceAction", world="kinematic")


# sinks --------------------------------------------------------------------------------------


def test_a_sink_takes_out_traffic_where_it_is() -> None:
    result = run("TrafficSinkAction")
    taken = [event.subject for event in events(result, "sink")]
    assert taken == [f"Inflow_{k + 1}" for k in range(len(taken))]
    assert len(taken) >= 5
    for name in taken:
        assert track(result, name)["x"].max() == pytest.approx(
            300.0 - 5.0 - 4.0, abs=3.0
        )  # its front comes within 5 m


def test_a_sink_keeps_to_its_rate() -> None:
    assert len(events(run("TrafficSinkAction", parameters={"SinkRate": 0.02}), "sink")) == 1


def test_a_sink_takes_the_categories_of_its_definition_only(tmp_path: Path) -> None:
    trucks = """<TrafficDefinition name="trucks">
      <VehicleCategoryDistribution><VehicleCategoryDistributionEntry category="truck" weight="1"/></VehicleCategoryDistribution>
      <ControllerDistribution><ControllerDistributionEntry weight="1"><Controller name="any"><Properties/></Controller>
      </ControllerDistributionEntry></ControllerDistribution></TrafficDefinition>"""
    result = variant(
        tmp_path,
        "TrafficSinkAction",
        ("</TrafficSinkAction>", f"{trucks}</TrafficSinkAction>"),
        max_time=40.0,
    )
    category = {event.subject: event.text for event in events(result, "spawned")}
    assert {category[event.subject] for event in events(result, "sink")} == {"truck"}


def test_a_sink_leaves_what_the_scenario_declares() -> None:
    result = run("TrafficSinkAction", parameters={"EgoS": 300}, max_time=5.0)
    assert track(result, "Ego")["time"].max() == pytest.approx(5.0)


# swarms -------------------------------------------------------------------------------------


def around_ego(result: runner.RunResult, name: str, first: bool) -> tuple[np.ndarray, np.ndarray]:
    """Position of a member of the swarm relative to the Ego, which drives along
    x; only when it appeared, or always.
    """
    ego, member = track(result, "Ego"), track(result, name)
    dx = member["x"] - np.interp(member["time"], ego["time"], ego["x"])
    dy = member["y"] - np.interp(member["time"], ego["time"], ego["y"])
    return (dx[:1], dy[:1]) if first else (dx, dy)


def test_a_swarm_stays_in_its_ellipse_and_appears_outside_the_inner_circle() -> None:
    result = run("TrafficSwarmAction", max_time=25.0)
    names = list(spawned(result))
    assert len(names) > 8
    for name in names:
        dx, dy = around_ego(result, name, first=False)
        assert np.all(
            np.hypot((dx - 20.0) / 200.0, dy / 50.0) <= 1.02
        )  # one step of delay at the border
        assert np.hypot(*around_ego(result, name, first=True))[0] >= 40.0 - 1.1


def test_a_swarm_keeps_its_number_and_begins_in_its_range_of_speed() -> None:
    result = run("TrafficSwarmAction", parameters={"Number": 5}, max_time=20.0)
    times = np.asarray(result.trajectories["time"].to_numpy())
    present = np.unique(times, return_counts=True)[1]
    assert present.max() == 1 + 5
    assert np.median(present) == 1 + 5
    for name in spawned(result):
        assert 18.0 <= track(result, name)["speed"][0] <= 22.0


@pytest.mark.parametrize(("same", "opposite", "heading"), [(1, 0, 0.0), (0, 2, math.pi)])
def test_a_swarm_travels_as_its_shares_say(same: float, opposite: float, heading: float) -> None:
    result = run(
        "TrafficSwarmAction", parameters={"Same": same, "Opposite": opposite}, max_time=3.0
    )
    assert spawned(result)
    for name in spawned(result):
        assert abs(math.remainder(track(result, name)["h"][0] - heading, math.tau)) < 0.01


# areas --------------------------------------------------------------------------------------


def test_an_area_of_road_ranges_is_kept_filled() -> None:
    result = run("TrafficAreaAction", max_time=30.0)
    names = [name for name in spawned(result) if name.startswith("Range_")]
    assert len(names) > 4
    for name in names:
        mine = track(result, name)
        assert mine["y"][0] == pytest.approx(-5.25, abs=0.01)  # lane -2
        assert mine["x"][0] >= 100.0
        assert mine["x"][-1] <= 500.0 + 2.0
    counts = [
        sum(
            float(track(result, name)["time"][0]) <= 20.0 <= float(track(result, name)["time"][-1])
            for name in names
        )
    ]
    assert counts[0] in (3, 4)


def test_a_polygon_that_is_not_continuous_is_filled_once() -> None:
    result = run("TrafficAreaAction")
    times = {name: time for name, time in spawned(result).items() if name.startswith("Polygon_")}
    assert list(times.values()) == [pytest.approx(2.0)] * 3
    for name in times:
        first = track(result, name)
        assert first["x"][0] + 2.0 >= 400.0
        assert first["x"][0] <= 700.0
        assert first["y"][0] > 0.0  # the left half of the road
        assert first["x"][-1] < 10.0  # it leaves the area, and the road at its end
    assert events(result, "endTransition", "FillAction")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('roadId="1" s="500"', 'roadId="9" s="500"'), "there is no road '9'"),
        (('roadId="1" s="500"', 'roadId="1" s="5000"'), "outside the road"),
        (('<Lane id="-2"/>', '<Lane id="-7"/>'), "has no lane -7"),
    ],
)
def test_an_area_that_is_not_there_is_refused(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    with pytest.raises(InvalidFile, match=message):
        variant(tmp_path, "TrafficAreaAction", change)


# stopping -----------------------------------------------------------------------------------


def test_traffic_is_stopped_by_its_name_and_what_is_on_the_road_drives_on() -> None:
    result = run("TrafficStopAction", parameters={"EgoS": 950}, max_time=16.0)
    times = spawned(result)
    assert [name for name in times if name.startswith("Inflow_")] == [
        f"Inflow_{k + 1}" for k in range(4)
    ]
    assert sum(name.startswith("Other_") for name in times) == 8
    assert track(result, "Inflow_4")["time"].max() == pytest.approx(16.0)


def test_a_name_that_no_traffic_has_is_refused(tmp_path: Path) -> None:
    stop = (
        '<TrafficAction trafficName="Inflow">\n                    <TrafficStop',
        '<TrafficAction trafficName="X"><TrafficStop',
    )
    with pytest.raises(
        InvalidFile, match="no traffic action of this scenario has the trafficName 'X'"
    ):
        variant(tmp_path, "TrafficStopAction", stop)
