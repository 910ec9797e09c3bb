"""Elements that a version lacks and no motion depends on: left out or rewritten, with a remark
each.

`xosc.writing.versions` converts what can be said in both versions, and refuses the rest. Exports
that are not strict make these changes before. A place is XPath from the root; values that are still
parameters (`$…`) are left as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, cast

from lxml import etree

from schemas.expressions.values import number
from xosc.document import Document
from xosc.document.node import SOURCE, Node
from xosc.rules.storyboard import CHOICES
from xosc.writing.versions import EARLIER_CATEGORY, Version

_CLOUDS = {
    "zeroOktas": "free", **{f"{n}Oktas": "cloudy" for n in ("two", "three", "four", "five", "six")},
    "oneOktas": "cloudy",
    "sevenOktas": "overcast", "eightOktas": "overcast", "nineOktas": "skyOff",
}  # fmt: skip
"""Cloud states of 1.0 and 1.1 by the cover that they are said by since 1.2."""
_HEAVIEST_RAIN = 50.0
"""mm/h that an intensity of 1 stands for in 1.0."""
_FAR_AWAY = "100000"
"""Visual range (m) of clear air."""
_IDLE = "nothing"
_NO_VERSION = (2, 0)
"""Later than all: of what none of them has."""
_TOWS_NOTHING = "not(//TrailerAction) and not(//Trailer)"


class Omission(NamedTuple):
    """Change of the elements at a place, for versions before those elements."""

    before: Version
    where: str
    change: Callable[[etree._Element], None]
    reason: str


def omit(document: Document, version: Version) -> Iterator[str]:
    """Make the changes for a version, in place; a remark for each kind with the first place."""
    yield from _idle_elements(document)
    yield from _misplaced_actions(document)
    # By the older of both: a file may have what its own version lacks.
    older = min(version, document.version)
    changes = [omission for omission in OMISSIONS if older < omission.before]
    changes += [
        omission for omission in SAID_OTHERWISE if version < omission.before <= document.version
    ]
    for _, where, change, reason in changes:
        elements = _at(document, where)
        if elements:
            first: Node = located(elements[0], document)
            yield f"{first.where}: {first.tag}: {reason}"
        for element in elements:
            # An element outside the tree was removed with another one of the same Action.
            if document.root in (element, *element.iterancestors()):
                change(element)


def _idle_elements(document: Document) -> Iterator[str]:
    """Fill actions and acts without content, which schemas and other players refuse, with content
    that does nothing."""
    inside = "[not(*)][ancestor-or-self::Action or ancestor-or-self::PrivateAction]"
    for action in _at(document, " | ".join(f"//{tag}{inside}" for tag in ("Action", *CHOICES))):
        # An action outside the tree was removed with another one of the same Action.
        if document.root in action.iterancestors():
            yield (
                f"{located(action, document).where}: {action.tag}: without an "
                "action it does nothing"
            )
            _idle(action)
    for act in _at(document, "//Act[not(ManeuverGroup)]"):
        yield f"{located(act, document).where}: {act.tag}: without a group it does nothing"
        act.insert(0, _idle_group())


def _misplaced_actions(document: Document) -> Iterator[str]:
    """Remove actions outside of any Action: nothing runs them, and exports need their actors."""
    inside = " or ".join(
        f"ancestor-or-self::{tag}"
        for tag in ("Action", "PrivateAction", "GlobalAction", "UserDefinedAction")
    )
    for action in _at(
        document, f"//*[substring(name(), string-length(name()) - 5) = 'Action'][not({inside})]"
    ):
        if document.root in action.iterancestors():  # else it went with the one around it
            yield (
                f"{located(action, document).where}: {action.tag}: outside an "
                "action it does nothing"
            )
            _remove(action)


def _at(document: Document, where: str) -> list[etree._Element]:
    return cast(list[etree._Element], document.root.xpath(where))


def leave_out(action: Node, scenario: Node) -> None:
    """Take an action away, no other one of its ControllerAction; where its event has no other one,
    it does nothing instead.

    An action that went before, with another one of the same Action, is skipped.
    """
    if scenario.element not in action.element.iterancestors():
        return
    holder, parent = action.element, _parent(action.element)
    # Up to the element that can be taken away whole: what would be left has to be valid.
    while holder.tag not in ("Action", "PrivateAction") or parent.tag == "Action":
        # It may hold two actions: the other one stays.
        if parent.tag == "ControllerAction" and len(parent.findall("*")) > 1:
            parent.remove(holder)
            return
        holder, parent = parent, _parent(parent)
    if holder.tag == "PrivateAction" or len(parent.findall("Action")) > 1:
        parent.remove(holder)
        if (
            parent.tag == "Private"
            and len(parent) == 0
            and (around := parent.getparent()) is not None
        ):
            around.remove(parent)
        return
    # Kept without effect: an Event has at least one Action, and others may wait for its end. Every
    # version has ParameterAction, if deprecated since 1.2.
    for child in list(holder):
        holder.remove(child)
    setting = etree.SubElement(
        etree.SubElement(holder, "GlobalAction"), "ParameterAction", parameterRef=_IDLE
    )
    etree.SubElement(setting, "SetAction", value="")
    _declare(scenario)


def _declare(scenario: Node) -> None:
    """The parameter that actions set which do nothing."""
    root = scenario.element
    declarations = root.find("ParameterDeclarations")
    if declarations is None:
        declarations = etree.Element("ParameterDeclarations")
        header = root.find("FileHeader")
        assert header is not None
        header.addnext(declarations)
    if not any(declaration.get("name") == _IDLE for declaration in declarations):
        etree.SubElement(
            declarations, "ParameterDeclaration", name=_IDLE, parameterType="string", value=""
        )


def _remove(element: etree._Element) -> None:
    _parent(element).remove(element)


def _parent(element: etree._Element) -> etree._Element:
    parent = element.getparent()
    assert parent is not None, "actions, and the places of the table, are below the root"
    return parent


def _keep(_: etree._Element) -> None:
    """Keep an element; its remark says that the version means something else by it."""


def _idle(action: etree._Element) -> None:
    leave_out(Node(action, Path()), Node(action.getroottree().getroot(), Path()))


def _plain_name(condition: etree._Element) -> None:
    condition.set(
        "name",
        str(condition.get("name")).translate({ord(character): None for character in "${}"}).strip(),
    )


def _without(*attributes: str) -> Callable[[etree._Element], None]:
    def change(element: etree._Element) -> None:
        for attribute in attributes:
            if attribute in element.attrib:
                del element.attrib[attribute]

    return change


def _with(attribute: str, value: str) -> Callable[[etree._Element], None]:
    return lambda element: element.set(attribute, value)


def _renamed(old: str, new: str) -> Callable[[etree._Element], None]:
    return lambda element: element.set(new, str(element.attrib.pop(old)))


def _called(tag: str) -> Callable[[etree._Element], None]:
    return lambda element: setattr(element, "tag", tag)


def _category(new: str, old: str) -> Callable[[etree._Element], None]:
    def change(element: etree._Element) -> None:
        for attribute in ("vehicleCategory", "category"):
            if element.get(attribute) == new:
                element.set(attribute, old)

    return change


def _role(element: etree._Element) -> None:
    """No role; the entry of a distribution keeps its weight."""
    element.set("role", "none")


def _described(name: str) -> Callable[[etree._Element], None]:
    """Makes a Property of an attribute."""

    def change(element: etree._Element) -> None:
        properties = element.find("Properties")
        if properties is None:
            properties = etree.SubElement(element, "Properties")
        properties.append(etree.Element("Property", name=name, value=str(element.attrib.pop(name))))

    return change


def _cloud_state(weather: etree._Element) -> None:
    weather.set(
        "cloudState", _CLOUDS.get(str(weather.attrib.pop("fractionalCloudCover")), "cloudy")
    )


def _rain(precipitation: etree._Element) -> None:
    amount = number(str(precipitation.attrib.pop("precipitationIntensity")))
    precipitation.set("intensity", repr(min(amount / _HEAVIEST_RAIN, 1.0)))


def _parameters(declarations: etree._Element) -> None:
    """Variables as parameters, which actions may set and conditions compare as well."""
    root = declarations.getparent()
    assert root is not None, "variables are declared by scenarios"
    parameters = root.find("ParameterDeclarations")
    if parameters is None:
        parameters = etree.Element("ParameterDeclarations")
        declarations.addprevious(parameters)
    for variable in declarations:
        parameters.append(
            etree.Element(
                "ParameterDeclaration", name=variable.get("name", ""),
                parameterType=variable.get("variableType", ""),
                value=variable.get("value", ""),
            )
        )  # fmt: skip
    root.remove(declarations)
    for element in root.iter("VariableAction", "VariableCondition"):
        element.tag = str(element.tag).replace("Variable", "Parameter")
        element.set("parameterRef", str(element.attrib.pop("variableRef")))


def _idle_story(storyboard: etree._Element) -> None:
    """Add a story with an act that never starts: versions before 1.2 ask for a story."""
    story = etree.Element("Story", name="none")
    act = etree.SubElement(story, "Act", name="none")
    act.append(_idle_group())
    etree.SubElement(act, "StartTrigger")
    init = storyboard.find("Init")
    assert init is not None, "storyboards have an Init"
    init.addnext(story)


def _idle_group() -> etree._Element:
    group = etree.Element("ManeuverGroup", name="none", maximumExecutionCount="1")
    etree.SubElement(group, "Actors", selectTriggeringEntities="false")
    return group


def _complete(environment: etree._Element) -> None:
    """The parts of an environment that 1.0 asks for."""
    header = environment.getroottree().find("FileHeader")
    date = header.get("date", "") if header is not None else ""
    made = {
        "TimeOfDay": {"animation": "false", "dateTime": date},
        "Weather": {"cloudState": "free"},
        "RoadCondition": {"frictionScaleFactor": "1"},
    }
    for place, (tag, attributes) in enumerate(made.items()):
        if environment.find(tag) is None:
            # The order of the schema: parts stand after the declarations.
            declared = environment.find("ParameterDeclarations") is not None
            environment.insert(place + declared, etree.Element(tag, attributes))


def _complete_weather(weather: etree._Element) -> None:
    made = {
        "Sun": {"intensity": "1", "azimuth": "0", "elevation": "1"},
        "Fog": {"visualRange": _FAR_AWAY},
        "Precipitation": {"precipitationType": "dry", "intensity": "0"},
    }
    for place, (tag, attributes) in enumerate(made.items()):
        if weather.find(tag) is None:
            weather.insert(place, etree.Element(tag, attributes))
    if "cloudState" not in weather.attrib:
        weather.set("cloudState", "free")


def _along_route(condition: etree._Element) -> None:
    _without("coordinateSystem", "relativeDistanceType", "routingAlgorithm")(condition)
    condition.set("alongRoute", "true")


_NOT_SHOWN = "this version does not have it, and no motion depends on it"


def _attribute(name: str) -> tuple[Callable[[etree._Element], None], str]:
    """The change that leaves an attribute out which no motion depends on, and its reason."""
    return _without(name), f"{name} is left out: {_NOT_SHOWN}"


_COUNTED = "TimeOfDayCondition"
_ALONG = (
    "[(@coordinateSystem='road' or @coordinateSystem='lane') and "
    "@relativeDistanceType='longitudinal']"
)
_AHEAD = (
    "[(@coordinateSystem='entity' or not(@coordinateSystem)) and "
    "@relativeDistanceType='longitudinal']"
)

_MOTION = " | ".join(
    f"//{place}"
    for place in (
        "Vertex/Motion",
        "Clothoid/MotionStart",
        "Clothoid/MotionEnd",
        "ClothoidSpline/*/MotionStart",
        "ClothoidSpline/MotionEnd",
    )
)
_NEW_ROLES = (
    "agriculture", "construction", "dangerousGoodsTransport", "freightTransport",
    "garbageCollection", "other", "specialTransport", "trafficControl",
)  # fmt: skip

OMISSIONS: tuple[Omission, ...] = (
    # all
    Omission(_NO_VERSION, "//Trailer[*/@entityRef='']", _remove, "it tows nothing"),
    Omission(_NO_VERSION, "//Trailer/EntityRef", _called("TrailerRef"),
        "older catalogues call so what is written as TrailerRef"),
    # 1.4
    Omission(
        (1, 4), "//AbsoluteTargetLane/@layer/.. | //RelativeTargetLane/@layer/..",
        _without("layer"),
        "this version knows no lane layers; the lane is that of the layer which the player takes",
    ),
    Omission((1, 4), "//PreferredLaneLayerAction", _idle, "this version knows no lane layers"),
    Omission((1, 4), "//Phase/@semantics/..", _without("semantics"),
        "this version has the states of the signals alone"),
    Omission((1, 4), _MOTION, _remove,
        "this version has speeds along a trajectory by its times alone; they are lost"),
    Omission((1, 4), "//Polyline/Interpolation", _remove,
        "this version joins vertices by straight lines"),
    *(
        Omission(
            (1, 4), f"//Vehicle[@vehicleCategory='{new}'] | "
                    f"//VehicleCategoryDistributionEntry[@category='{new}']",
            _category(new, old), f"its category {new} is written as {old}, the "
                                 "nearest of this version",
        )
        for new, old in EARLIER_CATEGORY.items() if new != "motorcycle"
    ),
    *(
        Omission((1, 4), f"//*[@role='{role}']", _role,
            f"the role {role} is not in this version, and no motion depends on it")
        for role in _NEW_ROLES
    ),
    Omission((1, 4), "//LightStateAction[.//VehicleLight/@vehicleLightType='tailLights']", _idle,
        _NOT_SHOWN),
    Omission(
        (1, 4), "//CatalogLocations[not(//CatalogReferences)]/TrafficDistributionEntryCatalog",
        _remove, "nothing refers to it"
    ),
    Omission((1, 4), "//TrafficDistribution/TrafficDistributionEntry[@name]", *_attribute("name")),
    Omission(
        (1, 4), "//TrafficDistributionEntry[not(.//@*[starts-with(., '$')])]/ParameterDeclarations",
        _remove,
        "its parameters are worked out",
    ),
    # 1.3
    Omission(
        (1, 3), f"/OpenSCENARIO/Entities[{_TOWS_NOTHING}]//Vehicle/*[self::TrailerHitch or "
                "self::TrailerCoupler]",
        _remove, "nothing is towed by it",
    ),
    Omission(
        (1, 3), "//ScenarioObject/ObjectController[preceding-sibling::ObjectController]", _remove,
        "this version has one controller of an object, none of which are executed here",
    ),
    Omission((1, 3), "//ObjectController/@name/..", _without("name"),
        "this version's controllers of objects have no name"),
    Omission(
        (1, 3), "//ActivateControllerAction/@objectControllerRef/..",
        _without("objectControllerRef"),
        "this version switches all controllers of an entity, which are not executed here",
    ),
    # 1.2
    Omission(
        (1, 2), "//Vehicle/@role/.. | //Pedestrian/@role/..", _described("role"),
        "before 1.2 it is a Property of that name, and no motion depends on it",
    ),
    Omission(
        (1, 2), "//Weather[@fractionalCloudCover and not(starts-with(@fractionalCloudCover, '$'))]",
        _cloud_state,
        "the cloud cover is written as the cloudState that it makes",
    ),
    Omission((1, 2), "//Sun[@illuminance]", _renamed("illuminance", "intensity"),
        "illuminance is called intensity before 1.2"),
    Omission((1, 2), "//AppearanceAction", _idle, _NOT_SHOWN),
    Omission((1, 2), "//RoadCondition/@wetness/..", *_attribute("wetness")),
    Omission((1, 2), "//Controller/@controllerType/..", *_attribute("controllerType")),
    Omission(
        (1, 2), "/OpenSCENARIO/VariableDeclarations[not(VariableDeclaration/@name = "
                "//ParameterDeclaration/@name)]", _parameters,
        "variables are written as parameters, which actions may set before 1.2",
    ),
    # 1.1
    Omission((1, 1), "//Vehicle/@model3d/.. | //MiscObject/@model3d/..", *_attribute("model3d")),
    Omission((1, 1), "//Pedestrian[@model and @model3d]", *_attribute("model3d")),
    Omission(
        (1, 1), "//Weather[@temperature or @atmosphericPressure]",
        _without("temperature", "atmosphericPressure"),
        f"temperature and atmosphericPressure are left out: {_NOT_SHOWN}",
    ),
    Omission((1, 1), "//Weather/Wind | //Weather/DomeImage", _remove, _NOT_SHOWN),
    Omission(
        (1, 1), "//Precipitation[@precipitationIntensity and "
                "not(starts-with(@precipitationIntensity, '$'))]", _rain,
        f"its intensity is written as a part of {_HEAVIEST_RAIN:g} mm/h",
    ),
    Omission(
        (1, 1), " | ".join(f"//{tag}Condition{_ALONG}" for tag in ("TimeHeadway", "TimeToCollision",
            "Distance")),
        _along_route, "a distance along the road or lane is written as one along the route",
    ),
    Omission(
        (1, 1), f"//TimeHeadwayCondition{_AHEAD}", _along_route,
        "a distance ahead is written as one along the route",
    ),
    Omission(
        (1, 1), "//RelativeDistanceCondition[@relativeDistanceType='longitudinal' and "
                "@coordinateSystem]",
        _without("coordinateSystem"),
        "a distance along the lane or road is written as one ahead, the same "
                                      "where it is straight",
    ),
)  # fmt: skip
"""Of what a version brought, in the order in which they are made; files that have it before lose it
too."""

SAID_OTHERWISE: tuple[Omission, ...] = (
    Omission(
        # A rate beyond the Performance is bounded as a time is; of lane changes nothing is.
        (1, 2), "//SpeedActionDynamics[@dynamicsShape!='step' and not(@followingMode='follow')]",
        _keep, "before 1.2 it takes longer where the vehicle's Performance asks for that",
    ),
    Omission((1, 2), "/OpenSCENARIO/Storyboard[not(Story)]", _idle_story,
        "a story is added whose act never starts"),
    Omission((1, 1), "//Condition[contains(@name, '$')]", _plain_name,
        "its name, an expression, is written as plain text"),
    Omission(
        (1, 1), f"//Environment[not(//{_COUNTED} and not(TimeOfDay))][not(TimeOfDay and Weather "
                "and RoadCondition)]",
        _complete,
        "the parts that it leaves as they are, and 1.0 asks for, are written for "
        "dry and clear weather",
    ),
    Omission(
        (1, 1), "//Weather[not(@cloudState and Sun and Fog and Precipitation)]", _complete_weather,
        "the parts that it leaves as they are, and 1.0 asks for, are written for "
        "dry and clear weather",
    ),
    Omission(
        (1, 1), "//Vertex[not(@time) and not(ancestor::FollowTrajectoryAction//Timing)]",
        _with("time", "0"),
        "a time is written, which counts only with a Timing",
    ),
)  # fmt: skip
"""Of what older versions ask for, or mean otherwise."""


class Rule(NamedTuple):
    """Elements of a scenario, as XPath from its root, and the reason why the target can't have
    them."""

    where: str
    reason: str


def refuse(document: Document, rules: Sequence[Rule]) -> None:
    """Refuse the first element of a scenario to which a rule of a table applies.

    Raises:
        Unsupported: it is there, named with file (a catalogue's, where it came from there), line
            and reason.
    """
    for node, reason in _found(document, rules):
        raise node.unsupported(reason)


def remarks(document: Document, rules: Sequence[Rule]) -> list[str]:
    """A remark for every rule of a table that applies, with the first place where it does."""
    first: dict[str, Node] = {}
    for node, reason in _found(document, rules):
        first.setdefault(reason, node)
    return [f"{node.where}: {node.tag}: {reason}" for reason, node in first.items()]


def _found(document: Document, rules: Sequence[Rule]) -> Iterator[tuple[Node, str]]:
    """Elements in their order with the reason of the first rule that is about them."""
    reasons: dict[etree._Element, str] = {}
    for rule in rules:
        for element in cast(list[etree._Element], document.root.xpath(rule.where)):
            reasons.setdefault(element, rule.reason)
    for element in document.root.iter():
        if element in reasons:
            yield located(element, document), reasons[element]


def located(element: etree._Element, document: Document) -> Node:
    """An element of a document in the file that it came from: a catalogue's entry knows which that
    is."""
    source = next(
        (
            ancestor.get(SOURCE)
            for ancestor in (element, *element.iterancestors())
            if ancestor.get(SOURCE)
        ),
        None,
    )
    return Node(element, Path(source) if source else document.path)
