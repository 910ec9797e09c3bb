"""Version conversion: what each rule changes, what is refused, and that nothing
is lost on the way up and back.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from lxml import etree

import xosc
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from schemas.validate import violations
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.writing.versions import RULES, convert

VERSIONS = [(1, 0), (1, 1), (1, 2), (1, 3), (1, 4)]
TRIGGER = (
    '<{}><ConditionGroup><Condition name="c" delay="0" '
    'conditionEdge="none">{}</Condition></ConditionGroup></{}>'
)
LATER = (
    '<ByValueCondition><SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition>'
)
AT_ONCE = (
    '<StartTrigger><ConditionGroup><Condition name="at once" delay="0" '
    'conditionEdge="none"><ByValueCondition>'
    '<SimulationTimeCondition value="-1" '
    'rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>'
)
SPEED = (
    "<PrivateAction><LongitudinalAction><SpeedAction>"
    '<SpeedActionDynamics {} dynamicsShape="step" value="0" dynamicsDimension="time"/>'
    "<SpeedActionTarget><AbsoluteTargetSpeed "
    'value="1"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>'
)
ASSIGN = (
    "<AssignControllerAction><Controller "
    'name="c"><Properties/></Controller></AssignControllerAction>'
)
OVERRIDE = "<OverrideControllerValueAction>{}</OverrideControllerValueAction>".format(
    "".join(
        f'<{name} active="false" value="0"/>'
        for name in ("Throttle", "Brake", "Clutch", "ParkingBrake", "SteeringWheel")
    )
    + '<Gear active="false" number="0"/>'
)
ACTIVATE = '<ActivateControllerAction lateral="true"/>'
DELETE = (
    '<GlobalAction><EntityAction entityRef="E"><DeleteEntityAction/></EntityAction></GlobalAction>'
)
BOX = (
    '<BoundingBox><Center x="0" y="0" z="0"/><Dimensions width="1" length="1" '
    'height="1"/></BoundingBox>'
)
MISC = '<MiscObject name="m" miscObjectCategory="none" mass="1">{}</MiscObject>'


def trigger(condition: str = LATER, tag: str = "StartTrigger") -> str:
    return TRIGGER.format(tag, condition, tag)


def entity_condition(condition: str) -> str:
    entities = (
        '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef '
        'entityRef="E"/></TriggeringEntities>'
    )
    return trigger(
        f"<ByEntityCondition>{entities}<EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def action(content: str, name: str = "a") -> str:
    return f'<Action name="{name}">{content}</Action>'


def event(actions: str = action(DELETE), start: str = trigger(), priority: str = "parallel") -> str:
    return f'<Event name="e" priority="{priority}">{actions}{start}</Event>'


def story(content: str, start: str = trigger()) -> str:
    group = f'<Actors selectTriggeringEntities="false"/><Maneuver name="m">{content}</Maneuver>'
    group = f'<ManeuverGroup name="g" maximumExecutionCount="1">{group}</ManeuverGroup>'
    return f'<Story name="s"><Act name="a">{group}{start}</Act></Story>'


def scenario(
    version: tuple[int, int],
    content: str = "",
    *,
    act: str = trigger(),
    init: str = "",
    parameters: str = "",
    entities: str = "",
    road: str = "",
    stop: str = "<StopTrigger/>",
    header: str = "",
) -> str:
    actions = f'<Private entityRef="E">{init}</Private>' if init else ""
    return (
        f'<OpenSCENARIO><FileHeader revMajor="1" revMinor="{version[1]}" '
        'date="2024-01-01T00:00:00" description="" author="">'
        f"{header}</FileHeader>\n<ParameterDeclarations>{parameters}</ParameterDeclarations><CatalogLocations/>"
        f"<RoadNetwork>{road}</RoadNetwork><Entities>{entities}</Entities>"
        f"<Storyboard><Init><Actions>{actions}</Actions></Init>{story(content or event(), act)}{stop}</Storyboard></OpenSCENARIO>"
    )


def document(text: str, folder: Path) -> xosc.Document:
    path = folder / f"{abs(hash(text))}.xosc"
    path.write_text(text)
    return xosc.load(path)


def content(element: etree._Element) -> tuple[object, ...]:
    """What a document says, without comments and the white space between elements."""
    children = [content(child) for child in element if isinstance(child.tag, str)]
    return (element.tag, sorted(element.items()), (element.text or "").strip(), children)


def is_valid(found: xosc.Document) -> bool:
    schema = schema_for(OPENSCENARIO, found.version)
    return schema is not None and not violations(found.root.getroottree(), schema)


def condition_of(tag: str, attributes: str) -> str:
    inner = (
        '<Position><WorldPosition x="0" y="0"/></Position>' if tag == "DistanceCondition" else ""
    )
    target = (
        "<TimeToCollisionConditionTarget><EntityRef "
        'entityRef="E"/></TimeToCollisionConditionTarget>'
    )
    inner = target if tag == "TimeToCollisionCondition" else inner
    entity = "" if inner else 'entityRef="E"'
    return event(
        start=entity_condition(
            f'<{tag} {entity} value="1" freespace="true" rule="lessThan" '
            f"{attributes}>{inner}</{tag}>"
        )
    )


def follow(reference: str, attributes: str = "") -> str:
    rest = (
        '<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
    )
    inside = f"<FollowTrajectoryAction {attributes}>{reference}{rest}</FollowTrajectoryAction>"
    return event(action(f"<PrivateAction><RoutingAction>{inside}</RoutingAction></PrivateAction>"))


def speed(attributes: str = "") -> dict[str, str]:
    return {"content": event(action(SPEED.format(attributes)))}


def acceleration(attributes: str = "") -> dict[str, str]:
    return {
        "content": event(
            start=entity_condition(
                f'<AccelerationCondition value="1" rule="lessThan" {attributes}/>'
            )
        )
    }


def lateral(attributes: str) -> str:
    inside = (
        '<LateralAction><LateralDistanceAction entityRef="E" freespace="true" continuous="false" '
        f"{attributes}/></LateralAction>"
    )
    return event(action(f"<PrivateAction>{inside}</PrivateAction>"))


CLOTHOID = (
    '<Trajectory name="t" closed="false"><Shape><Clothoid curvature="0" {}="0.1" length="1">'
    '<Position><WorldPosition x="0" y="0"/></Position></Clothoid></Shape></Trajectory>'
)
CATALOGUED = '<CatalogReference catalogName="c" entryName="e"/>'


def controller(*actions: str) -> str:
    return "".join(
        f"<PrivateAction><ControllerAction>{each}</ControllerAction></PrivateAction>"
        for each in actions
    )


def phase(tag: str) -> str:
    state = f'<{tag} state="go"/>'
    phases = f'<Phase name="p" duration="1">{state}</Phase>'
    return (
        "<TrafficSignals><TrafficSignalController "
        f'name="c">{phases}</TrafficSignalController></TrafficSignals>'
    )


def declared(kind: str) -> str:
    return f'<ParameterDeclaration name="p" parameterType="{kind}" value="1"/>'


def inside(entity: str) -> str:
    return f'<ScenarioObject name="E">{entity}</ScenarioObject>'


BOTH_WAYS = {
    "an enumeration's new word": (
        (1, 0),
        {
            "content": condition_of(
                "RelativeDistanceCondition", 'relativeDistanceType="cartesianDistance"'
            )
        },
        (1, 1),
        {
            "content": condition_of(
                "RelativeDistanceCondition", 'relativeDistanceType="euclidianDistance"'
            )
        },
    ),
    "override": (
        (1, 1),
        {"content": event(priority="overwrite")},
        (1, 2),
        {"content": event(priority="override")},
    ),
    "int": ((1, 0), {"parameters": declared("integer")}, (1, 3), {"parameters": declared("int")}),
    "a transition of a vehicle with limits": (
        (1, 1),
        speed(),
        (1, 2),
        speed('followingMode="follow"'),
    ),
    "an acceleration ahead": (
        (1, 0),
        acceleration(),
        (1, 3),
        acceleration('direction="longitudinal"'),
    ),
    "the signal group's misspelt name": (
        (1, 2),
        {"road": phase("TrafficeSignalGroupState")},
        (1, 3),
        {"road": phase("TrafficSignalGroupState")},
    ),
    "actions of a controller at the beginning": (
        (1, 0),
        {"init": controller(ASSIGN + OVERRIDE)},
        (1, 3),
        {"init": controller(ASSIGN, OVERRIDE)},
    ),
    "actions of a controller in an event": (
        (1, 0),
        {"content": event(action(controller(ASSIGN + OVERRIDE)))},
        (1, 3),
        {
            "content": event(
                action(controller(ASSIGN))
                + action(controller(OVERRIDE), "a OverrideControllerValueAction")
            )
        },
    ),
}


@pytest.mark.parametrize(("older", "old", "newer", "new"), BOTH_WAYS.values(), ids=BOTH_WAYS)
def test_what_has_another_form_is_rewritten_both_ways(
    tmp_path: Path, older, old, newer, new
) -> None:
    before, after = (
        document(scenario(version, **parts), tmp_path)
        for version, parts in ((older, old), (newer, new))
    )
    assert content(convert(before, newer).root) == content(after.root)
    assert content(convert(after, older).root) == content(before.root)


STRAIGHT = 'coordinateSystem="entity" relativeDistanceType="euclidianDistance"'
DOWN = {
    "an event without start trigger": (
        (1, 1),
        {"content": event(start="")},
        (1, 0),
        {"content": event(start=AT_ONCE)},
    ),
    "an act without start trigger": ((1, 3), {"act": ""}, (1, 0), {"act": AT_ONCE}),
    "a storyboard without stop trigger": ((1, 3), {"stop": ""}, (1, 2), {"stop": "<StopTrigger/>"}),
    "an object without properties": (
        (1, 3),
        {"entities": inside(MISC.format(BOX))},
        (1, 0),
        {"entities": inside(MISC.format(BOX + "<Properties/>"))},
    ),
    "a reference to a trajectory": (
        (1, 1),
        {
            "content": follow(
                f"<TrajectoryRef>{CATALOGUED}</TrajectoryRef>", 'initialDistanceOffset="0"'
            )
        },
        (1, 0),
        {"content": follow(CATALOGUED)},
    ),
    "a clothoid": (
        (1, 3),
        {"content": follow(f"<TrajectoryRef>{CLOTHOID.format('curvaturePrime')}</TrajectoryRef>")},
        (1, 0),
        {"content": follow(CLOTHOID.format("curvatureDot"))},
    ),
    "activation": (
        (1, 3),
        {"init": controller(ACTIVATE)},
        (1, 0),
        {"init": f"<PrivateAction>{ACTIVATE}</PrivateAction>"},
    ),
    **{
        f"{tag} in a straight line": (
            (1, 3),
            {"content": condition_of(tag, attributes)},
            (1, 0),
            {"content": condition_of(tag, 'alongRoute="false"')},
        )
        for tag in ("DistanceCondition", "TimeHeadwayCondition", "TimeToCollisionCondition")
        for attributes in ("", STRAIGHT, f'{STRAIGHT} routingAlgorithm="undefined"')
    },
    "what is meant anyway": (
        (1, 3),
        {"content": lateral('distance="1" coordinateSystem="entity" displacement="any"')},
        (1, 0),
        {"content": lateral('distance="1"')},
    ),
    "the following mode that is meant anyway": (
        (1, 3),
        speed('followingMode="position"'),
        (1, 0),
        speed(),
    ),
}


@pytest.mark.parametrize(("newer", "new", "older", "old"), DOWN.values(), ids=DOWN)
def test_what_an_older_version_must_say_is_written_out(
    tmp_path: Path, newer, new, older, old
) -> None:
    found = convert(document(scenario(newer, **new), tmp_path), older)
    assert content(found.root) == content(document(scenario(older, **old), tmp_path).root)
    assert found.version == older and is_valid(found)


REFUSED = {
    "acceleration": ((1, 1), acceleration(), "AccelerationCondition: .*total acceleration"),
    "direction": (
        (1, 1),
        acceleration('direction="lateral"'),
        "AccelerationCondition: .*direction",
    ),
    "rule": (
        (1, 0),
        {"content": event(start=trigger(LATER.replace("greaterThan", "notEqualTo")))},
        "SimulationTimeCondition: .*rule=",
    ),
    "route": (
        (1, 0),
        {
            "content": condition_of(
                "TimeHeadwayCondition", 'coordinateSystem="road" relativeDistanceType="lateral"'
            )
        },
        "TimeHeadwayCondition: ",
    ),
    "word": (
        (1, 1),
        {"content": event(priority="$P")},
        r"Event: priority='\$P' may stand for 'override'",
    ),
    "license": ((1, 0), {"header": '<License name="MIT"/>'}, "License"),
    "expression": (
        (1, 0),
        {"parameters": declared("int").replace('"1"', '"${1 + 1}"')},
        "ParameterDeclaration: value='.*plain text",
    ),
    "function": (
        (1, 2),
        {"parameters": declared("int").replace('"1"', '"${abs(1)}"')},
        r"uses abs\(\), which OpenSCENARIO 1.2 does",
    ),
    "controller": (
        (1, 0),
        {"init": controller(ASSIGN)},
        "ControllerAction: .*OverrideControllerValueAction",
    ),
}


@pytest.mark.parametrize(("to", "parts", "message"), REFUSED.values(), ids=REFUSED)
def test_what_an_older_version_cannot_say_is_refused_by_name(
    tmp_path: Path, to, parts, message: str
) -> None:
    with pytest.raises(Unsupported, match=rf"\.xosc:\d+: .*{message}"):
        convert(document(scenario((1, 3), **parts), tmp_path), to)


def test_two_actions_that_were_never_one_are_not_merged(tmp_path: Path) -> None:
    actions = action(controller(ASSIGN)) + action(controller(OVERRIDE), "another")
    with pytest.raises(Unsupported, match="ControllerAction"):
        convert(document(scenario((1, 3), event(actions)), tmp_path), (1, 0))


def test_a_catalogue_gets_the_name_that_later_versions_require(tmp_path: Path) -> None:
    text = scenario((1, 2)).partition("<ParameterDeclarations>")[0] + "<Catalog/></OpenSCENARIO>"
    found = convert(document(text, tmp_path), (1, 3))
    assert found.kind == "catalog" and found.root.find("Catalog").get("name") == ""


def test_an_object_controller_that_says_nothing_is_left_out_where_it_must_say_something(
    tmp_path: Path,
) -> None:
    car = inside('<CatalogReference catalogName="c" entryName="e"/><ObjectController/>')
    found = document(scenario((1, 2), entities=car), tmp_path)
    assert not list(convert(found, (1, 3)).root.iter("ObjectController")) and list(
        found.root.iter("ObjectController")
    )


def test_distributions_came_with_1_1(tmp_path: Path) -> None:
    text = scenario((1, 1)).partition("<ParameterDeclarations>")[0]
    distribution = '<ScenarioFile filepath="a.xosc"/><Deterministic/>'
    text += (
        f"<ParameterValueDistribution>{distribution}</ParameterValueDistribution></OpenSCENARIO>"
    )
    assert is_valid(convert(document(text, tmp_path), (1, 3)))
    with pytest.raises(Unsupported, match="ParameterValueDistribution"):
        convert(document(text, tmp_path), (1, 0))


def test_the_given_document_stays_as_it_is(tmp_path: Path) -> None:
    given = document(scenario((1, 1), event(priority="overwrite")), tmp_path)
    before = etree.tostring(given.root)
    assert convert(given, (1, 3)).version == (1, 3)
    assert etree.tostring(given.root) == before


def test_a_resolved_scenario_can_be_converted(tmp_path: Path) -> None:
    given = document(scenario((1, 1), event(priority="overwrite")), tmp_path)
    assert is_valid(convert(xosc.resolve(given), (1, 3)))


def test_wrong_versions_and_invalid_documents_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"version 2\.0"):
        convert(document(scenario((1, 1)), tmp_path), (2, 0))
    with pytest.raises(InvalidFile, match="SpeedActionDynamics: not valid in its own version"):
        convert(
            document(
                scenario((1, 1), event(action(SPEED.format('followingMode="maybe"')))), tmp_path
            ),
            (1, 3),
        )


def test_categories_and_roles_have_their_new_names_in_1_4_and_their_old_ones_before(
    tmp_path: Path,
) -> None:
    vehicle = (
        '<ScenarioObject name="{0}"><Vehicle name="v" vehicleCategory="{0}" '
        'role="{1}"><BoundingBox><Center x="0" y="0" z="0"/>'
        '<Dimensions width="1" length="1" height="1"/></BoundingBox><Performance maxSpeed="1" '
        'maxAcceleration="1" '
        'maxDeceleration="1"/><Axles>'
        '<FrontAxle maxSteering="0" wheelDiameter="1" trackWidth="1" positionX="1" positionZ="0"/>'
        '<RearAxle maxSteering="0" wheelDiameter="1" trackWidth="1" positionX="0" positionZ="0"/>'
        "</Axles></Vehicle></ScenarioObject>"
    )
    entities = vehicle.format("motorbike", "fire") + vehicle.format("truck", "roadAssistance")
    old = document(scenario((1, 3), entities=entities), tmp_path)
    new = convert(old, (1, 4))
    assert is_valid(new)
    found = [(each.get("vehicleCategory"), each.get("role")) for each in new.root.iter("Vehicle")]
    assert found == [("motorcycle", "fireBrigade"), ("truck", "roadsideAssistance")]
    assert content(convert(new, (1, 3)).root) == content(old.root)
    assert {each.get("role") for each in convert(new, (1, 2)).root.iter("Vehicle")} == {
        "fire",
        "roadAssistance",
    }


def test_rules_are_listed_in_the_order_of_the_steps() -> None:
    assert [rule.version for rule in RULES] == sorted(rule.version for rule in RULES)


@pytest.mark.slow
def test_every_public_file_goes_up_and_back_unchanged_and_down_or_is_refused(corpora: Path) -> None:
    outcomes: Counter[str] = Counter()
    for path in sorted(corpora.rglob("*.xosc")):
        given = xosc.load(path)
        for to in VERSIONS:
            try:
                found = convert(given, to)
            except Unsupported as error:
                assert to < given.version and str(path) in str(error)
                outcomes["refused"] += 1
                continue
            outcomes["converted"] += 1
            back = convert(found, given.version)
            assert to < given.version or content(back.root) == content(given.root), path
    assert outcomes["converted"] > 2 * outcomes["refused"]
