"""Exports of documents: what is taken along, what is changed, what is refused,
and that nothing is overwritten.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import runner
import schemas
import xosc
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from tests.runner.files import at_time, car, distribution, place, scenario, speed_action, story
from xosc.exports import carla, esmini, standard
from xosc.exports.concrete import concrete
from xosc.exports.draft import ExportSettings, Folder

LIBRARY = Path(xosc.__file__).parent / "library"

BRAKES = story("Lead", [(0.5, speed_action(5))])

Export = Callable[[Path, str, Folder], list[str]]


def lane_change(
    target: str, dynamics: str = 'dynamicsShape="linear" dynamicsDimension="time" value="2"'
) -> str:
    return (
        f"<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics {dynamics}/>"
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"
    )


def motion(path: Path) -> dict[str, np.ndarray]:
    result = runner.run(path, world="kinematic", sut="none", timestep=0.1)
    return {
        name: np.column_stack([track.columns[c] for c in "xyh"])
        for name, track in result.recording.tracks.items()
    }


def refused(export: Export, path: Path, target: str, tmp_path: Path) -> str:
    """The refusal, which names file and line, and after which there is no file."""
    with pytest.raises(Unsupported) as caught:
        export(path, target, Folder(tmp_path / "refused"))
    assert re.match(rf"{re.escape(str(path))}:\d+: \w+: ", str(caught.value))
    assert not list((tmp_path / "refused").rglob("*.xosc"))
    return caught.value.message


# the folder ---------------------------------------------------------------------------------


def test_two_sources_of_one_name_get_two_names(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    names = [
        folder.name(tmp_path / source, "road.xodr")
        for source in ("a/road.xodr", "b/ROAD.xodr", "a/road.xodr")
    ]
    assert names == ["road.xodr", "road~2.xodr", "road.xodr"]


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = scenario(tmp_path, "own", stories=BRAKES)
    before = path.read_bytes()
    with pytest.raises(UsageError, match="in the way"):
        standard.export(path, "1.3", Folder(tmp_path))
    assert path.read_bytes() == before
    for _ in range(2):  # the same export again is no matter
        standard.export(path, "1.3", Folder(tmp_path / "out"))


# the standard's versions --------------------------------------------------------------------


def test_an_export_can_be_moved_away_from_its_sources(tmp_path: Path) -> None:
    standard.export(LIBRARY / "cut_in_highway_variation.xosc", "1.3", Folder(tmp_path / "out"))
    moved = (tmp_path / "out").rename(tmp_path / "moved")
    files = sorted(str(path.relative_to(moved)) for path in moved.rglob("*.*"))
    assert (
        "roads/highway_straight.xodr" in files and "catalogs/vehicles/vehicle_catalog.xosc" in files
    )
    (varied, _), *_ = xosc.variations(moved / "cut_in_highway_variation.xosc")
    assert varied == moved / "cut_in_highway.xosc"
    expected = motion(LIBRARY / "cut_in_highway.xosc")
    assert all(np.allclose(rows, expected[name]) for name, rows in motion(varied).items())


def test_parameters_stay_where_the_version_can_say_them(tmp_path: Path) -> None:
    path = scenario(
        tmp_path,
        init=place("Ego", 100, "$Ego_Speed") + place("Lead", 160, "$Lead_Speed"),
        stories=BRAKES,
    )
    assert standard.export(path, "1.0", Folder(tmp_path / "out")) == []
    assert motion(path)["Lead"] == pytest.approx(motion(tmp_path / "out" / path.name)["Lead"])
    exported = xosc.load(tmp_path / "out" / path.name)
    assert [each.get("name") for each in exported.root.iter("ParameterDeclaration")] == [
        "Gap",
        "Ego_Speed",
        "Lead_Speed",
    ]


def test_a_distribution_becomes_scenarios_before_there_were_distributions(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    sets = distribution(tmp_path, "sets", {"Gap": (40.0, 60.0, 10.0)})
    (remark,) = standard.export(sets, "1.0", Folder(tmp_path / "out"))
    assert "each set of parameters" in remark
    assert [each.name for each in sorted((tmp_path / "out").glob("*.xosc"))] == [
        f"sets~00000{n}.xosc" for n in range(3)
    ]
    assert motion(tmp_path / "out" / "sets~000001.xosc")["Lead"] == pytest.approx(
        motion(path)["Lead"]
    )


def with_catalogued_lead(
    folder: Path, minor: int, stories: str = BRAKES, length: str = "5"
) -> Path:
    """A scenario whose Lead is of a catalogue of a version."""
    vehicle = re.search("<Vehicle.*</Vehicle>", car("Lead"), re.DOTALL)
    assert vehicle is not None
    (folder / "catalogs").mkdir()
    header = (
        f'<FileHeader revMajor="1" revMinor="{minor}" date="2026-01-01T00:00:00" author="t" '
        'description="t"/>'
    )
    entry = vehicle[0].replace('length="5"', f'length="{length}"')
    if minor < 3:  # until 1.3 a vehicle has Properties
        entry = entry.replace("</Axles>", "</Axles><Properties/>")
    text = f'<OpenSCENARIO>{header}<Catalog name="cars">{entry}</Catalog></OpenSCENARIO>'
    (folder / "catalogs" / "cars.xosc").write_text(text)
    lead = (
        '<ScenarioObject name="Lead"><CatalogReference catalogName="cars" '
        'entryName="car"/></ScenarioObject>'
    )
    path = scenario(folder, entities=[car("Ego"), lead], stories=stories)
    located = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="catalogs"/></VehicleCatalog></CatalogLocations>'
    )
    path.write_text(path.read_text().replace("<CatalogLocations/>", located))
    return path


def test_old_scenarios_worked_out_with_newer_catalogues_move_as_before(tmp_path: Path) -> None:
    at_once = speed_action(
        5, 'dynamicsShape="linear" dynamicsDimension="time" value="0.1"'
    )  # more than Lead can do
    path = with_catalogued_lead(tmp_path, 3, story("Lead", [(0.5, at_once)]))
    path.write_text(
        path.read_text()
        .replace('revMinor="3"', 'revMinor="1"')
        .replace("</Axles>", "</Axles><Properties/>")
    )
    worked_out = concrete(xosc.load(path))
    assert worked_out.version == (1, 3)
    copy = tmp_path / "worked_out.xosc"
    xosc.write(worked_out, copy)
    assert all(np.array_equal(rows, motion(path)[name]) for name, rows in motion(copy).items())
    assert (
        esmini.export(path, "esmini", Folder(tmp_path / "out")) == []
    )  # where it stands as it is, nothing is said of it


def test_catalogue_entries_keep_seeing_the_parameters_of_the_scenario(tmp_path: Path) -> None:
    path = with_catalogued_lead(tmp_path, 1, length="$Gap")
    (remark,) = standard.export(path, "1.3", Folder(tmp_path / "out"))
    assert "$Gap is of the scenario" in remark
    result = runner.run(tmp_path / "out" / path.name, world="kinematic", sut="none", timestep=0.1)
    assert result.recording.tracks["Lead"].box.length == 50.0


def test_what_old_versions_leave_open_is_said_in_new_ones_and_left_out_again(
    tmp_path: Path,
) -> None:
    old = (
        scenario(tmp_path / "old", stories=BRAKES)
        .read_text()
        .replace('revMinor="3"', 'revMinor="1"')
    )
    (tmp_path / "old" / "scenario.xosc").write_text(
        old.replace("</Axles>", "</Axles><Properties/>")
    )
    standard.export(tmp_path / "old" / "scenario.xosc", "1.2", Folder(tmp_path / "new"))
    (told,) = xosc.load(tmp_path / "new" / "scenario.xosc").root.findall(
        "Storyboard/Story//SpeedActionDynamics"
    )
    assert told.get("followingMode") == "follow"
    standard.export(tmp_path / "new" / "scenario.xosc", "1.1", Folder(tmp_path / "again"))
    assert "followingMode" not in (tmp_path / "again" / "scenario.xosc").read_text()
    assert all(np.array_equal(rows, motion(tmp_path / "new" / "scenario.xosc")[name])
               for name, rows in motion(tmp_path / "old" / "scenario.xosc").items())  # fmt: skip


def test_total_accelerations_cannot_be_said_before_1_2(tmp_path: Path) -> None:
    by_entity = (
        '<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><AccelerationCondition value="1" '
        'rule="greaterThan"/></EntityCondition></ByEntityCondition>'
    )
    path = scenario(tmp_path, stories=BRAKES)
    timed = re.compile("<ByValueCondition>.*?</ByValueCondition>")
    path.write_text(timed.sub(by_entity, path.read_text(), count=1))
    assert "total acceleration" in refused(standard.export, path, "1.1", tmp_path)


def test_what_a_version_cannot_say_is_refused(tmp_path: Path) -> None:
    random = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
    path = scenario(tmp_path, stories=story("Ego", [(0.5, random)]))
    assert "RandomRouteAction" in refused(standard.export, path, "1.1", tmp_path)


@pytest.mark.parametrize(
    ("road", "reason"),
    [("nowhere.xodr", "does not exist"), ("/dev/zero", "can't be taken along: this is not a reg")],
)
@pytest.mark.parametrize("target", ["esmini", "carla"])
def test_a_road_that_cannot_be_taken_along_is_named(
    road: str, reason: str, target: str, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    path.write_text(path.read_text().replace("straight.xodr", road))
    export = {"esmini": esmini.export, "carla": carla.export}[target]
    with pytest.raises(InvalidFile, match=rf"scenario\.xosc:\d+: LogicFile: .*{road} {reason}"):
        export(path, target, Folder(tmp_path / "out"))


@pytest.mark.parametrize("target", ["1.0", "1.1"])
def test_another_version_of_a_scenario_needs_no_road(target: str, tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    path.write_text(path.read_text().replace("straight.xodr", "nowhere.xodr"))
    remarks = standard.export(path, target, Folder(tmp_path / "out"))
    named = "nowhere.xodr does not exist: it is named as before"
    assert sum(remark.endswith(named) for remark in remarks) == 1
    exported = xosc.load(tmp_path / "out" / path.name)
    assert exported.root.find("RoadNetwork/LogicFile").get("filepath").endswith("nowhere.xodr")
    with pytest.raises(InvalidFile, match="put it there"):
        standard.export(path, target, Folder(tmp_path / "strict"), ExportSettings(strict=True))


# carla --------------------------------------------------------------------------------------


def test_carla_gets_a_hero_and_valid_1_0(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Ego", [(0.5, speed_action(5))]))
    carla.export(path, "carla", Folder(tmp_path / "out"))
    exported = tmp_path / "out" / path.name
    assert (xosc.load(exported).version, schemas.check(exported)) == ((1, 0), [])
    root = xosc.load(exported).root
    kinds = {
        each.get("name"): each.find(".//Property[@name='type']").get("value")
        for each in root.iter("ScenarioObject")
    }
    assert kinds == {"hero": "ego_vehicle", "Lead": "simulation"}
    assert {each.get("entityRef") for each in root.iter("EntityRef", "Private")} == {"hero", "Lead"}
    assert not [value for each in root.iter() for value in each.attrib.values() if "$" in value]
    assert (tmp_path / "out" / "roads" / "straight.xodr").read_bytes() == (
        tmp_path / "straight.xodr"
    ).read_bytes()
    assert motion(exported)["Lead"][:20] == pytest.approx(motion(path)["Lead"][:20])


@pytest.mark.parametrize(
    ("lane", "target", "left"),
    [
        (-2, '<AbsoluteTargetLane value="-1"/>', 1),
        (-2, '<AbsoluteTargetLane value="-3"/>', -1),
        (1, '<AbsoluteTargetLane value="2"/>', -1),
        (2, '<AbsoluteTargetLane value="1"/>', 1),
        (-2, '<RelativeTargetLane entityRef="Lead" value="0"/>', 1),
        (-1, '<RelativeTargetLane entityRef="Lead" value="-2"/>', -2),
        (-2, '<RelativeTargetLane entityRef="Ego" value="1"/>', 1),
    ],
)
def test_carla_counts_lanes_to_the_left_of_the_actor(
    lane: int, target: str, left: int, tmp_path: Path
) -> None:
    init = place("Ego", 100, 10, lane=lane) + place("Lead", 150, 10, lane=-1)
    path = scenario(tmp_path, init=init, stories=story("Ego", [(0.5, lane_change(target))]))
    remarks = carla.export(path, "carla", Folder(tmp_path / "out"))
    (relative,) = xosc.load(tmp_path / "out" / path.name).root.iter("RelativeTargetLane")
    assert (relative.get("entityRef"), int(relative.get("value", ""))) == ("hero", left)
    (dynamics,) = xosc.load(tmp_path / "out" / path.name).root.iter("LaneChangeActionDynamics")
    assert (dynamics.get("dynamicsDimension"), float(dynamics.get("value", ""))) == (
        "distance",
        20.0,
    )
    assert any("20 m" in remark for remark in remarks)


@pytest.mark.parametrize("lane", [-2, 1])
def test_carla_gets_first_positions_on_lanes_whichever_way_the_traffic_drives(
    lane: int, tmp_path: Path
) -> None:
    relative = '<RelativeLanePosition entityRef="Ego" dLane="1" ds="30" offset="0.0"/>'
    lead = place("Lead", 150, 10).replace(
        '<LanePosition roadId="1" laneId="-1" s="150"/>', relative
    )
    path = scenario(tmp_path, init=place("Ego", 100, 10, lane=lane) + lead, stories=BRAKES)
    carla.export(path, "carla", Folder(tmp_path / "out"))
    position = xosc.load(tmp_path / "out" / path.name).root.findall(".//LanePosition")[1]
    assert (position.get("laneId"), position.get("s")) == (str(lane + 1), "130.0")
    assert motion(tmp_path / "out" / path.name)["Lead"][0] == pytest.approx(motion(path)["Lead"][0])


def test_carla_positions_beyond_the_first_road_are_refused(tmp_path: Path) -> None:
    far = '<RelativeLanePosition entityRef="Ego" dLane="0" ds="30000"/>'
    lead = place("Lead", 150, 10).replace('<LanePosition roadId="1" laneId="-1" s="150"/>', far)
    path = scenario(tmp_path, init=place("Ego", 100, 10) + lead, stories=BRAKES)
    assert "not known" in refused(carla.export, path, "carla", tmp_path)


def test_carla_gets_the_time_that_a_rate_takes(tmp_path: Path) -> None:
    brake = speed_action(4, 'dynamicsShape="sinusoidal" dynamicsDimension="rate" value="3"')
    path = scenario(
        tmp_path,
        init=place("Ego", 20, 10) + place("Lead", 80, 10),
        stories=story("Lead", [(0.5, brake)]),
        stop=6.0,
    )
    carla.export(path, "carla", Folder(tmp_path / "out"))
    text = (
        (tmp_path / "out" / path.name)
        .read_text()
        .replace("<StopTrigger/>", f"<StopTrigger>{at_time(6.0)}</StopTrigger>")
    )
    (tmp_path / "out" / path.name).write_text(
        text.replace('rule="greaterOrEqual"', 'rule="greaterThan"')
    )
    rows, expected = motion(tmp_path / "out" / path.name)["Lead"], motion(path)["Lead"]
    assert rows[: len(expected)] == pytest.approx(expected[: len(rows)], abs=1e-6)


def test_carla_ends_each_act_when_the_time_of_the_stop_trigger_has_come(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=story("Ego", [(9.0, speed_action(5))]), stop=6.0)
    (remark,) = [
        remark
        for remark in carla.export(path, "carla", Folder(tmp_path / "out"))
        if "StopTrigger" in remark
    ]
    assert "its times end the acts" in remark
    root = xosc.load(tmp_path / "out" / path.name).root
    times = [
        each.get("value") for each in root.iterfind(".//Act/StopTrigger//SimulationTimeCondition")
    ]
    assert times == ["5.999998"]
    result = runner.run(tmp_path / "out" / path.name, sut=None, world="kinematic", max_time=8.0)
    (stop,) = [
        each.time
        for each in result.events
        if each.kind == "stopTransition" and each.subject.endswith("act")
    ]
    assert stop == pytest.approx(6.0, abs=0.06)


def test_carla_gets_a_later_time_for_a_delay(tmp_path: Path) -> None:
    path = scenario(
        tmp_path, stories=story("Ego", [(0.5, speed_action(5))]).replace('delay="0"', 'delay="2"')
    )
    carla.export(path, "carla", Folder(tmp_path / "out"))
    conditions = list(xosc.load(tmp_path / "out" / path.name).root.iter("Condition"))
    assert {each.get("delay") for each in conditions} == {"0"}
    times = sorted(
        float(each.get("value", ""))
        for each in xosc.load(tmp_path / "out" / path.name).root.iter("SimulationTimeCondition")
    )
    assert times == pytest.approx([2.0, 2.0, 2.5], abs=1e-5), "the first ends the act"


@pytest.mark.parametrize(
    ("action", "reason"),
    [
        (lane_change('<AbsoluteTargetLane value="1"/>'), "same direction"),
        (
            lane_change(
                '<AbsoluteTargetLane value="-2"/>',
                'dynamicsShape="linear" dynamicsDimension="rate" value="1"',
            ),
            "distance",
        ),
        (
            (
                '<PrivateAction><VisibilityAction graphics="true" sensors="true" '
                'traffic="true"/></PrivateAction>'
            ),
            "this action",
        ),
    ],
)
def test_carla_is_refused_by_name(action: str, reason: str, tmp_path: Path) -> None:
    assert reason in refused(
        carla.export, scenario(tmp_path, stories=story("Ego", [(0.5, action)])), "carla", tmp_path
    )


def test_carla_lanes_are_not_known_after_another_change(tmp_path: Path) -> None:
    changes = [
        (0.5, lane_change('<AbsoluteTargetLane value="-2"/>')),
        (5.0, lane_change('<AbsoluteTargetLane value="-1"/>')),
    ]
    message = refused(
        carla.export, scenario(tmp_path, stories=story("Ego", changes)), "carla", tmp_path
    )
    assert "known only when it runs" in message


# esmini -------------------------------------------------------------------------------------


def test_esmini_gets_parameters_and_distributions(tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    sets = distribution(tmp_path, "sets", {"Gap": (40.0, 60.0, 10.0)})
    assert esmini.export(sets, "esmini", Folder(tmp_path / "out")) == []
    assert sorted(each.name for each in (tmp_path / "out").glob("*.xosc")) == [
        path.name,
        "sets.xosc",
    ]
    assert len(list(xosc.variations(tmp_path / "out" / "sets.xosc"))) == 3
    assert motion(tmp_path / "out" / path.name)["Lead"] == pytest.approx(motion(path)["Lead"])


def test_esmini_is_told_what_it_does_not_read(tmp_path: Path) -> None:
    remarks = esmini.export(LIBRARY / "simple_cut_in.xosc", "esmini", Folder(tmp_path))
    assert [remark.split(": ")[1] for remark in remarks] == [
        "ConstraintGroup",
        "RelativeDistanceCondition",
    ]
    assert all(re.match(r".+simple_cut_in\.xosc:\d+: ", remark) for remark in remarks)


@pytest.mark.parametrize(
    ("action", "reason"),
    [
        (speed_action(5, 'dynamicsShape="linear" dynamicsDimension="time" value="2" '
                         'followingMode="follow"'), "followingMode"),
        ('<PrivateAction><LateralAction><LateralDistanceAction entityRef="Lead" '
         'freespace="true" continuous="true" '
         'displacement="any"/></LateralAction></PrivateAction>', "displacement"),
    ],
)  # fmt: skip
def test_esmini_is_refused_by_name(action: str, reason: str, tmp_path: Path) -> None:
    assert reason in refused(
        esmini.export, scenario(tmp_path, stories=story("Ego", [(0.5, action)])), "esmini", tmp_path
    )


def test_a_catalogue_entry_is_refused_where_it_stands(tmp_path: Path) -> None:
    catalog = tmp_path / "catalogs" / "routes.xosc"
    catalog.parent.mkdir()
    point = (
        '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" '
        's="{}"/></Position></Waypoint>'
    )
    catalog.write_text(
        '<OpenSCENARIO>\n<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" '
        'author="t" description="t"/>\n'
        '<Catalog name="routes">\n<Route name="round" '
        f'closed="true">{point.format(10)}{point.format(90)}</Route>\n'
        "</Catalog></OpenSCENARIO>"
    )
    assign = (
        '<PrivateAction><RoutingAction><AssignRouteAction><CatalogReference catalogName="routes" '
        'entryName="round"/>'
        "</AssignRouteAction></RoutingAction></PrivateAction>"
    )
    path = scenario(
        tmp_path, entities=[car("Ego"), car("Lead")], stories=story("Ego", [(0.5, assign)])
    )
    located = (
        "<CatalogLocations><RouteCatalog><Directory "
        'path="catalogs"/></RouteCatalog></CatalogLocations>'
    )
    path.write_text(path.read_text().replace("<CatalogLocations/>", located))
    with pytest.raises(Unsupported, match=r"routes\.xosc:4: Route: esmini's routes are open"):
        esmini.export(path, "esmini", Folder(tmp_path / "out"))


def test_an_export_differs_from_its_file_where_it_says_something_else(tmp_path: Path) -> None:
    source = scenario(tmp_path)
    text = re.sub(r"<\?xml.*?\?>", "", source.read_text()).strip().replace("/>", " />")
    text = text.replace("><", ">\n      <").replace("<FileHeader ", "<FileHeader\n        ")
    text = f'<?xml version="1.0" encoding="utf-8"?>\n<!-- whose -->\n<!-- /> mine -->\n{text}\n'
    source.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    standard.export(source, "1.3", Folder(tmp_path / "out"))

    old, new = source.read_bytes(), (tmp_path / "out" / source.name).read_bytes()
    assert new != old
    assert new.startswith(b"\xef\xbb\xbf") and new.count(b"\r\n") == new.count(b"\n")
    changed = set(new.splitlines()) - set(old.splitlines())
    assert all(b"FileHeader" in line or b"LogicFile" in line for line in changed)
    assert schemas.check(tmp_path / "out" / source.name) == schemas.check(source)


def test_what_is_added_to_a_file_of_another_encoding_is_read_as_it_is_meant(
    tmp_path: Path,
) -> None:
    source = scenario(tmp_path)
    text = re.sub(r"<\?xml.*?\?>", "", source.read_text()).strip()
    named = re.sub(r'author="[^"]*"', 'author="J&#252;rgen"', text, count=1)
    source.write_text(f'<?xml version="1.0" encoding="ISO-8859-1"?>\n{named}\n')
    standard.export(source, "1.3", Folder(tmp_path / "out"))
    written = xosc.load(tmp_path / "out" / source.name).root
    header = written.find("FileHeader")
    assert header is not None and header.get("author") == "Jürgen"
