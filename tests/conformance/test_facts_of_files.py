"""Small inputs with one answer by the standard: what catalogues, versions, controllers of signals,
heights and ends of roads mean.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import runner
from runner.recording import signal_states
from schemas.common.errors import ToolchainError
from tests.conformance.scenes import CHANGE, TELEPORT, lane_position, play, start
from tests.conformance.support import at, track
from tests.conformance.test_ways import route, waypoint
from tests.runner.files import HEADER, ROADS, at_time, car, place, scenario, speed_action, story

# signals --------------------------------------------------------------------------------------


def controller(name: str, signal: str, phases: dict[str, float], more: str = "") -> str:
    """A controller whose phases are named as the states that they give to a signal."""
    inner = "".join(
        f'<Phase name="{state}" duration="{duration}">'
        f'<TrafficSignalState trafficSignalId="{signal}" state="{state}"/></Phase>'
        for state, duration in phases.items()
    )
    return f'<TrafficSignalController name="{name}" {more}>{inner}</TrafficSignalController>'


def signalled(folder: Path, controllers: str, stories: str = "") -> dict[str, list]:
    path = scenario(
        folder,
        entities=[car("Ego")],
        init=place("Ego", 100, 10),
        stories=stories,
        stop=12.0,
        road="signals",
    )
    text = path.read_text(encoding="utf-8")
    network = f"</LogicFile><TrafficSignals>{controllers}</TrafficSignals></RoadNetwork>"
    text = text.replace("/></RoadNetwork>", f">{network}")
    path.write_text(text, encoding="utf-8")
    result = runner.run(path, sut=None, world="kinematic", timestep=0.05, max_time=15.0)
    return signal_states(result.events)


def states(found: dict[str, list], signal: str, *times: float) -> list[str | None]:
    """States of a signal at times (s)."""
    changes = found.get(signal, [])
    shown = []
    for time in times:
        before = [change for change in changes if change[0] <= time + 1e-6]
        shown.append(before[-1][1] if before else None)
    return shown


def global_action(body: str) -> str:
    return f"<GlobalAction><InfrastructureAction><TrafficSignalAction>{body}</TrafficSignalAction></InfrastructureAction></GlobalAction>"


CYCLE = {"red": 3.0, "green": 2.0}


def test_controllers_of_two_signals_each_keep_their_times(tmp_path: Path) -> None:
    both = controller("A", "1", CYCLE) + controller("B", "2", {"green": 4.0, "red": 1.0})
    found = signalled(tmp_path, both)
    assert states(found, "1", 0, 2.9, 3.1, 4.9, 5.1, 8.1) == [
        "red",
        "red",
        "green",
        "green",
        "red",
        "green",
    ]
    assert states(found, "2", 0, 3.9, 4.1, 5.1) == ["green", "green", "red", "green"]


def test_a_controller_with_a_reference_begins_its_delay_later(tmp_path: Path) -> None:
    both = controller("A", "1", CYCLE) + controller("B", "2", CYCLE, 'delay="1" reference="A"')
    found = signalled(tmp_path, both)
    assert states(found, "2", 1.1, 3.9, 4.1, 5.9, 6.1) == ["red", "red", "green", "green", "red"]


def test_a_phase_that_an_action_sets_is_followed_by_the_next_ones(tmp_path: Path) -> None:
    action = global_action(
        '<TrafficSignalControllerAction trafficSignalControllerRef="A" phase="green"/>'
    )
    found = signalled(tmp_path, controller("A", "1", CYCLE), story("Ego", [(1.0, action)]))
    assert states(found, "1", 0.9, 1.1, 2.9, 3.1, 5.9, 6.1) == [
        "red",
        "green",
        "green",
        "red",
        "red",
        "green",
    ]


def test_a_state_that_an_action_sets_lasts_until_the_next_phase(tmp_path: Path) -> None:
    action = global_action('<TrafficSignalStateAction name="1" state="off"/>')
    found = signalled(tmp_path, controller("A", "1", CYCLE), story("Ego", [(1.0, action)]))
    assert states(found, "1", 0.9, 1.1, 2.9, 3.1) == ["red", "off", "off", "green"]


# catalogues -----------------------------------------------------------------------------------


def catalogue(name: str, *entries: str) -> str:
    return (
        f'<OpenSCENARIO>{HEADER}<Catalog name="{name}">{"".join(entries)}</Catalog></OpenSCENARIO>'
    )


def vehicle(name: str, length: float, width: str = "2", declared: str = "") -> str:
    """A Vehicle as a catalogue has it."""
    text = re.search(r"<Vehicle.*</Vehicle>", car("x"), re.DOTALL)
    assert text is not None
    body = (
        text[0].replace('name="car"', f'name="{name}"').replace('length="5"', f'length="{length}"')
    )
    return body.replace('width="2"', f'width="{width}"').replace(
        "<BoundingBox>", declared + "<BoundingBox>", 1
    )


def from_catalogue(folder: Path, reference: str, folders: tuple[str, ...]) -> runner.RunResult:
    entity = f'<ScenarioObject name="Ego">{reference}</ScenarioObject>'
    path = scenario(folder, entities=[entity], init=place("Ego", 100, 10), stop=1.0)
    kinds = ("VehicleCatalog", "PedestrianCatalog", "MiscObjectCatalog")
    locations = "".join(
        f'<{kind}><Directory path="{directory}"/></{kind}>'
        for kind, directory in zip(kinds, folders, strict=False)
    )
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace("<CatalogLocations/>", f"<CatalogLocations>{locations}</CatalogLocations>")
    )
    return runner.run(path, sut=None, world="kinematic", timestep=0.1)


def put(folder: Path, name: str, text: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")


def length_of(result: runner.RunResult) -> float:
    return result.recording.tracks["Ego"].box.length


REFERENCE = '<CatalogReference catalogName="{}" entryName="{}">{}</CatalogReference>'


def test_catalogues_of_one_name_in_two_folders_are_both_read(tmp_path: Path) -> None:
    put(tmp_path, "a/first.xosc", catalogue("Cars", vehicle("small", 3)))
    put(tmp_path, "b/second.xosc", catalogue("Cars", vehicle("large", 6)))
    result = from_catalogue(tmp_path, REFERENCE.format("Cars", "large", ""), ("a", "b"))
    assert length_of(result) == 6.0


@pytest.mark.parametrize("length", [3, 6])
def test_an_entry_that_two_files_have_is_a_remark_where_both_are_equal(
    length: float, tmp_path: Path
) -> None:
    put(tmp_path, "a/first.xosc", catalogue("Cars", vehicle("one", 3)))
    put(tmp_path, "a/second.xosc", catalogue("Cars", vehicle("one", length)))
    if length == 3:
        result = from_catalogue(tmp_path, REFERENCE.format("Cars", "one", ""), ("a",))
        assert any("second.xosc" in remark for remark in result.remarks)
        return
    with pytest.raises(ToolchainError, match="more than one entry is meant"):
        from_catalogue(tmp_path, REFERENCE.format("Cars", "one", ""), ("a",))


def test_an_entry_that_two_folders_have_is_a_remark(tmp_path: Path) -> None:
    put(tmp_path, "a/first.xosc", catalogue("Cars", vehicle("one", 3)))
    put(tmp_path, "b/second.xosc", catalogue("Cars", vehicle("one", 6)))
    result = from_catalogue(tmp_path, REFERENCE.format("Cars", "one", ""), ("a", "b"))
    assert length_of(result) == 3.0
    assert any("second.xosc" in remark for remark in result.remarks)


def test_an_entry_has_the_parameters_that_its_reference_gives(tmp_path: Path) -> None:
    declared = (
        '<ParameterDeclarations><ParameterDeclaration name="Width" parameterType="double" '
        'value="1.5"/>'
        "</ParameterDeclarations>"
    )
    put(tmp_path, "a/first.xosc", catalogue("Cars", vehicle("one", 3, "$Width", declared)))
    given = (
        '<ParameterAssignments><ParameterAssignment parameterRef="Width" '
        'value="1.9"/></ParameterAssignments>'
    )
    for assignments, width in (("", 1.5), (given, 1.9)):
        result = from_catalogue(tmp_path, REFERENCE.format("Cars", "one", assignments), ("a",))
        assert result.recording.tracks["Ego"].box.width == width


def test_folders_below_a_catalogue_folder_are_no_part_of_it(tmp_path: Path) -> None:
    put(tmp_path, "a/below/first.xosc", catalogue("Cars", vehicle("one", 3)))
    with pytest.raises(ToolchainError, match="Cars"):
        from_catalogue(tmp_path, REFERENCE.format("Cars", "one", ""), ("a",))


# versions -------------------------------------------------------------------------------------


def in_version(path: Path, minor: int, *changes: tuple[str, str]) -> Path:
    text = path.read_text(encoding="utf-8").replace('revMinor="3"', f'revMinor="{minor}"')
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("minor", [0, 1, 2, 3])
def test_a_default_mode_is_that_of_the_version(minor: int, tmp_path: Path) -> None:
    """Without followingMode a change of speed is bound by the Performance before
    1.2, and not from then on.
    """
    action = speed_action(20, 'dynamicsShape="linear" dynamicsDimension="time" value="1"')
    path = scenario(
        tmp_path,
        entities=[car("Ego", performance='maxSpeed="70" maxAcceleration="4" maxDeceleration="4"')],
        init=place("Ego", 100, 10),
        stories=story("Ego", [(1.0, action)]),
        stop=8.0,
    )
    ego = track(
        runner.run(in_version(path, minor), sut=None, world="kinematic", timestep=0.05), "Ego"
    )
    assert at(ego, 2.0, "speed") == pytest.approx(20.0 if minor >= 2 else 14.0, abs=0.05)


@pytest.mark.parametrize("minor", [0, 1, 2, 3])
def test_parts_that_a_version_lets_out_change_nothing(minor: int, tmp_path: Path) -> None:
    """Offsets, delays, edges, counts and StopTriggers have defaults that leave
    the motion as it is.
    """
    change = CHANGE.format(' targetLaneOffset="0"', '<AbsoluteTargetLane value="-2"/>')
    tracks = []
    for removed in ((), ('targetLaneOffset="0"', 'delay="0"', 'maximumExecutionCount="1"')):
        path = scenario(
            tmp_path,
            entities=[car("Ego")],
            init=place("Ego", 100, 10),
            stories=story("Ego", [(1.0, change)]),
            stop=5.0,
        )
        in_version(path, minor, *((text, "") for text in removed))
        tracks.append(track(runner.run(path, sut=None, world="kinematic", timestep=0.05), "Ego"))
    assert (tracks[0]["x"] == tracks[1]["x"]).all()
    assert (tracks[0]["y"] == tracks[1]["y"]).all()


# heights --------------------------------------------------------------------------------------


def kerb(folder: Path) -> None:
    """The straight road, with the lane -2 lifted by 0.15 m."""
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    at_lane = text.index('<lane id="-2"')
    width = text.index("/>", text.index("<width", at_lane)) + 2
    lifted = text[:width] + '<height sOffset="0" inner="0.15" outer="0.15"/>' + text[width:]
    (folder / "straight.xodr").write_text(lifted, encoding="utf-8")


HEIGHTS = {
    "lane": (lane_position(-2, 300), 0.15),
    "other lane": (lane_position(-1, 300), 0.0),
    "world without z": ('<WorldPosition x="300" y="-5.25"/>', 0.15),
    "road": ('<RoadPosition roadId="1" s="300" t="-5.25"/>', 0.15),
    "relative lane": ('<RelativeLanePosition entityRef="Lead" dLane="-1" ds="10"/>', 0.15),
    "relative road": ('<RelativeRoadPosition entityRef="Lead" ds="10" dt="-3.5"/>', 0.15),
}


@pytest.mark.parametrize("position", HEIGHTS)
def test_a_lifted_lane_lifts_what_stands_on_it(position: str, tmp_path: Path) -> None:
    text, height = HEIGHTS[position]
    kerb(tmp_path)
    init = start("Lead", lane_position(-1, 200), 0) + start("Ego", text, 0)
    ego = track(play(tmp_path, init), "Ego")
    assert ego["z"].tolist() == pytest.approx([height] * len(ego["z"]), abs=1e-9)


def test_a_lane_change_climbs_a_kerb(tmp_path: Path) -> None:
    kerb(tmp_path)
    change = CHANGE.format("", '<AbsoluteTargetLane value="-2"/>')
    init = place("Ego", 100, 10) + place("Lead", 300, 0, 2)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, change)])), "Ego")
    assert (at(ego, 0.9, "z"), at(ego, 5.0, "z")) == pytest.approx((0.0, 0.15), abs=1e-9)


# ends of roads --------------------------------------------------------------------------------


@pytest.mark.parametrize("position", ["s", "relative", "road"])
def test_a_place_beyond_the_road_is_refused_or_remarked(position: str, tmp_path: Path) -> None:
    texts = {
        "s": lane_position(-1, 1020),
        "relative": '<RelativeLanePosition entityRef="Lead" dLane="0" ds="50"/>',
        "road": '<RoadPosition roadId="1" s="-20" t="0"/>',
    }
    init = start("Lead", lane_position(-1, 980), 0) + start("Ego", lane_position(-1, 100), 0)
    stories = story("Ego", [(1.0, TELEPORT.format(texts[position]))])
    try:
        result = play(tmp_path, init, stories)
    except ToolchainError as error:
        assert re.search(r"scenario\.xosc:\d+", str(error))
        return
    assert result.remarks, "it was put somewhere in silence"


def test_the_end_of_a_road_stops_in_either_direction(tmp_path: Path) -> None:
    init = start("Ego", lane_position(-1, 970), 10) + start("Lead", lane_position(1, 30), 10)
    result = play(tmp_path, init)
    ego, lead = track(result, "Ego"), track(result, "Lead")
    assert (at(ego, 9.0, "s"), at(ego, 9.0, "speed")) == pytest.approx((1000.0, 0.0), abs=1e-6)
    assert (at(lead, 9.0, "s"), at(lead, 9.0, "speed")) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(("lane", "before"), [(-1, 970), (1, 30)])
def test_the_end_of_the_road_is_a_condition_that_takes_its_time(
    lane: int, before: float, tmp_path: Path
) -> None:
    body = (
        '<ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><EndOfRoadCondition duration="2"/></EntityCondition></ByEntityCondition>'
        "</Condition></ConditionGroup>"
    )
    text = story("Ego", [(99.0, speed_action(0))]).replace(at_time(99.0), body)
    result = play(
        tmp_path,
        start("Ego", lane_position(lane, before), 10) + start("Lead", lane_position(2, 500), 0),
        text,
    )
    begun = [
        e.time
        for e in result.events
        if e.kind == "startTransition" and e.subject.endswith("event0")
    ]
    assert begun == [pytest.approx(5.0, abs=0.11)]


# rings ----------------------------------------------------------------------------------------


def ring(folder: Path) -> None:
    """A closed road of 400 m, whose end is its beginning."""
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    text = text.replace('length="1000"', 'length="400"').replace(
        "<line/>", f'<arc curvature="{2 * math.pi / 400}"/>'
    )
    link = (
        '<link><predecessor elementType="road" elementId="1" contactPoint="end"/>'
        '<successor elementType="road" elementId="1" contactPoint="start"/></link><type'
    )
    text = text.replace("<type", link, 1)
    for lane in (1, 2, -1, -2):
        text = re.sub(
            rf'(<lane id="{lane}" type="driving" level="false">\s*)<link/>',
            rf'\1<link><predecessor id="{lane}"/><successor id="{lane}"/></link>',
            text,
        )
    (folder / "straight.xodr").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(("lane", "s", "there"), [(-1, 380, 10.0), (1, 20, 390.0)])
def test_a_ring_is_driven_over_its_end(lane: int, s: float, there: float, tmp_path: Path) -> None:
    ring(tmp_path)
    sign = 1 if lane < 0 else -1
    curve = 1 - sign * 0 - 2 * math.pi / 400 * (1.75 * (1 if lane > 0 else -1))
    init = start("Ego", lane_position(lane, s), 30 * curve / 4) + start(
        "Lead", lane_position(2, 200), 0
    )
    ego = track(play(tmp_path, init), "Ego")
    assert at(ego, 4.0, "s") == pytest.approx(there, abs=0.01)
    assert int(ego["lane_id"][-1]) == lane


@pytest.mark.parametrize("system", ["road", "lane"])
def test_distances_on_a_ring_are_the_shortest_way(system: str, tmp_path: Path) -> None:
    ring(tmp_path)
    condition = (
        '<ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/></TriggeringEntities>'
        '<EntityCondition><RelativeDistanceCondition entityRef="Lead" freespace="false"'
        f' relativeDistanceType="longitudinal" coordinateSystem="{system}"'
        ' value="{}" rule="{}"/></EntityCondition>'
        "</ByEntityCondition></Condition></ConditionGroup>"
    )
    init = start("Ego", lane_position(-1, 390), 0) + start("Lead", lane_position(-1, 10), 0)
    # lane -1 lies 1.75 m outside of the reference line
    way = 20.0 if system == "road" else 20.0 * (1.0 + 1.75 * 2.0 * math.pi / 400.0)
    for value, rule, true in (
        (way - 0.1, "greaterThan", True),
        (way + 0.1, "lessThan", True),
        (25, "greaterThan", False),
    ):
        text = story("Ego", [(99.0, speed_action(0))]).replace(
            at_time(99.0), condition.format(value, rule)
        )
        events = play(tmp_path, init, text).events
        begun = [e for e in events if e.kind == "startTransition" and e.subject.endswith("event0")]
        assert bool(begun) == true, (value, rule)


def test_a_route_over_a_joint_against_s_changes_lanes(tmp_path: Path) -> None:
    """A route that runs towards -s gets into the lane of its waypoint as one towards +s does."""
    body = route(waypoint(1, 1, 900), waypoint(1, 2, 300))
    init = place("Ego", 900, 20, 1) + place("Lead", 100, 0, -2)
    path = scenario(
        tmp_path,
        init=init,
        stories=story("Ego", [(0.0, f"<PrivateAction>{body}</PrivateAction>")]),
        stop=35.0,
    )
    ego = track(runner.run(path, sut=None, world="kinematic", timestep=0.05), "Ego")
    assert int(ego["lane_id"][abs(ego["s"] - 301.0).argmin()]) == 2


def test_a_left_hand_route_changes_lanes(tmp_path: Path) -> None:
    body = route(waypoint(1, 1, 100), waypoint(1, 2, 600))
    init = place("Ego", 100, 20, 1) + place("Lead", 100, 0, -2)
    path = scenario(
        tmp_path,
        init=init,
        stories=story("Ego", [(0.0, f"<PrivateAction>{body}</PrivateAction>")]),
        stop=30.0,
        road="straight_lht",
    )
    ego = track(runner.run(path, sut=None, world="kinematic", timestep=0.05), "Ego")
    assert int(ego["lane_id"][abs(ego["s"] - 599.0).argmin()]) == 2


@pytest.mark.parametrize(("lead", "ego"), [(300.0, 380.0), (390.0, 30.0), (60.0, 20.0)])
def test_a_synchronisation_on_a_ring_looks_ahead(lead: float, ego: float, tmp_path: Path) -> None:
    """Ego begins at s = 20 m or, over the end, at 380 m; Lead is at its place 40 to 300 m ahead."""
    ring(tmp_path)
    own = 380.0 if ego < lead else 20.0
    action = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Lead"><TargetPositionMaster>'
        f"{lane_position(-2, lead)}</TargetPositionMaster><TargetPosition>{lane_position(-1, ego)}"
        "</TargetPosition></SynchronizeAction></PrivateAction>"
    )
    init = start("Ego", lane_position(-1, own), 20) + start(
        "Lead", lane_position(-2, lead - 50), 10
    )
    result = play(tmp_path, init, story("Ego", [(0.0, action)]))
    ended = [
        e.time for e in result.events if e.kind == "endTransition" and e.subject.endswith("action0")
    ]
    assert len(ended) == 1 and ended[0] > 4.0
    at_goal = track(result, "Ego")["s"][abs(track(result, "Ego")["time"] - ended[0]).argmin()]
    assert abs(at_goal - ego) < 5.0


@pytest.mark.parametrize("lane", [0, -1])
def test_a_place_on_the_centre_lane_is_a_remark(lane: int, tmp_path: Path) -> None:
    path = scenario(tmp_path, entities=[car("Ego")], init=place("Ego", 100, 10, lane), stop=1.0)
    result = runner.run(path, sut=None, world="kinematic", timestep=0.1)
    assert any("is the centre lane" in remark for remark in result.remarks) == (lane == 0)
