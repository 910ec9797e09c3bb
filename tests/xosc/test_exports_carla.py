"""What CARLA's scenario_runner makes of the exported library, where there is one."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import runner
import xosc
from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from schemas.common.errors import Unsupported
from tests.conformance.support import changed
from tests.xosc.scenario_runner_grammar import stops_at
from xosc.exports import carla
from xosc.exports.draft import Folder

LIBRARY = Path(xosc.__file__).parent / "library"
PYTHON, SOURCES = (
    os.environ.get("XOSC_CARLA_PYTHON", ""),
    os.environ.get("XOSC_SCENARIO_RUNNER", ""),
)
"""A Python that has `carla` (its wheel, no server) and what scenario_runner
needs; the folder that has its `srunner`.
"""


def exported_library(folder: Folder) -> list[Path]:
    """The scenarios of the library that can be exported, written into a folder."""
    exported = []
    for path in sorted(LIBRARY.glob("*.xosc")):
        if xosc.load(path).kind == "scenario":
            (done,) = export_documents([path], TARGETS["carla"], folder)
            exported += [path] if done.exit_code == 0 else []
    assert len(exported) > 40
    return exported


@pytest.mark.slow
def test_exports_hold_nothing_that_its_parser_stops_at(tmp_path: Path) -> None:
    for path in exported_library(Folder(tmp_path)):
        assert not stops_at(xosc.load(tmp_path / path.name).root), path.name


STOPS = [
    ("<RoutingAction><AcquirePositionAction/></RoutingAction>", "AcquirePositionAction"),
    ("<RoutingAction><FollowTrajectoryAction><Clothoid/></FollowTrajectoryAction></RoutingAction>",
        "FollowTrajectoryAction"),
    ("<TeleportAction><Position><RoutePosition/></Position></TeleportAction>", "RoutePosition"),
    ("<ControllerAction><AssignControllerAction/></ControllerAction>", "ControllerAction"),
    ("<VisibilityAction/>", "VisibilityAction"),
]  # fmt: skip


@pytest.mark.parametrize(("action", "element"), STOPS)
def test_the_stand_in_stops_where_the_parser_does(action: str, element: str) -> None:
    xml = (
        "<OpenSCENARIO><FileHeader revMajor='1' "
        f"revMinor='0'/><Storyboard><Story><Action><PrivateAction>{action}</PrivateAction>"
    )
    root = etree.fromstring(f"{xml}</Action></Story></Storyboard></OpenSCENARIO>")
    assert element in {stop.rpartition(" ")[2] for stop in stops_at(root)}


DIALECT = Path(__file__).parents[1] / "conformance" / "carla" / "dialect.xosc"


def export_changed(folder: Path, *changes: tuple[str, str]) -> etree._Element:
    """The root of what is exported of the conformance scenario of CARLA's
    dialect with texts replaced.
    """
    carla.export(
        changed(DIALECT, folder, ('delay="1"', 'delay="0"'), *changes),
        "carla",
        Folder(folder / "out"),
    )
    return xosc.load(folder / "out" / "changed.xosc").root


@pytest.mark.parametrize("date", ["2026-01-01T12:30:00", "2026-01-01T12:30:00.250+02:00"])
def test_dates_have_neither_fractions_nor_zones(tmp_path: Path, date: str) -> None:
    environment = f"""<Actions><GlobalAction><EnvironmentAction><Environment name="day">
        <TimeOfDay animation="false" dateTime="{date}"/>
        <Weather cloudState="free"><Sun intensity="1" azimuth="0" elevation="1"/><Fog visualRange="1000"/>
        <Precipitation precipitationType="dry" intensity="0"/></Weather><RoadCondition frictionScaleFactor="1"/></Environment>
        </EnvironmentAction></GlobalAction>"""
    root = export_changed(tmp_path, ("<Actions>", environment))
    assert [each.get("dateTime") for each in root.iter("TimeOfDay")] == [
        "2026-01-01T12:30:00"
    ] and not stops_at(root)


PLACE, HERO = (
    '<WorldPosition x="150" y="1.75" h="0"/>',
    '<LanePosition roadId="1" laneId="-1" s="100"/>',
)
STANDARD = ('value="CARLA:Conformance"', 'value="Conformance"')


def test_axes_are_the_standard_s_in_exports(tmp_path: Path) -> None:
    root = export_changed(tmp_path)
    place = next(root.iter("WorldPosition"))
    assert (float(place.get("y")), root.find("FileHeader").get("description")) == (
        -1.75,
        "Conformance",
    )


@pytest.mark.parametrize(("lane", "offset"), [("-1", -0.5), ("1", 0.5)])
def test_offsets_are_written_to_the_right_of_the_traffic(
    tmp_path: Path, lane: str, offset: float
) -> None:
    there = f'<LanePosition roadId="1" laneId="{lane}" s="130" offset="0.5"/>'
    root = export_changed(tmp_path, (PLACE, there), STANDARD)
    assert [
        float(each.get("offset")) for each in root.iter("LanePosition") if each.get("s") == "130"
    ] == [offset]


@pytest.mark.parametrize(
    "values",
    [
        ('RelativeLanePosition entityRef="hero" dLane="-1" ds="20" offset="0.5"'),
        'RelativeRoadPosition entityRef="hero" ds="20" dt="-1"',
    ],
)
def test_what_counts_to_the_right_stays_in_files_for_carla_and_is_refused_in_others(
    tmp_path: Path, values: str
) -> None:
    root = export_changed(tmp_path, (PLACE, f"<{values}/>"))
    tag, *attributes = values.split()
    assert dict(next(root.iter(tag)).attrib) == dict(
        each.replace('"', "").split("=") for each in attributes
    )
    with pytest.raises(Unsupported, match="to the right of the traffic"):
        export_changed(tmp_path / "..", (PLACE, f"<{values}/>"), STANDARD)


@pytest.mark.parametrize(
    ("lane", "value"), [(HERO, -1.0), ('<LanePosition roadId="1" laneId="1" s="200"/>', 1.0)]
)
def test_lane_offsets_are_written_to_the_right(tmp_path: Path, lane: str, value: float) -> None:
    action = """<PrivateAction><LateralAction><LaneOffsetAction continuous="true">
        <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget>
        </LaneOffsetAction></LateralAction></PrivateAction></Private><Private entityRef="adversary">"""
    root = export_changed(
        tmp_path,
        ('</Private>\n        <Private entityRef="adversary">', action),
        (HERO, lane),
        STANDARD,
    )
    assert float(next(root.iter("AbsoluteTargetLaneOffset")).get("value")) == value


@pytest.mark.parametrize(("flag", "distance"), [(True, "-2"), (True, "2"), (False, "-2")])
def test_lateral_distances_keep_their_side(tmp_path: Path, flag: bool, distance: str) -> None:
    action = f"""<PrivateAction><LateralAction><LateralDistanceAction entityRef="hero" distance="{distance}" freespace="false"
        continuous="true"/></LateralAction></PrivateAction></Private></Actions>"""
    root = export_changed(
        tmp_path, ("</Private>\n      </Actions>", action), *([] if flag else [STANDARD])
    )
    assert float(next(root.iter("LateralDistanceAction")).get("distance")) == float(distance)


def test_a_scenario_without_a_description_gets_its_file_as_name(tmp_path: Path) -> None:
    root = export_changed(tmp_path, ('value="CARLA:Conformance"', 'value=""'))
    assert next(root.iter("FileHeader")).get("description") == "changed"


def test_a_position_at_the_end_of_a_road_is_moved_to_the_last_that_carla_has(
    tmp_path: Path,
) -> None:
    root = export_changed(tmp_path, (HERO, '<LanePosition roadId="1" laneId="-1" s="1000"/>'))
    assert next(root.iter("LanePosition")).get("s") == "999.99"


ROAD = 'id="1" junction="-1"'
JUNCTION = '<junction id="9" name="" type="direct"/></OpenDRIVE>'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</OpenDRIVE>", JUNCTION, "direct junctions"),
        (ROAD, 'id="main" junction="-1"', "ids of roads as numbers"),
    ],
)
def test_roads_that_carla_makes_no_map_of_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    road = (DIALECT.parents[1] / "roads" / "signals.xodr").read_text(encoding="utf-8")
    assert old in road
    (tmp_path / "changed.xodr").write_text(road.replace(old, new), encoding="utf-8")
    ids = [('roadId="1"', 'roadId="main"')] if "main" in new else []
    signals = str(DIALECT.parents[1] / "roads" / "signals.xodr")
    with pytest.raises(Unsupported, match=message):
        export_changed(tmp_path, (signals, "changed.xodr"), *ids)


def test_a_scenario_without_roads_is_refused(tmp_path: Path) -> None:
    signals = str(DIALECT.parents[1] / "roads" / "signals.xodr")
    with pytest.raises(Unsupported, match="plays on a map, and this scenario names none"):
        export_changed(tmp_path, (f'<LogicFile filepath="{signals}"/>', ""))


def test_scenario_runner_reads_the_library_and_starts_everyone_where_we_do(tmp_path: Path) -> None:
    if not (PYTHON and SOURCES):
        pytest.skip("XOSC_CARLA_PYTHON and XOSC_SCENARIO_RUNNER name no scenario_runner")
    exported = exported_library(Folder(tmp_path))
    reader = Path(__file__).with_name("scenario_runner_reader.py")
    files = [str(tmp_path / path.name) for path in exported]
    answer = subprocess.run([PYTHON, str(reader), SOURCES, *files], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr[-2000:]
    read = [json.loads(line) for line in answer.stdout.splitlines() if line.startswith("{")]
    assert [each["file"] for each in read] == [path.name for path in exported]
    assert not [each for each in read if "error" in each]
    for path, told in zip(exported, read, strict=True):
        result = runner.run(path, world="kinematic", sut="none", timestep=0.1, max_time=0.2)
        assert told["egos"] == ["hero"] and told["made"] > 1
        for name, start in told["starts"].items():
            columns = result.recording.tracks[result.ego if name == "hero" else name].columns
            here = [float(columns[each][0]) for each in ("x", "y", "h", "speed")]
            assert np.allclose(start[:2], here[:2], atol=0.05), (path.name, name)
            assert np.cos(start[2] - here[2]) > 0.999 and start[3] == pytest.approx(here[3])
    assert len(exported) > 20
