"""A pass is earned: runs in which nothing was tested are inconclusive, by the
evidence that they lack.
"""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from lxml import etree

import runner
from runner.batch.arrays import play, structures
from runner.batch.outputs.folder import load_run
from runner.judging.evidence.array_judge import OPEN
from runner.judging.evidence.rows import ROWS
from schemas.common.errors import InvalidFile
from schemas.expressions.columns import NotInArrays
from tests.commands import Command
from tests.runner.files import at_time, car, place, scenario, speed_action, story

QUICK = runner.RunSettings(world="kinematic", sut="none")
DRIVEN = runner.RunSettings(world="kinematic", sut="cas")
SAFE = place("Ego", 100, 20) + place("Lead", 400, 20)


def changed(path: Path, changes: dict[str, str]) -> Path:
    """A file in which texts are replaced."""
    text = path.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


def causes(path: Path, settings: runner.RunSettings = QUICK, **more: Any) -> set[str]:
    """Causes of a run, which arrays judge alike or leave to the interpreter."""
    verdict = runner.run(path, settings, **more).verdict
    assert (verdict.outcome == "inconclusive") == bool(verdict.causes)
    chosen = replace(settings, **more)
    with suppress(NotInArrays):
        for structure in structures(path, [{}], chosen):
            for block in play(structure, chosen):
                assert block.outcomes.outcome[0] in {OPEN, verdict.outcome}
    return {cause.name for cause in verdict.causes}


def values(path: Path, settings: runner.RunSettings = QUICK, **more: Any) -> dict[str, float]:
    return {each.name: each.value for each in runner.run(path, settings, **more).verdict.evidence}


def delete(name: str) -> str:
    return (
        "<GlobalAction><EntityAction "
        f'entityRef="{name}"><DeleteEntityAction/></EntityAction></GlobalAction>'
    )


def teleport(s: float) -> str:
    where = f'<LanePosition roadId="1" laneId="-1" s="{s}"/>'
    return f"<PrivateAction><TeleportAction><Position>{where}</Position></TeleportAction></PrivateAction>"


RIGID = (
    '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="20" '
    'freespace="true" continuous="true" displacement="any" coordinateSystem="entity"/>'
    "</LongitudinalAction></PrivateAction>"
)


def activate(longitudinal: str, lateral: str) -> str:
    switch = f'<ActivateControllerAction lateral="{lateral}" longitudinal="{longitudinal}"/>'
    return f"<PrivateAction><ControllerAction>{switch}</ControllerAction></PrivateAction>"


HELD = (
    '<PrivateAction><ControllerAction><OverrideControllerValueAction><Brake active="true">'
    "<BrakePercent "
    'value="1"/></Brake></OverrideControllerValueAction></ControllerAction></PrivateAction>'
)
COMMAND = (
    "<UserDefinedAction><CustomCommandAction "
    'type="x">nothing</CustomCommandAction></UserDefinedAction>'
)


def by_entity(condition: str) -> str:
    return (
        '<ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByEntityCondition>'
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="Ego"/></TriggeringEntities>'
        f"<EntityCondition>{condition}</EntityCondition></ByEntityCondition></Condition></ConditionGroup>"
    )


CONTACT = by_entity('<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>')


def high(name: str, x: float, y: float, z: float, speed: float) -> str:
    where = f'<WorldPosition x="{x}" y="{y}" z="{z}" h="0"/>'
    return (
        f'<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>{where}</Position></TeleportAction>'
        f"</PrivateAction>{speed_action(speed)}</Private>"
    )


def criterion(name: str, parameter: str = "", value: str = "", delay: str = "0") -> str:
    return (
        f'<ConditionGroup><Condition name="criteria_{name}" delay="{delay}" '
        'conditionEdge="rising"><ByValueCondition>'
        f'<ParameterCondition parameterRef="{parameter}" value="{value}" rule="lessThan"/>'
        "</ByValueCondition></Condition></ConditionGroup>"
    )


def test_a_run_that_tests_something_has_all_evidence(tmp_path: Path) -> None:
    path = scenario(tmp_path, init=SAFE, stories=story("Lead", [(0.5, speed_action(19))]), stop=3.0)
    found = values(path, DRIVEN)
    seconds = ("seconds", "ego_seconds", "road_seconds", "command_seconds", "longitudinal_seconds")
    assert [round(found[name], 6) for name in seconds] == [3.0] * 5
    assert (
        found["lateral_seconds"] == 0.0 and found["events"] == 1.0 and found["participants"] == 1.0
    )
    assert causes(path, DRIVEN) == set()
    assert "command_seconds" not in values(path)


