"""Every rule passes the sound project and catches one fault, at its line."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from schemas.checks.registry import all_rules
from tests.schemas import test_road_rules

ASAM, OWN = "asam.net:xosc:", "xosc.toolchain:xosc:"
ASAM_ROAD, OWN_ROAD = "asam.net:xodr:", "xosc.toolchain:xodr:"


class Fault(NamedTuple):
    """A replacement in a file that breaks a rule, and a text on the line that
    the problem must name.
    """

    rule: str
    file: str
    old: str
    new: str
    at: str


FAULTS = [
    Fault(ASAM + "1.0.0:xml.valid_xml_document", "scenario", "</Init>", "", "</Storyboard>"),
    Fault(ASAM + "1.0.0:xml.root_tag_is_openscenario", "scenario", "", "", ""),
    Fault(
        ASAM + "1.0.0:xml.fileheader_is_present",
        "scenario",
        "FileHeader",
        "FileHead",
        "<OpenSCENARIO>",
    ),
    Fault(
        ASAM + "1.0.0:xml.version_is_defined",
        "scenario",
        'revMinor="3"',
        'revMinor="x"',
        "FileHeader",
    ),
    Fault(ASAM + "1.0.0:xml.valid_schema", "scenario", "<Init>", '<Init colour="red">', "<Init"),
    Fault(ASAM + "1.0.0:general.file_ending", "scenario", "", "", ""),
    Fault(
        ASAM + "1.2.0:reference_control.unique_element_names_on_same_level",
        "scenario",
        '<Condition name="standing"',
        '<Condition name="done" ',
        '<Condition name="done"  ',
    ),
    Fault(
        ASAM + "1.2.0:reference_control.uniquely_resolvable_entity_references",
        "catalog",
        '<Vehicle name="van"',
        '<Vehicle  name="car"',
        "<Vehicle  ",
    ),
    Fault(
        ASAM + "1.2.0:reference_control.resolvable_entity_references",
        "scenario",
        '<Private entityRef="Target">',
        '<Private entityRef="Targt">',
        "Targt",
    ),
    Fault(
        ASAM + "1.2.0:reference_control.resolvable_variable_reference",
        "scenario",
        'variableRef="count"',
        'variableRef="counter"',
        "counter",
    ),
    Fault(
        OWN + "1.3.0:reference_control.resolvable_monitor_reference",
        "scenario",
        'monitorRef="seen"',
        'monitorRef="unseen"',
        "unseen",
    ),
    Fault(
        OWN + "1.0.0:reference_control.resolvable_controller_reference",
        "scenario",
        'objectControllerRef="driver"',
        'objectControllerRef="pilot"',
        "pilot",
    ),
    Fault(
        OWN + "1.0.0:reference_control.resolvable_parameter_reference",
        "scenario",
        'parameterRef="wet"',
        'parameterRef="dry"',
        '"dry"',
    ),
    Fault(
        ASAM + "1.1.0:parameters.parameter_declaration_parameter_scope",
        "scenario",
        'laneId="$lane"',
        'laneId="$line"',
        "$line",
    ),
    Fault(
        ASAM + "1.2.0:parameters.valid_parameter_declaration_in_catalogs",
        "catalog",
        'maxSpeed="40"',
        'maxSpeed="$topSpeed" ',
        'maxSpeed="$topSpeed"  ',
    ),
    Fault(
        OWN + "1.0.0:storyboard.elements_are_not_empty",
        "scenario",
        "<Init>",
        '<Story name="none"/><Init>',
        '"none"',
    ),
    Fault(
        OWN + "1.0.0:storyboard.entities_get_a_position",
        "scenario",
        "<Entities>",
        '<Entities><ScenarioObject name="absent"/>',
        '"absent"',
    ),
    Fault(
        OWN + "1.1.0:positioning.relative_lane_position_has_one_distance",
        "scenario",
        "<Init>",
        '<Position><RelativeLanePosition entityRef="Target" dLane="1"/></Position><Init>',
        "dLane",
    ),
    Fault(
        OWN + "1.0.0:actions.kept_lane_offset_is_from_another_entity",
        "scenario",
        """<LongitudinalAction>
                    <LongitudinalDistanceAction entityRef="Target" continuous="false" freespace="true" distance="20"/>
                  </LongitudinalAction>""",
        """<LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics dynamicsShape="linear"/><LaneOffsetTarget>
                    <RelativeTargetLaneOffset entityRef="Ego" value="1"/>
                  </LaneOffsetTarget></LaneOffsetAction></LateralAction>""",
        "RelativeTargetLaneOffset",
    ),
    Fault(
        OWN + "1.0.0:reference_control.relation_is_to_another_entity",
        "scenario",
        "<Init>",
        """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>
          <EntityCondition><RelativeSpeedCondition entityRef="Ego" rule="lessThan" value="1"/></EntityCondition>
          </ByEntityCondition><Init>""",
        "RelativeSpeedCondition",
    ),
    Fault(
        ASAM + "1.2.0:data_type.allowed_operators",
        "scenario",
        "${$twice / 2}",
        "${$twice ** 2}",
        "**",
    ),
    Fault(
        OWN + "1.0.0:parameters.value_is_of_the_declared_type",
        "scenario",
        '<SetAction value="1"/>',
        '<SetAction value="none"/>',
        '"none"',
    ),
    Fault(
        OWN + "1.0.0:parameters.declared_name_is_a_name",
        "scenario",
        "<MonitorDeclarations>",
        '<MonitorDeclarations><MonitorDeclaration name="$m" value="true"/>',
        '"$m"',
    ),
    Fault(
        OWN + "1.0.0:parameters.declarations_are_unique",
        "catalog",
        "</ParameterDeclarations>",
        '<ParameterDeclaration name="topSpeed" parameterType="double" '
        'value="60"/></ParameterDeclarations>',
        '"60"',
    ),
    Fault(
        OWN + "1.1.0:expressions.expression_has_a_value",
        "scenario",
        "${$twice / 2}",
        "${1 / ($twice - 40)}",
        "- 40",
    ),
    Fault(
        ASAM + "1.0.0:parameters.parameter_declaration_parameter_type_inference",
        "scenario",
        'variableType="int" value="0"',
        'variableType="int" value="none"',
        '"none"',
    ),
    Fault(
        OWN + "1.1.0:parameters.default_value_obeys_constraints",
        "scenario",
        'value="20"',
        'value="31"',
        '"31"',
    ),
    Fault(
        OWN + "1.0.0:parameters.no_cyclic_definitions",
        "scenario",
        "${2 * $speed}",
        "${2 * $twice}",
        "* $twice",
    ),
    Fault(
        OWN + "1.0.0:reference_control.no_cyclic_entity_selections",
        "scenario",
        '<EntityRef entityRef="Target"/>',
        '<EntityRef entityRef="all"/>',
        "<EntitySelection",
    ),
    Fault(
        ASAM + "1.2.0:reference_control.resolvable_storyboard_element_reference",
        "scenario",
        "maneuver::follow",
        "maneuver::fellow",
        "fellow",
    ),
    Fault(
        ASAM + "1.2.0:reference_control.valid_actor_reference_in_private_actions",
        "scenario",
        '<Actors selectTriggeringEntities="false">\n            <EntityRef entityRef="Ego"/>',
        '<Actors selectTriggeringEntities="false">',
        "<Actors",
    ),
    Fault(
        OWN + "1.2.0:reference_control.variable_is_no_parameter",
        "scenario",
        'variableRef="count"',
        'variableRef="twice"',
        'variableRef="twice"',
    ),
    Fault(
        OWN + "1.0.0:reference_control.entities_have_names_of_their_own",
        "scenario",
        'ScenarioObject name="Target"',
        'ScenarioObject  name="Ego"',
        "ScenarioObject  ",
    ),
    Fault(
        ASAM + "1.2.0:data_type.non_negative_transition_time_in_light_state_action",
        "scenario",
        'transitionTime="0.5"',
        'transitionTime="-0.5"',
        "-0.5",
    ),
    Fault(
        ASAM + "1.2.0:data_type.positive_duration_in_phase",
        "scenario",
        'duration="10"',
        'duration="-10"',
        "-10",
    ),
    Fault(
        ASAM + "1.0.0:data_type.condition_delay_not_negative",
        "scenario",
        'delay="0"',
        'delay="-1"',
        'delay="-1"',
    ),
    Fault(
        ASAM + "1.1.0:data_type.distances_are_not_negative",
        "scenario",
        'distance="20"',
        'distance="-20"',
        "-20",
    ),
    Fault(
        OWN + "1.0.0:data_type.durations_and_radii_are_not_negative",
        "scenario",
        'StandStillCondition duration="2"',
        'StandStillCondition duration="NaN"',
        "NaN",
    ),
    Fault(
        OWN + "1.0.0:data_type.transition_value_is_not_negative",
        "scenario",
        'dynamicsDimension="time" value="0"',
        'dynamicsDimension="rate" value="-4"',
        '"-4"',
    ),
    Fault(
        OWN + "1.0.0:reference_control.resolvable_file_reference",
        "scenario",
        "road.xodr",
        "rod.xodr",
        "rod.xodr",
    ),
    Fault(
        ASAM + "1.0.0:reference_control.catalogs_referenced_by_directory",
        "scenario",
        'path="catalogs"',
        'path="catalog"',
        "Directory",
    ),
    Fault(
        ASAM + "1.0.0:reference_control.catalog_reference_resolvability",
        "scenario",
        '"van"',
        '"vann"',
        '"vann"',
    ),
    Fault(
        OWN + "1.0.0:parameters.assigned_parameter_is_declared",
        "scenario",
        'parameterRef="topSpeed"',
        'parameterRef="topsped"',
        "topsped",
    ),
    Fault(
        ASAM + "1.0.0:scenario_logic.invalid_elements_if_no_road_network",
        "scenario",
        '<LogicFile filepath="road.xodr"/>',
        "",
        "<LanePosition",
    ),
    Fault(
        OWN + "1.0.0:reference_control.road_exists_in_road_network",
        "scenario",
        'RoadPosition roadId="2"',
        'RoadPosition roadId="3"',
        'roadId="3"',
    ),
    Fault(
        OWN + "1.0.0:reference_control.lane_exists_on_road",
        "scenario",
        'name="lane" parameterType="string" value="-1"',
        'name="lane" parameterType="string" value="1"',
        "<LanePosition",
    ),
    Fault(
        OWN + "1.0.0:positioning.position_is_on_the_road",
        "scenario",
        'RoadPosition roadId="2" s="10"',
        'RoadPosition roadId="2" s="50.5"',
        "50.5",
    ),
    Fault(ASAM + "1.1.0:positioning.geodetic_datum_defined", "scenario", "", "", "GeoPosition"),
    Fault(
        ASAM + "1.2.0:reference_control.resolvable_signal_id_in_traffic_signal_state_action",
        "scenario",
        'TrafficSignalStateAction name="12"',
        'TrafficSignalStateAction name="13"',
        '"13"',
    ),
    Fault(
        ASAM + "1.0.0:reference_control.traffic_signal_state_references",
        "scenario",
        'trafficSignalId="11"',
        'trafficSignalId="14"',
        '"14"',
    ),
    Fault(
        ASAM
        + "1.2.0:reference_control.resolvable_traffic_signal_controller_by_traffic_signal_controller_ref",
        "scenario",
        'trafficSignalControllerRef="north"',
        'trafficSignalControllerRef="nord"',
        "nord",
    ),
    Fault(
        ASAM + "1.0.0:reference_control.traffic_signal_controller_references",
        "scenario",
        'reference="north"',
        'reference="south"',
        'reference="south"',
    ),
    Fault(
        OWN + "1.0.0:reference_control.resolvable_phase_reference",
        "scenario",
        'phase="go"',
        'phase="gone"',
        "gone",
    ),
    Fault(
        ASAM + "1.0.0:routing.trajectory_timing_exists_if_requested",
        "scenario",
        '<ControlPoint time="1">',
        "<ControlPoint >",
        "<ControlPoint >",
    ),
    Fault(
        OWN + "1.4.0:routing.motion_is_not_empty", "scenario", "<Init>", "<Init><Motion/>", "<Init>"
    ),
    Fault(
        OWN + "1.0.0:routing.nurbs_knots_fit_order", "scenario", '<Knot value="1"/>', "", "<Nurbs"
    ),
    Fault(
        ASAM + "1.0.0:naming.no_double_colon_prefix_in_names",
        "scenario",
        'Story name="story"',
        'Story name="a::b"',
        "a::b",
    ),
    Fault(
        OWN + "1.1.0:reference_control.distributed_parameter_is_declared",
        "distribution",
        'parameterName="speed"',
        'parameterName="sped"',
        "sped",
    ),
    Fault(
        OWN + "1.1.0:data_type.distributions_are_well_formed",
        "distribution",
        'lowerLimit="10"',
        'lowerLimit="40"',
        "<Range",
    ),
    Fault(
        OWN + "1.0.0:scenario_logic.condition_is_not_constant",
        "scenario",
        'SimulationTimeCondition value="3" rule="greaterThan"',
        'SimulationTimeCondition value="-3" rule="greaterThan"',
        '"-3"',
    ),
    Fault(
        OWN + "1.0.0:scenario_logic.start_trigger_is_not_empty",
        "scenario",
        "</ManeuverGroup>\n        <StartTrigger>",
        "</ManeuverGroup>\n        <StartTrigger />\n        <StartTrigger>",
        "<StartTrigger />",
    ),
    Fault(
        ASAM_ROAD + "1.0.0:xml.valid_xml_document",
        "road",
        "</OpenDRIVE>",
        "</OpenDRIV>",
        "</OpenDRIV>",
    ),
    Fault(ASAM_ROAD + "1.0.0:xml.root_tag_is_opendrive", "road", "", "", ""),
    Fault(ASAM_ROAD + "1.0.0:xml.fileheader_is_present", "road", "", "", ""),
    Fault(ASAM_ROAD + "1.0.0:xml.version_is_defined", "road", 'revMajor="1"', "", "<header"),
    Fault(
        ASAM_ROAD + "1.0.0:xml.valid_schema", "road", 'type="driving"', 'type="flying"', "flying"
    ),
    Fault(ASAM_ROAD + "1.4.0:ids.id_unique_in_class", "road", 'id="12"', "id='11'", "id='11'"),
    Fault(
        OWN_ROAD + "1.4.0:road.linkage.linked_elements_exist",
        "road",
        'elementId="2"',
        'elementId="22"',
        '"22"',
    ),
    Fault(
        OWN_ROAD + "1.4.0:road.geometry.reference_line_is_complete",
        "road",
        'hdg="0" length="60"',
        'hdg="0" length="-60"',
        '"-60"',
    ),
    Fault(
        OWN_ROAD + "1.4.0:road.lane.lane_sections_are_whole",
        "road",
        'id="-2"',
        'id="-3"',
        '<laneSection s="0"',
    ),
    Fault(
        OWN_ROAD + "1.4.0:road.lane.link.linked_lanes_exist",
        "road",
        '<successor id="-1"',
        '<successor id="-2"',
        'id="-2"/>',
    ),
    Fault(
        OWN_ROAD + "1.4.0:road.records_ascend",
        "road",
        'a="3.5" b="0" c="0" d="0"/>\n          </lane>',
        'a="3.5" b="0" c="0" d="0"/>\n<width sOffset="-1" a="3" b="0" c="0" d="0"/></lane>',
        'sOffset="-1"',
    ),
    Fault(
        OWN_ROAD + "1.4.0:numbers_are_plausible",
        "road",
        'a="3.5" b="0"',
        'a="3.5" b="1e13"',
        "1e13",
    ),
]
WHOLE_FILE = {
    ASAM + "1.0.0:xml.root_tag_is_openscenario": (
        "scenario",
        [("<OpenSCENARIO>", "<Scenario>"), ("</OpenSCENARIO>", "</Scenario>")],
        2,
    ),
    ASAM_ROAD + "1.0.0:xml.root_tag_is_opendrive": (
        "road",
        [("<OpenDRIVE>", "<Roads>"), ("</OpenDRIVE>", "</Roads>")],
        2,
    ),
    ASAM_ROAD + "1.0.0:xml.fileheader_is_present": (
        "road",
        [("<header", "<head"), ("</header>", "</head>")],
        2,
    ),
}
"""Faults that take more than one replacement, with the line of the problem."""


def test_the_sound_project_has_no_problem(project):
    for name in project.files:
        assert project.check(name) == []


def test_every_rule_has_a_fault_here_or_among_those_of_roads():
    others = {
        rule.uid
        for rule in all_rules()
        if any(rule.uid.endswith(fault.rule) for fault in test_road_rules.FAULTS)
    }
    assert {fault.rule for fault in FAULTS} == {rule.uid for rule in all_rules()} - others


@pytest.mark.parametrize(
    "fault",
    [fault for fault in FAULTS if fault.old],
    ids=lambda fault: fault.rule.rpartition(":")[2],
)
def test_rule_catches_its_fault_at_its_line(project, fault):
    project.edit(fault.file, (fault.old, fault.new))
    lines = [problem.line for problem in project.check(fault.file) if problem.rule == fault.rule]
    assert lines[:1] == [project.line(fault.file, fault.at)]


@pytest.mark.parametrize("uid", WHOLE_FILE, ids=lambda uid: uid.rpartition(":")[2])
def test_precondition_is_the_only_problem_where_it_is_broken(project, uid):
    name, replacements, line = WHOLE_FILE[uid]
    project.edit(name, *replacements)
    assert [(problem.rule, problem.line) for problem in project.check(name)] == [(uid, line)]


def test_scenario_with_another_file_ending_is_a_warning(project):
    project.files["scenario"] = project.files["scenario"].rename(project.folder / "scenario.xml")
    assert [(problem.rule, problem.level) for problem in project.check("scenario")] == [
        ("asam.net:xosc:1.0.0:general.file_ending", "warning")
    ]


def test_geo_position_without_geo_reference_is_found(project):
    project.edit(
        "road", ("<geoReference>+proj=utm +zone=32 +ellps=WGS84 +units=m</geoReference>", "")
    )
    (problem,) = project.check("scenario")
    assert problem.rule.endswith("geodetic_datum_defined")
    assert problem.line == project.line("scenario", "GeoPosition")


def test_message_suggests_the_nearest_name(project):
    project.edit("scenario", ('<Private entityRef="Target">', '<Private entityRef="Targt">'))
    (problem,) = project.check("scenario")
    assert "did you mean 'Target'?" in problem.message
    assert problem.element == "/OpenSCENARIO/Storyboard/Init/Actions/Private[2]"


def test_ambiguous_storyboard_reference_is_a_warning(project):
    project.edit("scenario", ('storyboardElementType="event"', 'storyboardElementType="action"'))
    project.edit("scenario", ("act::group::maneuver::follow", "twin"))
    project.edit(
        "scenario",
        ('<Action name="path">', '<Action name="twin">'),
        ('<Action name="blink">', '<Action name="twin">'),
    )
    found = {
        (problem.rule.rpartition(".")[2], problem.level) for problem in project.check("scenario")
    }
    assert ("resolvable_storyboard_element_reference", "warning") in found


def test_a_vehicle_from_a_catalogue_is_no_storyboard_element(project):
    vehicle = '<CatalogReference catalogName="Vehicles" entryName="van"/>'
    project.edit("scenario", ("</ManeuverGroup>", f"{vehicle}</ManeuverGroup>"))
    rules = {problem.rule.rpartition(".")[2] for problem in project.check("scenario")}
    assert "resolvable_storyboard_element_reference" not in rules


def test_parameter_is_resolved_before_a_reference_is_judged(project):
    project.edit("scenario", ('value="-1"', 'value="-2"'))
    assert project.check("scenario") == []  # lane -2 exists at s=10
    project.edit("scenario", ('laneId="$lane" s="10"', 'laneId="$lane" s="60"'))
    assert [problem.rule.rpartition(".")[2] for problem in project.check("scenario")] == [
        "lane_exists_on_road"
    ]


def test_reference_through_an_undeclared_parameter_is_reported_once(project):
    project.edit("scenario", ('<Private entityRef="Target">', '<Private entityRef="$who">'))
    assert [problem.rule.rpartition(".")[2] for problem in project.check("scenario")] == [
        "parameter_declaration_parameter_scope"
    ]


def test_parameters_that_double_each_other_cost_nothing(project):
    declared = "".join(
        f'<ParameterDeclaration name="p{n}" parameterType="double" value="${{$p{n - 1} + '
        f'$p{n - 1}}}"/>'
        for n in range(1, 200)
    )
    first = '<ParameterDeclaration name="p0" parameterType="double" value="1"/>'
    project.edit(
        "scenario", ("<ParameterDeclarations>", f"<ParameterDeclarations>{first}{declared}")
    )
    assert project.check("scenario") == []


def test_catalogue_entry_that_contains_itself_ends(project):
    itself = '<CatalogReference catalogName="Vehicles" entryName="m"/>'
    entry = f'<Maneuver name="m"><ManeuverGroup>{itself}</ManeuverGroup></Maneuver>'
    project.edit("catalog", ('<Vehicle name="van"', entry + '<Vehicle name="van"'))
    project.edit("scenario", ('<Maneuver name="maneuver">', itself + '<Maneuver name="maneuver">'))
    location = '<ManeuverCatalog><Directory path="catalogs"/></ManeuverCatalog>'
    project.edit("scenario", ("</CatalogLocations>", f"{location}</CatalogLocations>"))
    assert project.check("scenario") == []


def test_names_are_text_and_not_expressions(project):
    project.edit(
        "scenario", ('<Condition name="later"', '<Condition name="${not + an expression}"')
    )
    assert project.check("scenario") == []


def test_functions_newer_than_the_file_are_warnings(project):
    project.edit(
        "catalog", ('revMinor="3"', 'revMinor="2"'), ('maxSpeed="40"', 'maxSpeed="${abs(-40)}"')
    )
    assert [
        (problem.rule.rpartition(".")[2], problem.level) for problem in project.check("catalog")
    ] == [("allowed_operators", "warning")]


def test_entry_of_a_catalogue_known_by_its_file_name_is_a_warning(project):
    project.edit("catalog", ('<Catalog name="Vehicles">', '<Catalog name="Others">'))
    project.files["catalog"].rename(project.folder / "catalogs" / "Vehicles.xosc")
    problems = project.check("scenario")
    assert {problem.level for problem in problems} == {"warning"}
    assert "'Others'" in problems[0].message


def test_missing_catalogue_folder_leaves_its_entries_undecided(project):
    project.edit("scenario", ('path="catalogs"', 'path="elsewhere"'))
    problems = project.check("scenario")
    assert {problem.level for problem in problems} == {"warning"}


def test_absolute_path_that_is_not_here_is_a_warning(project):
    project.edit("scenario", ('filepath="road.xodr"', 'filepath="C:/maps/road.xodr"'))
    (problem,) = project.check("scenario")
    assert problem.level == "warning"


def test_parameter_false_by_default_is_for_the_record(project):
    project.edit(
        "scenario",
        (
            'name="wet" parameterType="boolean" value="true"',
            'name="wet" parameterType="boolean" value="false"',
        ),
    )
    (problem,) = project.check("scenario")
    assert (problem.level, problem.line) == ("info", project.line("scenario", "ParameterCondition"))


def test_malformed_catalogue_and_road_do_not_disturb_the_scenario(project):
    project.files["road"].write_text("<OpenDRIVE")
    project.files["catalog"].write_text("")
    assert [problem.rule.rpartition(".")[2] for problem in project.check("scenario")] == [
        "catalog_reference_resolvability"
    ] * 2


def test_rules_describe_themselves():
    for rule in all_rules():
        assert rule.description.endswith(".")
        assert rule.level in ("error", "warning", "info")


def test_roads_are_those_below_the_root(tmp_path):
    from schemas.checks.road_references import read
    from tests.runner.files import ROADS

    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    inside = text.replace("<center>", '<center><road id="1"/>')
    assert inside != text
    (tmp_path / "map.xodr").write_text(inside, encoding="utf-8")
    assert read(tmp_path / "map.xodr").roads["1"].length > 100.0
