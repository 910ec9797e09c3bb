"""Runs that did not test what their file describes: inconclusive, with a cause, and never green."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from lxml import etree

import runner
from runner.batch.outputs.folder import load_run
from tests.commands import Command
from tests.runner.files import (
    HEADER,
    at_time,
    car,
    distribution,
    place,
    scenario,
    speed_action,
    story,
)

KINEMATIC = runner.RunSettings(world="kinematic", sut="none")
BRAKES = story("Lead", [(0.5, speed_action(5))])
WAITS = """<ConditionGroup>
<Condition name="near" delay="0" conditionEdge="none"><ByEntityCondition>
  <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>
  <EntityCondition>{}</EntityCondition>
</ByEntityCondition></Condition></ConditionGroup>"""
NEAR = WAITS.format(
    '<RelativeDistanceCondition value="1" freespace="true" entityRef="Lead" rule="lessThan" '
    'relativeDistanceType="longitudinal"/>'
)
CONTACT = WAITS.format('<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>')


def write(
    folder: Path,
    changes: dict[str, str] | None = None,
    stories: str = BRAKES,
    stop: float = 1.0,
    speed: float = 10,
) -> Path:
    """A scenario of a leader that brakes at 0.5 s, with texts of its file replaced."""
    init = place("Ego", 100, speed) + place("Lead", 150, 10)
    path = scenario(folder, init=init, stories=stories, stop=stop)
    text = path.read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        assert old in text, old
        text = text.replace(old, new, 1)
    path.write_text(text, encoding="utf-8")
    return path


def line_of(path: Path, text: str) -> int:
    lines = path.read_text(encoding="utf-8").splitlines()
    return next(number for number, line in enumerate(lines, 1) if text in line)


def causes(path: Path, **settings: Any) -> list[str]:
    return [cause.name for cause in runner.run(path, KINEMATIC, **settings).verdict.causes]


def test_a_run_with_an_event_is_tested(tmp_path: Path) -> None:
    verdict = runner.run(write(tmp_path), KINEMATIC).verdict
    assert (verdict.outcome, verdict.passed, verdict.reasons) == ("passed", True, ())


def test_no_event_names_what_it_waited_for(tmp_path: Path) -> None:
    path = write(tmp_path, {at_time(0.5): NEAR})
    verdict = runner.run(path, KINEMATIC).verdict
    (reason,) = verdict.reasons
    assert (verdict.outcome, [cause.name for cause in verdict.causes]) == (
        "inconclusive",
        ["no-event"],
    )
    assert reason.startswith(
        f"{path}:{line_of(path, '<Event ')}: no event has started: the run "
        "ended at 1.00 s, by end: "
    )
    assert "event 'event0' waited for near: " in reason


def test_an_event_that_a_sound_run_does_not_have_is_not_missed(tmp_path: Path) -> None:
    assert causes(write(tmp_path, {at_time(0.5): CONTACT})) == []


AFTER = """<ConditionGroup><Condition name="after" delay="0" conditionEdge="none"><ByValueCondition>
  <StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="event0" state="completeState"/>
</ByValueCondition></Condition></ConditionGroup>"""


def test_a_limit_of_time_that_cuts_events_off_leaves_the_run_unfinished(tmp_path: Path) -> None:
    late = story("Lead", [(0.2, speed_action(5)), (0.6, speed_action(9))])
    path = write(tmp_path, {at_time(0.6): NEAR}, stories=late)
    (cause,) = runner.run(path, KINEMATIC).verdict.causes
    assert cause.name == "unfinished" and "by end: simulation time" in cause.text
    assert f"{path}:{line_of(path, chr(34) + 'event1')}: not all events have started" in cause.text
    assert causes(path, max_time=0.5) == ["unfinished"]
    assert causes(write(tmp_path, stories=late)) == []
    assert (
        causes(write(tmp_path, {at_time(0.2): CONTACT, at_time(0.6): AFTER}, stories=late)) == []
    )  # after a mishap
    empty = write(tmp_path, {at_time(0.6): NEAR}, stories=late)
    text = re.sub(
        r'(<Action name="action1">).*?(</Action>)',
        r"\1\2",
        empty.read_text(encoding="utf-8"),
        flags=re.DOTALL,
    )
    empty.write_text(text, encoding="utf-8")
    assert causes(empty) == []


OF_ANOTHER_VARIANT = """<ConditionGroup><Condition name="variant" delay="0" conditionEdge="none"><ByValueCondition>
  <ParameterCondition parameterRef="Gap" value="7" rule="equalTo"/>
