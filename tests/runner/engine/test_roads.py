"""The road network of a run: found in folders that are asked for, or made from
the positions that a scenario uses.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
import xosc
from runner.engine.compile.road_network import road_uses
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile, UsageError
from tests.commands import Command
from tests.runner.files import place, scenario, speed_action, story
from xodr.builders.roads_and_ramps import RoadUse

FAST = RunSettings(sut="none", world="kinematic")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("XOSC_ROAD_PATH", raising=False)


@pytest.fixture
def lost(tmp_path: Path) -> Path:
    """A scenario whose road network is in another folder, maps."""
    path = scenario(tmp_path / "scenarios")
    (tmp_path / "maps").mkdir()
    (path.parent / "straight.xodr").rename(tmp_path / "maps" / "straight.xodr")
    return path


def test_a_road_path_is_looked_in(lost: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="--road-path"):
        runner.run(lost, FAST)
    result = runner.run(lost, FAST, road_path=(str(tmp_path / "maps"),), strict=True)
    assert result.verdict.passed
    assert result.remarks == ()


def test_a_road_found_above_is_a_remark_and_refused_where_strict(
    lost: Path, tmp_path: Path
) -> None:
    (tmp_path / "maps" / "straight.xodr").rename(tmp_path / "straight.xodr")
    (remark,) = runner.run(lost, FAST).remarks
    assert f"{tmp_path / 'straight.xodr'} is taken" in remark
    with pytest.raises(InvalidFile, match="is taken"):
        runner.run(lost, FAST, strict=True)


def test_the_command_looks_in_its_road_paths_and_in_the_environment(
    lost: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = ("--sut", "none", "--world", "kinematic")
    assert command("xosc-run", lost, *options).code == 3
    assert (
        command(
            "xosc-run", lost, *options, "--road-path", tmp_path, "--road-path", tmp_path / "maps"
        ).code
        == 0
    )
    monkeypatch.setenv("XOSC_ROAD_PATH", str(tmp_path / "maps"))
    assert command("xosc-run", lost, *options).code == 0


def test_exports_take_the_road_along_from_where_it_is_found(
    lost: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_ROAD_PATH", str(tmp_path / "maps"))
    path = scenario(lost.parent, "braking", stories=story("Ego", [(0.5, speed_action(10))]))
    (lost.parent / "straight.xodr").unlink()
    assert command("xosc-export", path, "--to", "esmini", "--out", tmp_path / "out").code == 0
    assert list((tmp_path / "out").rglob("straight.xodr"))


@pytest.mark.parametrize("world", ["kinematic", "sumo"])
def test_a_road_is_made_only_where_it_is_asked_for(world: str, lost: Path) -> None:
    result = runner.run(lost, FAST, road="auto", world=world)
    assert result.verdict.passed
    (remark,) = result.remarks
    assert "straight ones are assumed, not connected: 1 (1 + 0 lanes, 1150 m)" in remark
    rows = result.trajectories.to_pylist()
    assert {(row["road_id"], row["lane_id"]) for row in rows} == {("1", -1)}
    assert rows[0]["s"] == pytest.approx(100.0)


def test_the_same_positions_have_the_same_road(lost: Path, tmp_path: Path) -> None:
    for _ in range(2):
        runner.run(lost, FAST, road="auto")
    assert len(list((tmp_path / "cache" / "roads").iterdir())) == 1


def test_a_made_road_is_refused_where_strict(lost: Path) -> None:
    with pytest.raises(InvalidFile, match="are assumed"):
        runner.run(lost, FAST, road="auto", strict=True)


def test_a_scenario_that_names_no_road_gets_none(tmp_path: Path) -> None:
    where = place("Ego", 100, 20) + place("Lead", 150, 10)
    for s in ("100", "150"):
        where = where.replace(
            f'<LanePosition roadId="1" laneId="-1" s="{s}"/>', f'<WorldPosition x="{s}" y="0"/>'
        )
    path = scenario(tmp_path, init=where)
    assert (
        runner.run(path, FAST, road="auto").remarks == runner.run(path, FAST).remarks
    )  # its own road is there
    (tmp_path / "straight.xodr").unlink()
    with pytest.raises(InvalidFile, match="does not exist: put it there"):
        runner.run(path, FAST)
    result = runner.run(path, FAST, road="auto")
    assert any("a plane without roads is assumed" in remark for remark in result.remarks)
    assert {row["road_id"] for row in result.trajectories.to_pylist()} == {None}


def test_a_road_file_serves_scenarios_that_have_none_and_no_others(
    tmp_path: Path, lost: Path
) -> None:
    (other,) = (tmp_path / "maps").glob("straight*")
    taken = runner.run(lost, FAST, road=str(other))
    assert any(f"{other} is taken" in remark for remark in taken.remarks)
    expected = runner.run(scenario(tmp_path / "whole"), FAST, road=str(other))
    assert not any("is taken" in remark for remark in expected.remarks)
    assert (
        taken.recording.tracks["Ego"].columns["x"] == expected.recording.tracks["Ego"].columns["x"]
    ).all()


def without_roads(path: Path) -> Path:
    """The scenario, which names no road network any more."""
    before, _, rest = path.read_text().partition("<LogicFile")
    path.write_text(before + rest.partition("/>")[2])
    return path


def test_roads_are_made_for_scenarios_that_name_none(tmp_path: Path, command: Command) -> None:
    path = without_roads(scenario(tmp_path, stories=story("Ego", [(0.5, speed_action(10))])))
    with pytest.raises(InvalidFile, match="let --road auto make straight roads"):
        runner.run(path, FAST)
    refused = command("xosc-export", path, "--to", "carla", "--out", tmp_path / "none")
    assert (refused.code, "scenario_runner plays on a map" in refused.err) == (4, True)
    expected = runner.run(path, FAST, road="auto")
    assert any(
        "the scenario names no road network; straight ones are assumed" in remark
        for remark in expected.remarks
    )
    for target in ("1.1", "esmini", "carla"):
        answer = command(
            "xosc-export", path, "--to", target, "--out", tmp_path / target, "--road", "auto"
        )
        assert (answer.code, "straight ones are assumed" in answer.out) == (0, True), answer.err
        got = (
            runner.run(tmp_path / target / path.name, FAST, max_time=2.0)
            .recording.tracks["Lead"]
            .columns
        )
        assert (got["x"] == expected.recording.tracks["Lead"].columns["x"]).all()


def test_scenarios_without_roads_stay_as_they_are_and_carla_has_no_map_for_them(
    tmp_path: Path, command: Command
) -> None:
    where = "".join(place(name, s, 20) for name, s in (("Ego", 100), ("Lead", 150)))
    for s in ("100", "150"):
        where = where.replace(
            f'<LanePosition roadId="1" laneId="-1" s="{s}"/>', f'<WorldPosition x="{s}" y="0"/>'
        )
    path = without_roads(
        scenario(tmp_path, init=where, stories=story("Ego", [(0.5, speed_action(10))]))
    )
    assert runner.run(path, FAST, road="auto").remarks == runner.run(path, FAST).remarks
    answer = command(
        "xosc-export", path, "--to", "carla", "--out", tmp_path / "out", "--road", "auto"
    )
    assert (
        answer.code,
        "scenario_runner plays on a map, and this scenario names none" in answer.err,
    ) == (4, True)


def test_another_road_is_refused() -> None:
    with pytest.raises(UsageError, match="the road 'curved' is neither a file nor auto"):
        RunSettings(road="curved")


def change(target: str) -> str:
    """A LaneChangeAction to a target."""
    dynamics = (
        '<LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>'
    )
    change = f"<LaneChangeAction>{dynamics}<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction>"
    return f"<PrivateAction><LateralAction>{change}</LateralAction></PrivateAction>"


@pytest.mark.parametrize(
    ("lane", "targets", "right", "left"),
    [
        (-1, [], 1, 0),
        (-3, [], 3, 0),
        (2, [], 0, 2),
        (-1, ['<AbsoluteTargetLane value="-2"/>'], 2, 0),
        (-1, ['<RelativeTargetLane entityRef="Ego" value="1"/>'], 2, 1),
        (-2, ['<RelativeTargetLane entityRef="Ego" value="1"/>'], 3, 0),
        (2, ['<RelativeTargetLane entityRef="Ego" value="-2"/>'], 1, 4),
    ],
)
def test_made_roads_have_the_lanes_that_are_used(
    lane: int, targets: list[str], right: int, left: int, tmp_path: Path
) -> None:
    init = place("Ego", 20, 20, lane) + place("Lead", "34.5", 10, lane)
    path = scenario(
        tmp_path, init=init, stories=story("Ego", [(0.5, change(target)) for target in targets])
    )
    document = xosc.resolve(xosc.load(path))
    assert road_uses(document.node) == [RoadUse("1", 1035, right, left)]
    (tmp_path / "straight.xodr").unlink()
    assert runner.run(path, FAST, road="auto").status == "completed"


def test_what_is_repaired_in_a_road_file_is_told_by_the_run_and_refused_where_strict(
    tmp_path: Path,
) -> None:
    path = scenario(tmp_path)
    road = tmp_path / "straight.xodr"
    text = road.read_text()
    link = '<link><successor elementType="road" elementId="99" contactPoint="start"/></link>'
    road.write_text(text.replace("<planView>", f"{link}<planView>", 1))
    (remark,) = runner.run(path, FAST).remarks
    assert "the road '99' does not exist; the link is left out" in remark
    assert remark.startswith(f"{road}:")
    with pytest.raises(InvalidFile, match="'99'"):
        runner.run(path, FAST, strict=True)


def test_ways_off_a_virtual_junction_are_a_remark_but_no_fault(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    road = tmp_path / "straight.xodr"
    connection = '<connection id="0" incomingRoad="1" connectingRoad="1" contactPoint="start"/>'
    junction = (
        '<junction id="9" type="virtual" mainRoad="1" sStart="40" '
        f'sEnd="60">{connection}</junction>'
    )
    road.write_text(road.read_text().replace("</OpenDRIVE>", f"{junction}</OpenDRIVE>"))
    for strict in (False, True):
        (remark,) = runner.run(path, FAST, strict=strict).remarks
        assert "ways off that road are not followed" in remark