@pytest.mark.parametrize(
    ("init", "expected"),
    [
        (place("Lead", 150, 10), {"absent", "short"}),
        (place("Ego", 100, 20), {"absent"}),
        (SAFE + delete("Ego"), set()),
        (high("Ego", 100, -1.75, 500, 20) + place("Lead", 150, 10), {"misplaced"}),
        (place("Ego", 100, 20) + high("Lead", 150, -1.75, 50, 10), {"misplaced"}),
    ],
    ids=["ego", "partner", "deleted-before-it-is-placed", "ego-aloft", "partner-aloft"],
)
def test_participants_that_are_not_where_the_file_says(
    tmp_path: Path, init: str, expected: set[str]
) -> None:
    assert causes(scenario(tmp_path, init=init)) == expected


def test_nobody_placed(tmp_path: Path) -> None:
    path = scenario(tmp_path, init="<!-- -->")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("<Actions><!-- --></Actions>", "<Actions/>"), encoding="utf-8")
    for settings in (QUICK, DRIVEN):
        assert "absent" in causes(path, settings)


@pytest.mark.parametrize(
    ("story_of", "settings"),
    [
        (delete("Ego"), QUICK),
        (delete("Ego"), DRIVEN),
        (delete("Lead"), QUICK),
        (teleport(400), QUICK),
    ],
)
def test_who_is_removed_or_put_elsewhere_before_a_contact(
    tmp_path: Path, story_of: str, settings: runner.RunSettings
) -> None:
    stories = story("Lead", [(1, story_of)])
    assert causes(scenario(tmp_path, stories=stories, stop=6.0), settings) == {"removed"}


def test_who_leaves_when_nothing_comes_near_may_go(tmp_path: Path) -> None:
    stories = story("Lead", [(1, delete("Lead"))])
    assert causes(scenario(tmp_path, init=SAFE, stories=stories, stop=3.0)) == set()


@pytest.mark.parametrize("more", [activate("false", "false"), HELD])
def test_a_system_that_did_not_drive(tmp_path: Path, more: str) -> None:
    path = scenario(tmp_path, init=place("Ego", 100, 20, more=more) + place("Lead", 400, 20))
    result = runner.run(path, DRIVEN)
    assert {cause.name for cause in result.verdict.causes} == {"not-driven"}
    assert result.verdict.reasons[0].startswith("cas did not drive Ego for 2.00 s of 2.00 s (")
    assert causes(path) == set()


ON, OFF = activate("true", "true"), activate("false", "false")


@pytest.mark.parametrize(
    ("stories", "settings", "expected"),
    [
        (story("Ego", [(0.15, OFF)]), DRIVEN, {"not-driven"}),
        (story("Ego", [(1, OFF)]), DRIVEN, set()),
        (story("Lead", [(1, RIGID)]), QUICK, {"removed"}),
    ],
    ids=["hardly", "half", "rigid"],
)
def test_a_part_of_a_run_may_be_too_small(
    tmp_path: Path, stories: str, settings: runner.RunSettings, expected: set[str]
) -> None:
    init = place("Ego", 100, 20, more=ON) + place("Lead", 150, 10)
    assert causes(scenario(tmp_path, init=init, stories=stories, stop=2.5), settings) == expected


def test_a_system_that_drove_for_a_part_says_how_long_it_did_not(tmp_path: Path) -> None:
    stories = story("Ego", [(1, activate("false", "false"))])
    init = place("Ego", 100, 20, more=activate("true", "true")) + place("Lead", 400, 20)
    result = runner.run(scenario(tmp_path, init=init, stories=stories), DRIVEN)
    assert result.verdict.passed
    assert any("cas did not drive Ego for 1.00 s of 2.00 s" in remark for remark in result.remarks)


def test_a_system_that_an_action_hands_the_ego_says_until_when_it_did_not_drive(
    tmp_path: Path,
) -> None:
    init = place("Ego", 100, 20) + place("Lead", 400, 20)
    late = scenario(tmp_path, "late", init=init, stories=story("Ego", [(1, ON)]))
    (told,) = [text for text in runner.run(late, DRIVEN).remarks if "did not drive" in text]
    assert re.search(
        r"for 1\.\d\d s of 2\.00 s \(until 1\.\d\d s, when an action of the scenario hands over\)",
        told,
    )
    never = scenario(tmp_path, "never", init=init, stories=story("Ego", [(9, ON)]))
    reason = runner.run(never, DRIVEN).verdict.reasons[0]
    assert "(the scenario hands over by an action, which did not start)" in reason