</ByValueCondition></Condition></ConditionGroup>"""
SETS_IT = (
    '<GlobalAction><ParameterAction parameterRef="Gap"><SetAction '
    'value="8"/></ParameterAction></GlobalAction>'
)


def test_an_event_for_another_value_of_a_parameter_is_not_missed_unless_something_sets_it(
    tmp_path: Path,
) -> None:
    events = story("Lead", [(0.2, speed_action(5)), (0.6, speed_action(9))])
    assert causes(write(tmp_path, {at_time(0.6): OF_ANOTHER_VARIANT}, stories=events)) == []
    sets = story("Lead", [(0.2, speed_action(5)), (0.6, speed_action(9)), (0.3, SETS_IT)])
    assert causes(write(tmp_path, {at_time(0.6): OF_ANOTHER_VARIANT}, stories=sets)) == [
        "unfinished"
    ]
    act = (
        story("Ego", [(0.6, speed_action(9))])
        .replace(at_time(0), OF_ANOTHER_VARIANT)
        .replace('name="story"', 'name="other"')
    )
    assert causes(write(tmp_path, stories=BRAKES + act)) == []
    alone = story("Lead", [(0.6, speed_action(9))])
    assert causes(write(tmp_path, {at_time(0.6): OF_ANOTHER_VARIANT}, stories=alone)) == [
        "no-event"
    ]


@pytest.mark.parametrize(("actor", "expected"), [("Lead", ["unfinished"]), ("Ego", [])])
def test_an_action_without_end_that_the_stop_trigger_waits_for(
    actor: str, expected: list[str], tmp_path: Path
) -> None:
    """A rate of 0 never gets there; what the system under test does about its
    own actions is its own.
    """
    slow = story(
        actor,
        [(0.2, speed_action(5, 'dynamicsShape="linear" dynamicsDimension="rate" value="0.001"'))],
    )
    path = write(tmp_path, {at_time(1.0, "end"): AFTER}, stories=slow)
    found = runner.run(path, KINEMATIC, max_time=1.0).verdict.causes
    assert [cause.name for cause in found] == expected
    assert all(
        "event 'event0' was still running, for whose end the stop trigger waits" in cause.text
        for cause in found
    )


def test_no_executions_at_all_are_taken_for_one(tmp_path: Path) -> None:
    none = {'maximumExecutionCount="1"': 'maximumExecutionCount="0"'}
    result = runner.run(write(tmp_path, none), KINEMATIC)
    (remark,) = result.remarks
    assert (
        result.verdict.passed
        and "ManeuverGroup 'group': maximumExecutionCount=0 is no number of executions" in remark
    )


def test_a_branch_that_a_stop_trigger_of_the_scene_leaves_out_is_a_remark(tmp_path: Path) -> None:
    late = story("Lead", [(0.2, speed_action(5)), (0.6, speed_action(9))])
    far = WAITS.format('<TraveledDistanceCondition value="5"/>')
    result = runner.run(
        write(tmp_path, {at_time(0.6): NEAR, at_time(1.0, "end"): far}, stories=late), KINEMATIC
    )
    assert result.verdict.passed
    (remark,) = result.remarks
    assert (
        "not all events have started: the run ended at 0.5" in remark
        and "event 'event1' waited for near" in remark
    )


def test_an_event_that_only_switches_controllers_is_no_event_of_the_scene(tmp_path: Path) -> None:
    switch = (
        "<PrivateAction><ControllerAction><ActivateControllerAction "
        'longitudinal="true"/></ControllerAction></PrivateAction>'
    )
    activates = story("Ego", [(0.2, switch)])
    assert causes(write(tmp_path / "alone", stories=activates)) == []
    path = write(
        tmp_path,
        {at_time(0.5): NEAR},
        stories=BRAKES + activates.replace("event0", "switch").replace("Ego::", "Other::"),
    )
    assert causes(path) == ["no-event"]


def test_a_scenario_of_initial_actions_alone_is_tested(tmp_path: Path) -> None:
    assert causes(write(tmp_path, stories="")) == []


def test_an_action_that_is_begun_and_empty_is_not_tested(tmp_path: Path) -> None:
    path = write(tmp_path, {speed_action(5): "<PrivateAction/>"})
    verdict = runner.run(path, KINEMATIC).verdict
    assert [cause.name for cause in verdict.causes] == [
        "empty"
    ] and verdict.outcome == "inconclusive"
    line = line_of(path, "<PrivateAction/>")
    assert verdict.reasons[0].startswith(
        f"{path}:{line}: PrivateAction: an action is expected inside"
    )
    assert causes(write(tmp_path, {speed_action(5): ""})) == ["empty"]


def test_stories_that_end_the_run_without_an_action_are_not_tested(tmp_path: Path) -> None:
    carla = {'description="test"': 'description="CARLA:test"'}
    end = re.compile(r"<StopTrigger>.*</StopTrigger>\s*</Storyboard>", re.DOTALL)
    path = write(tmp_path, carla, stories=story("Lead", [(0.5, "")]))
    path.write_text(
        end.sub("<StopTrigger/></Storyboard>", path.read_text(encoding="utf-8")), encoding="utf-8"
    )
    verdict = runner.run(path, KINEMATIC).verdict
    assert [cause.name for cause in verdict.causes] == ["empty", "stopped-at-once"]
    assert (
        "the run ended at 0.5" in verdict.reasons[1] and "no action started" in verdict.reasons[1]
    )


def test_a_stop_trigger_that_is_true_at_once(tmp_path: Path) -> None:
    assert causes(write(tmp_path, stop=0.0)) == ["stopped-at-once", "no-event"]
    assert causes(write(tmp_path, stories="", stop=0.0)) == ["stopped-at-once"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"<Act ": "<Actt ", "</Act>": "</Actt>"},
            "the element Actt is in no version of the standard here",
        ),
        (
            {'<Event name="event0"': '<Event prioritaet="skip" name="event0"'},
            "the attribute 'prioritaet' is in no version",
        ),
    ],
    ids=["element", "attribute"],
)
def test_what_no_version_of_the_standard_has_is_not_executed(
    tmp_path: Path, changes: dict[str, str], said: str
) -> None:
    path = write(tmp_path, changes)
    verdict = runner.run(path, KINEMATIC).verdict
    reason = next(cause.text for cause in verdict.causes if cause.name == "ignored")
    line = line_of(path, next(iter(changes.values())))
    assert verdict.outcome == "inconclusive" and reason.startswith(f"{path}:{line}: {said}")
    assert "NOT executed" in reason and (
        "did you mean Act?" in reason or "did you mean priority?" in reason
    )


def test_unknown_elements_that_nothing_executes_are_remarks(tmp_path: Path) -> None:
    path = write(
        tmp_path, {'description="test"/>': 'description="test"><Licence name="x"/></FileHeader>'}
    )
    result = runner.run(path, KINEMATIC)
    assert result.verdict.passed and any("Licence" in remark for remark in result.remarks)


def test_a_reference_into_a_misspelt_element_names_that_element(
    tmp_path: Path, command: Command
) -> None:
    waits = at_time(0.5).replace(
        "</ConditionGroup>",
        """<Condition name="after" delay="0" conditionEdge="none">
        <ByValueCondition><StoryboardElementStateCondition storyboardElementType="action" storyboardElementRef="action0"
        state="completeState"/></ByValueCondition></Condition></ConditionGroup>""",
    )
    stories = BRAKES + story("Ego", [(0.5, speed_action(5))]).replace("event0", "late").replace(
        "action0", "later"
    )
    path = write(tmp_path, stories=stories)
    text = path.read_text(encoding="utf-8")
    second = text.rindex(at_time(0.5))
    text = text[:second] + waits + text[second + len(at_time(0.5)) :]
    path.write_text(text, encoding="utf-8")
    assert command("xosc-run", "--dry-run", path).code == 0
    path.write_text(
        text.replace("<Act ", "<Actt ", 1).replace("</Act>", "</Actt>", 1), encoding="utf-8"
    )
    answer = command("xosc-run", "--dry-run", path)
    assert (
        answer.code == 3
        and "storyboardElementRef='action0' is no action of this storyboard" in answer.err
    )
    place_of = (
        f"line {line_of(path, '<Actt ')}: the element Actt is in no version of the standard here"
    )
    assert f"{place_of}; it is NOT executed; did you mean Act?" in answer.err


def test_a_misspelt_parameter_section_is_named_where_a_parameter_is_missing(
    tmp_path: Path, command: Command
) -> None:
    path = write(
        tmp_path,
        {
            "<ParameterDeclarations>": "<Parameters>",
            "</ParameterDeclarations>": "</Parameters>",
            's="150"': 's="$Gap"',
        },
    )
    answer = command("xosc-run", "--dry-run", path)
    assert (
        answer.code == 3
        and "there is no parameter 'Gap'" in answer.err
        and "the element Parameters is in no version" in answer.err
    )


@pytest.mark.parametrize(
    ("misspelt", "expected"),
    [("Used", ["ignored"]), ("Other", []), ("First", []), ("Other Used", ["ignored"])],
)
def test_only_catalogue_entries_in_use_make_a_run_inconclusive(
    tmp_path: Path, misspelt: str, expected: list[str]
) -> None:
    vehicle = re.search(r"<Vehicle.*</Vehicle>", car("Any"), re.DOTALL)
    assert vehicle is not None
    named = {
        name: vehicle[0].replace('name="car"', f'name="{name}"')
        for name in ("First", "Other", "Used")
    }
    entries = "\n".join(
        text.replace("</Axles>", "</Axles><Axle/>" if name in misspelt else "</Axles>")
        for name, text in named.items()
    )
    path = write(tmp_path)
    body = re.search(
        r'<ScenarioObject name="Lead">(.*?)</ScenarioObject>',
        path.read_text(encoding="utf-8"),
        re.DOTALL,
    )
    assert body is not None
    reference = '<CatalogReference catalogName="cars" entryName="Used"/>'
    locations = (
        "<CatalogLocations><VehicleCatalog><Directory "
        'path="catalogs"/></VehicleCatalog></CatalogLocations>'
    )
    text = (
        path.read_text(encoding="utf-8")
        .replace(body[1], reference)
        .replace("<CatalogLocations/>", locations)
    )
    path.write_text(text, encoding="utf-8")
    (tmp_path / "catalogs").mkdir()
    catalog = f'<OpenSCENARIO>{HEADER}<Catalog name="cars">\n{entries}\n</Catalog></OpenSCENARIO>'
    (tmp_path / "catalogs" / "cars.xosc").write_text(catalog, encoding="utf-8")
    result = runner.run(path, KINEMATIC)
    assert [cause.name for cause in result.verdict.causes] == expected
    told = " ".join((*result.remarks, *result.verdict.reasons))
    assert "the element Axle is in no version of the standard" in told


def test_private_actions_without_actors(tmp_path: Path) -> None:
    path = write(tmp_path, {'<EntityRef entityRef="Lead"/>': ""})
    assert causes(path) == ["no-actor"]


def test_an_ego_that_is_off_the_road_before_the_first_event(tmp_path: Path) -> None:
    aside = {'laneId="-1" s="100"': 'laneId="-1" offset="-30" s="100"'}
    assert set(causes(write(tmp_path, aside))) == {"off-road"}


def test_an_ego_far_beyond_the_end_of_its_road(tmp_path: Path) -> None:
    path = write(tmp_path, {'s="100"': 's="9000"'})
    verdict = runner.run(path, KINEMATIC).verdict
    assert verdict.causes[0].name == "misplaced" and f"{path}:" in verdict.causes[0].text
    assert "off-road" in [cause.name for cause in verdict.causes]


def test_a_participant_that_the_stories_refer_to_and_nothing_places(tmp_path: Path) -> None:
    path = write(tmp_path, stories=story("Absent", [(0.5, speed_action(5))]))
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("</Entities>", car("Absent") + "</Entities>"), encoding="utf-8")
    (cause,) = runner.run(path, KINEMATIC).verdict.causes
    line = line_of(path, 'name="Absent"')
    assert cause.name == "absent" and cause.text.startswith(
        f"{path}:{line}: 'Absent' never appears"
    )


def test_a_speed_beyond_the_performance(tmp_path: Path) -> None:
    path = write(tmp_path, speed=71)
    (cause,) = runner.run(path, KINEMATIC).verdict.causes
    assert (
        cause.name == "performance"
        and "Ego drives at 71.00 m/s at 0.00 s; its Performance allows 70 m/s" in cause.text
    )
    assert cause.text.startswith(f"{path}:")


def test_an_acceleration_of_the_ego_beyond_the_performance(tmp_path: Path) -> None:
    hard = 'dynamicsShape="linear" dynamicsDimension="rate" value="{}"'
    for rate, found in ((9, []), (12, ["performance"])):
        events = story("Ego", [(0.2, speed_action(40, hard.format(rate)))])
        assert causes(write(tmp_path, stories=events, stop=2.0)) == found, rate
    assert (
        causes(write(tmp_path, stories=story("Ego", [(0.2, speed_action(40))]), stop=2.0)) == []
    )  # a step has no acceleration


def test_a_failure_is_graver_than_a_cause(tmp_path: Path) -> None:
    path = write(
        tmp_path, {'s="150"': 's="101"', at_time(0.5): NEAR.replace('value="1"', 'value="-1"')}
    )
    verdict = runner.run(path, KINEMATIC).verdict
    assert (
        verdict.outcome == "failed"
        and verdict.causes
        and all(each.startswith("collision") for each in verdict.reasons)
    )


def test_a_limit_fails_an_inconclusive_run(tmp_path: Path) -> None:
    path = write(tmp_path, {at_time(0.5): NEAR})
    assert runner.run(path, KINEMATIC, fail_if=("end_time>0.5",)).verdict.outcome == "failed"


# the command ---------------------------------------------------------------------------------

OPTIONS = ("--world", "kinematic", "--sut", "none")


@pytest.fixture
def untested(tmp_path: Path) -> Path:
    return write(tmp_path, {at_time(0.5): NEAR})


def test_the_command_never_keeps_silent(untested: Path, command: Command) -> None:
    for options in ((), ("-q",)):
        answer = command("xosc-run", untested, *OPTIONS, *options)
        assert (
            answer.code == 6
            and "INCONCLUSIVE" in answer.out
            and "no event has started" in answer.out
        )
    allowed = command("xosc-run", untested, *OPTIONS, "-q", "--allow-inconclusive")
    assert allowed.code == 0 and "INCONCLUSIVE" in allowed.out


def test_a_failure_among_inconclusive_runs_decides(untested: Path, command: Command) -> None:
    assert (
        command(
            "xosc-run", untested, *OPTIONS, "--fail-if", "end_time>0.5", "--allow-inconclusive"
        ).code
        == 1
    )


@pytest.mark.parametrize(
    ("options", "tag"), [((), "skipped"), (("--junit-inconclusive", "error"), "error")]
)
def test_junit_has_it_skipped_or_as_an_error(
    untested: Path, command: Command, tmp_path: Path, options: tuple[str, ...], tag: str
) -> None:
    assert (
        command("xosc-run", untested, *OPTIONS, "--junit", tmp_path / "j.xml", *options).code == 6
    )
    (suite,) = etree.parse(tmp_path / "j.xml").getroot()
    (detail,) = suite.xpath("testcase/*[@message]")
    assert detail.tag == tag and "no event has started" in detail.get("message")
    assert (suite.get("skipped"), suite.get("errors")) == (
        ("1", "0") if tag == "skipped" else ("0", "1")
    )


def test_results_and_table_tell_the_causes(
    untested: Path, command: Command, tmp_path: Path
) -> None:
    command("xosc-run", untested, *OPTIONS, "--out", tmp_path / "out", "--replay")
    values = json.loads((tmp_path / "out" / "scenario" / "result.json").read_text())
    assert values["verdict"] == "inconclusive" and [each["name"] for each in values["causes"]] == [
        "no-event"
    ]
    stored = load_run(tmp_path / "out" / "scenario")
    assert stored.verdict.outcome == "inconclusive" and "inconclusive" in repr(stored)
    (row,) = pq.read_table(tmp_path / "out" / "runs.parquet").to_pylist()
    assert (row["state"], row["verdict"], row["exit_code"], row["causes"]) == (
        "inconclusive",
        "inconclusive",
        6,
        ["no-event"],
    )
    assert '"state": "inconclusive"' in (tmp_path / "out" / "report.html").read_text().replace(
        '"state":"', '"state": "'
    )
    again = command("xosc-run", untested, *OPTIONS, "--out", tmp_path / "out", "--resume")
    assert again.code == 6


def test_a_dry_run_tells_what_can_be_known(tmp_path: Path, command: Command) -> None:
    dry = ("--dry-run", "--sut", "none", "-q")
    fast = command("xosc-run", write(tmp_path, speed=400), *dry)
    assert fast.code == 6 and "its Performance allows 70 m/s" in fast.out
    assert command("xosc-run", write(tmp_path, stop=0.0), *dry).code == 6
    path = write(tmp_path, {"<Act ": "<Actt ", "</Act>": "</Actt>"})
    unknown = command("xosc-run", path, *dry)
    assert unknown.code == 6 and "did you mean Act?" in unknown.out
    assert command("xosc-run", write(tmp_path), *dry).code == 0


def test_a_dry_run_of_a_variation_counts_the_sets(tmp_path: Path, command: Command) -> None:
    path = scenario(tmp_path, "gaps", stories=story("Lead", [(0.1, speed_action(5))]))
    assert path.is_file()
    variation = distribution(tmp_path, "variation", {"Ego_Speed": (50, 90, 20)}, of="gaps")
    answer = command("xosc-run", variation, "--dry-run", "--sut", "none")
    assert (
        answer.code == 6 and "1 of 3 parameter sets: " in answer.out and "Performance" in answer.out
    )