@pytest.mark.parametrize(
    "written",
    [
        criterion("RunningStopTestt"),
        criterion("DrivenDistanceTest ", "distance_success", "10"),
        criterion("DrivenDistanceTest"),
        criterion("DrivenDistanceTest", "distance_success", "10", delay="1000000000"),
        criterion("OffRoadTest"),
    ],
    ids=["misspelt", "blank", "no-value", "late", "no-road"],
)
def test_a_criterion_that_can_not_be_judged(tmp_path: Path, written: str) -> None:
    path = scenario(tmp_path, init=SAFE)
    if "OffRoad" in written:
        init = high("Ego", 0, 0, 0, 20) + high("Lead", 400, 0, 0, 20)
        path = changed(scenario(tmp_path, init=init), {'<LogicFile filepath="straight.xodr"/>': ""})
    changed(path, {at_time(2.0, "end"): at_time(2.0, "end") + written})
    assert causes(path) == {"not-judged"}
    assert causes(path, least=("criteria=0",)) == set()


def test_a_criterion_that_is_judged_passes(tmp_path: Path) -> None:
    sound = criterion("DrivenDistanceTest", "distance_success", "10")
    path = changed(
        scenario(tmp_path, init=SAFE), {at_time(2.0, "end"): at_time(2.0, "end") + sound}
    )
    assert causes(path) == set() and values(path)["criteria"] == 1.0


@pytest.mark.parametrize("time", [0.0, 0.01, 0.05])
def test_a_run_of_no_time(tmp_path: Path, time: float) -> None:
    assert causes(scenario(tmp_path, init=SAFE), max_time=time) == {"short"}


def test_a_stop_trigger_that_waits_for_what_never_started(tmp_path: Path) -> None:
    state = (
        '<ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>'
        '<StoryboardElementStateCondition storyboardElementType="event" '
        'storyboardElementRef="event1" state="completeState"/>'
        "</ByValueCondition></Condition></ConditionGroup>"
    )
    stories = story("Lead", [(0.2, speed_action(19)), (500, speed_action(18))])
    path = changed(scenario(tmp_path, init=SAFE, stories=stories), {at_time(2.0, "end"): state})
    assert causes(path, max_time=2.0) == {"unfinished"}
    verdict = runner.run(path, QUICK, max_time=2.0).verdict
    assert any(
        "the stop trigger waits for event 'event1', which never started" in each
        for each in verdict.reasons
    )


@pytest.mark.parametrize("offset", ['y="1000000"', 'y="60"'])
def test_a_box_beside_its_reference_point(tmp_path: Path, offset: str) -> None:
    aside = car("Ego").replace('Center x="1.5" y="0"', f'Center x="1.5" {offset}')
    path = scenario(tmp_path, entities=[aside, car("Lead")])
    if "60" in offset:
        assert causes(path) == {"misplaced"}
    else:
        assert "misplaced" in causes(path)


def test_events_that_only_wait_for_the_contact_that_the_end_cuts_off(tmp_path: Path) -> None:
    stories = story("Lead", [(1, speed_action(0))]).replace(at_time(1), CONTACT)
    assert causes(scenario(tmp_path, stories=stories, stop=3.0)) == {"unfinished"}
    assert causes(scenario(tmp_path, init=SAFE, stories=stories, stop=3.0)) == set()


def test_an_end_shortly_before_a_contact_that_no_brake_avoids(tmp_path: Path) -> None:
    assert causes(scenario(tmp_path, stop=4.3)) == {"open-end"}
    assert causes(scenario(tmp_path, stop=3.0)) == set()


def test_commands_that_nobody_obeys_are_no_events(tmp_path: Path) -> None:
    assert causes(scenario(tmp_path, init=SAFE, stories=story("Lead", [(0.5, COMMAND)]))) == {
        "empty"
    }


def test_a_contact_without_an_ego_is_no_pass(tmp_path: Path) -> None:
    path = changed(scenario(tmp_path, stop=6.0), {'"Ego"': '"Host"'})
    assert causes(path) == {"no-ego"}
    assert causes(changed(scenario(tmp_path, init=SAFE), {'"Ego"': '"Host"'})) == set()


def test_two_storyboards_of_which_one_is_read(tmp_path: Path) -> None:
    path = scenario(tmp_path, init=SAFE)
    text = path.read_text(encoding="utf-8")
    board = text[text.index("<Storyboard>") : text.index("</OpenSCENARIO>")]
    path.write_text(text.replace("</OpenSCENARIO>", board + "</OpenSCENARIO>"), encoding="utf-8")
    assert causes(path) == set()  # the same twice
    other = board.replace('s="400"', 's="130"')
    path.write_text(text.replace("</OpenSCENARIO>", other + "</OpenSCENARIO>"), encoding="utf-8")
    assert causes(path) == {"ignored"}


# where it is told -----------------------------------------------------------------------------


def test_results_table_and_report_have_the_evidence(tmp_path: Path, command: Command) -> None:
    path, out, junit = scenario(tmp_path, init=SAFE), tmp_path / "out", tmp_path / "j.xml"
    answer = command("xosc-run", path, "--world", "kinematic", "--out", out, "--junit", junit)
    assert (
        answer.code == 0 and "participants 2 of 2" in answer.out and "command 2.00 s" in answer.out
    )
    told = {
        each["name"]: each
        for each in json.loads((out / "scenario" / "result.json").read_text())["evidence"]
    }
    assert told["participants"]["planned"] == 2 and told["ego_seconds"]["value"] == pytest.approx(
        2.0
    )
    (row,) = pq.read_table(out / "runs.parquet").to_pylist()
    assert dict(row["evidence"])["command_seconds"] == pytest.approx(2.0)
    case = etree.parse(junit).find(".//testcase")
    assert (
        case.xpath("string(properties/property[@name='evidence_participants']/@value)") == "2 of 2"
    )
    stored = load_run(out / "scenario").verdict
    assert stored.passed and [each.name for each in stored.evidence] == list(told)


def test_a_stored_pass_without_its_evidence_is_damaged(tmp_path: Path) -> None:
    folder = runner.run(scenario(tmp_path, init=SAFE), QUICK).save(tmp_path / "run")
    stored = json.loads((folder / "result.json").read_text())
    for each in stored["evidence"]:
        if each["name"] == "ego_seconds":
            each["value"] = 0.0
    (folder / "result.json").write_text(json.dumps(stored))
    with pytest.raises(InvalidFile, match="does not follow"):
        load_run(folder)


def test_dry_run_plain_run_and_inconclusive_run_differ_in_junit(
    tmp_path: Path, command: Command
) -> None:
    passing, empty = (
        scenario(tmp_path / "a", init=SAFE),
        scenario(tmp_path / "b", init=place("Lead", 1, 1)),
    )
    found = []
    for path, options in ((passing, ()), (passing, ("--dry-run",)), (empty, ())):
        report = tmp_path / "j.xml"
        command(
            "xosc-run", path, "--world", "kinematic", "--sut", "none", "--junit", report, *options
        )
        (case,) = etree.parse(report).iter("testcase")
        skipped = case.find("skipped")
        state = case.xpath("string(properties/property[@name='state']/@value)")
        found.append((state, None if skipped is None else skipped.get("type")))
    assert found == [("passed", None), ("loaded", "loaded"), ("inconclusive", "inconclusive")]


@pytest.mark.parametrize("name", list(ROWS))
def test_each_row_has_words_and_a_least_value(name: str) -> None:
    row = ROWS[name]
    assert row.meaning and row.missing and row.least >= 0.0 and row.cause
    assert not row.within or row.within in ROWS


def test_least_values_are_settable_and_named(tmp_path: Path, command: Command) -> None:
    path = scenario(tmp_path, init=SAFE)
    options = ("--world", "kinematic", "--sut", "none")
    assert command("xosc-run", path, *options, "--least", "ego_seconds=5").code == 6
    assert command("xosc-run", path, *options, "--max-time", "0.05").code == 6
    lower = ("--least", "seconds=0", "--least", "ego_seconds=0", "--least", "road_seconds=0")
    assert command("xosc-run", path, *options, "--max-time", "0.05", *lower).code == 0
    for wrong, said in (
        ("ego_second=1", "did you mean 'ego_seconds'?"),
        ("ego_seconds", "a name and a value"),
        ("events=x", "no number"),
    ):
        answer = command("xosc-run", path, *options, "--least", wrong)
        assert answer.code == 2 and said in answer.err


def vertex(time: float, x: float) -> str:
    place = f'<Position><WorldPosition x="{x}" y="-1.75" h="0"/></Position>'
    return f'<Vertex time="{time}">{place}</Vertex>'


def trajectory(*vertices: str) -> str:
    """A PrivateAction that follows a polyline."""
    return (
        '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" '
        'closed="false"><ParameterDeclarations/><Shape><Polyline>'
        + "".join(vertices)
        + "</Polyline>"
        "</Shape></Trajectory></TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="
        '"relative" offset="0" scale="1"/></TimeReference><TrajectoryFollowingMode followingMode='
        '"position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )


@pytest.mark.parametrize("repaired", [True, False])
def test_a_speed_beyond_the_performance_names_the_repair_of_the_motion(
    tmp_path: Path, repaired: bool
) -> None:
    between = [vertex(1.0, 300.0)] if repaired else []
    way = trajectory(vertex(0.0, 210.0), vertex(1.0, 230.0), *between, vertex(1.5, 330.0))
    init = place("Ego", 100, 20) + place("Lead", 200, 20)
    path = scenario(tmp_path, init=init, stories=story("Lead", [(0.5, way)]), stop=3.0)
    verdict = runner.run(path, sut="none", world="kinematic").verdict
    assert verdict.outcome == "inconclusive"
    (told,) = (cause.text for cause in verdict.causes if cause.name == "performance")
    named = f"perhaps by a repair of the file: {path}:32: the time 1 is that of another place, too"
    assert (named in told) == repaired
