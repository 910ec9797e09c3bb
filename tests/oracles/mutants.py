"""Mutants of scenarios that must fail: a mutation removes what a pass would need, so none may pass.

The bases collide under their scripted motion. A mutation breaks the evidence of a test (the ego or
its partner is not there, nothing starts, the run has no time, boxes are out of reach, a file or a
name is missing), or changes nothing that the contact depends on (names are exchanged). None gives
the ego a way to avoid the contact in a sound test; exit code 0 is therefore a lie, also of two
mutations together.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from lxml import etree

from tests.runner.files import scenario, speed_action, story

LIBRARY = Path(__file__).parents[2] / "xosc" / "library"
_BASES = {
    "Lead": "congestion_{w} congestion_highway congestion_{n} congestion_{c} congestion_{t}"
    " highway_lead_brake",
    "CutIn": "cut_in_before_braking_leader_highway cut_in_{w} cut_in_highway cut_in_{n} cut_in_{c}"
    " cut_in_{t} r157_cut_in simple_cut_in",
    "Slow": "cut_out_{w} cut_out_highway cut_out_{n} cut_out_{c} cut_out_{t}",
    "Merging": "lane_closure_highway merge_beside_tail_gater_highway merging_highway",
    "Pedestrian": "intersection_pedestrian_crossing",
    "Left": "squeezed_highway",
    "TurnOff": "turn_off_{w} turn_off_{t}",
}
_ROADS = {"w": "four_way_intersection", "n": "narrow_road", "c": "sharp_curve", "t": "t_junction"}
OPTIONS = ("--world", "kinematic", "--sut", "none", "--timestep", "0.1", "--quiet")
LONGEST = "20"
"""Simulated time (s), beyond the contact of each base"""


class Base(NamedTuple):
    """A scenario in which Ego collides with a partner under scripted motion."""

    path: Path
    partner: str


class Draft(NamedTuple):
    """A mutant in the making: its document, options of xosc-run and the partner's name."""

    root: etree._Element
    options: list[str]
    partner: str


class Mutant(NamedTuple):
    """A written mutant, the options of its command and its mutations."""

    path: Path
    options: tuple[str, ...]
    mutations: tuple[str, ...]


Mutation = Callable[[Draft, Random], bool]
"""Changes a draft; false where it does not apply"""


# bases -------------------------------------------------------------------------------------------


def bases(folder: Path) -> list[Base]:
    """Return 30 scenarios that fail: 26 of the library, and four that are written to a folder."""
    found = [
        Base(LIBRARY / f"{name.format(**_ROADS)}.xosc", partner)
        for partner, names in _BASES.items()
        for name in names.split()
    ]
    brake = speed_action(0, 'dynamicsShape="linear" dynamicsDimension="time" value="2"')
    found += [
        Base(scenario(folder, "plain", stop=10.0), "Lead"),
        Base(scenario(folder, "brakes", stop=10.0, stories=story("Lead", [(1, brake)])), "Lead"),
        Base(scenario(folder, "late", stop=12.0, stories=story("Lead", [(3, brake)])), "Lead"),
        Base(
            scenario(folder, "faster", stop=10.0, stories=story("Ego", [(1, speed_action(30))])),
            "Lead",
        ),
    ]
    return found


def written(base: Base, folder: Path, mutations: tuple[str, ...], random: Random) -> Mutant | None:
    """Write a mutant to a folder; None where one of the mutations does not apply."""
    root = etree.parse(base.path).getroot()
    for element in root.iter(etree.Element):
        for name in ("filepath", "path"):
            target = base.path.parent / element.get(name, "")
            if element.get(name) and target.exists():
                element.set(name, str(target.resolve()))
    draft = Draft(root, [*OPTIONS, "--max-time", LONGEST], base.partner)
    # Exchanged names come first: an ego far away that becomes the partner leaves a sound ego.
    ordered = sorted(mutations, key=lambda name: name != "names_exchanged")
    if not all(MUTATIONS[name](draft, random) for name in ordered):
        return None
    path = folder / f"{base.path.stem}.xosc"
    path.write_bytes(etree.tostring(root, encoding="UTF-8", xml_declaration=True))
    return Mutant(path, tuple(draft.options), mutations)


def mutants(seed: int, count: int, folder: Path) -> Iterator[Mutant]:
    """Yield mutants of the bases in turn, half of them with two mutations; equal for equal seeds.

    Args:
        seed: of the draw.
        count: of mutants.
        folder: new folder; each mutant has a folder of its own in it.
    """
    random = Random(seed)
    found = bases(folder / "bases")
    number = 0
    while number < count:
        base = found[number % len(found)]
        names = tuple(sorted(random.sample(sorted(MUTATIONS), random.choice((1, 2)))))
        into = folder / f"{number:05}"
        into.mkdir(exist_ok=True)
        mutant = written(base, into, names, random)
        if mutant is not None:
            number += 1
            yield mutant


# mutations ---------------------------------------------------------------------------------------


def _private(draft: Draft, entity: str) -> list[etree._Element]:
    init = draft.root.find("Storyboard/Init/Actions")
    return (
        [] if init is None else [e for e in init.findall("Private") if e.get("entityRef") == entity]
    )


def _unplace(draft: Draft, entity: str) -> bool:
    teleports = [e for private in _private(draft, entity) for e in private.iter("TeleportAction")]
    for teleport in teleports:
        action = teleport.getparent()
        assert action is not None
        private = action.getparent()
        assert private is not None
        private.remove(action)
    return bool(teleports)


def ego_without_place(draft: Draft, random: Random) -> bool:
    """Remove the ego's initial position."""
    return _unplace(draft, "Ego")


def partner_without_place(draft: Draft, random: Random) -> bool:
    """Remove the partner's initial position; its other initial actions and events stay."""
    return _unplace(draft, draft.partner)


def nobody_placed(draft: Draft, random: Random) -> bool:
    """Remove all initial actions."""
    actions = draft.root.find("Storyboard/Init/Actions")
    if actions is None or not len(actions):
        return False
    for child in list(actions):
        actions.remove(child)
    return True


def _delete_at_start(draft: Draft, entity: str) -> bool:
    actions = draft.root.find("Storyboard/Init/Actions")
    if actions is None or not _private(draft, entity):
        return False
    text = (
        "<GlobalAction><EntityAction "
        f'entityRef="{entity}"><DeleteEntityAction/></EntityAction></GlobalAction>'
    )
    actions.append(etree.fromstring(text))
    return True


def ego_deleted(draft: Draft, random: Random) -> bool:
    """Delete the ego at the start."""
    return _delete_at_start(draft, "Ego")


def partner_deleted(draft: Draft, random: Random) -> bool:
    """Delete the partner at the start, before the contact."""
    return _delete_at_start(draft, draft.partner)


def _remove_object(draft: Draft, entity: str) -> bool:
    for element in draft.root.findall("Entities/ScenarioObject"):
        if element.get("name") == entity:
            draft.root.find("Entities").remove(element)  # type: ignore[union-attr]
            return True
    return False


def ego_undeclared(draft: Draft, random: Random) -> bool:
    """Remove the ego's declaration; its actions stay."""
    return _remove_object(draft, "Ego")


def partner_undeclared(draft: Draft, random: Random) -> bool:
    """Remove the partner's declaration; its actions stay."""
    return _remove_object(draft, draft.partner)


def placed_under_another_name(draft: Draft, random: Random) -> bool:
    """Misspell a name in the initial actions."""
    found = _private(draft, random.choice(("Ego", draft.partner)))
    for element in found:
        element.set("entityRef", f"{element.get('entityRef')}_")
    return bool(found)


def _positions(draft: Draft, entity: str) -> list[etree._Element]:
    return [e for private in _private(draft, entity) for e in private.iter("Position")]


def _relocated(draft: Draft, position: str) -> bool:
    found = _positions(draft, "Ego")
    for element in found:
        for child in list(element):
            element.remove(child)
        element.append(etree.fromstring(position))
    return bool(found)


def ego_in_the_air(draft: Draft, random: Random) -> bool:
    """Place the ego 500 m above the ground."""
    return _relocated(draft, '<WorldPosition x="0" y="0" z="500" h="0"/>')


def ego_far_away(draft: Draft, random: Random) -> bool:
    """Place the ego 100 km beside the road."""
    return _relocated(draft, '<WorldPosition x="0" y="100000" h="0"/>')


def ego_beyond_the_road(draft: Draft, random: Random) -> bool:
    """Place the ego 1,000 km along a lane."""
    found = [e for position in _positions(draft, "Ego") for e in position.iter("LanePosition")]
    for element in found:
        element.set("s", "1000000")
    return bool(found)


def ego_on_a_missing_lane(draft: Draft, random: Random) -> bool:
    """Place the ego on a lane that no road has."""
    found = [e for position in _positions(draft, "Ego") for e in position.iter("LanePosition")]
    for element in found:
        element.set("laneId", "-77")
    return bool(found)


def nothing_starts(draft: Draft, random: Random) -> bool:
    """Give every event and act a start trigger that is never true."""
    never = etree.fromstring(
        '<ConditionGroup><Condition name="never" delay="0" conditionEdge="none"><ByValueCondition>'
        '<SimulationTimeCondition value="1000000" '
        'rule="greaterThan"/></ByValueCondition></Condition>'
        "</ConditionGroup>"
    )
    found = list(draft.root.findall(".//Act/StartTrigger"))
    for trigger in found:
        for child in list(trigger):
            trigger.remove(child)
        trigger.append(copy.deepcopy(never))
    return bool(found)


def actors_removed(draft: Draft, random: Random) -> bool:
    """Leave every maneuver group without an actor."""
    found = [e for e in draft.root.iter("Actors") if len(e)]
    for element in found:
        for child in list(element):
            element.remove(child)
    return bool(found)


def actions_emptied(draft: Draft, random: Random) -> bool:
    """Leave every action of the stories empty."""
    found = [e for e in draft.root.findall(".//Event/Action") if len(e)]
    for element in found:
        for child in list(element):
            element.remove(child)
    return bool(found)


def ends_at_once(draft: Draft, random: Random) -> bool:
    """End the run at time 0."""
    trigger = draft.root.find("Storyboard/StopTrigger")
    if trigger is None:
        return False
    for child in list(trigger):
        trigger.remove(child)
    trigger.append(
        etree.fromstring(
            '<ConditionGroup><Condition name="end" delay="0" '
            'conditionEdge="none"><ByValueCondition>'
            '<SimulationTimeCondition value="0" '
            'rule="greaterOrEqual"/></ByValueCondition></Condition>'
            "</ConditionGroup>"
        )
    )
    return True


def no_time(draft: Draft, random: Random) -> bool:
    """Allow no simulated time, or less than a step."""
    draft.options[-1] = random.choice(("0", "0.01"))
    return True


def storyboard_emptied(draft: Draft, random: Random) -> bool:
    """Remove everything from the storyboard."""
    storyboard = draft.root.find("Storyboard")
    if storyboard is None:
        return False
    for child in list(storyboard):
        storyboard.remove(child)
    return True


def storyboard_removed(draft: Draft, random: Random) -> bool:
    """Remove the storyboard."""
    storyboard = draft.root.find("Storyboard")
    if storyboard is not None:
        draft.root.remove(storyboard)
    return storyboard is not None


def road_file_missing(draft: Draft, random: Random) -> bool:
    """Name a road network that does not exist."""
    found = list(draft.root.iter("LogicFile"))
    for element in found:
        element.set("filepath", "nowhere.xodr")
    return bool(found)


def catalogue_entry_missing(draft: Draft, random: Random) -> bool:
    """Name a catalogue entry that does not exist."""
    found = list(draft.root.iter("CatalogReference"))
    if found:
        random.choice(found).set("entryName", "no_such_entry")
    return bool(found)


def _boxes(draft: Draft, tag: str) -> list[etree._Element]:
    objects = draft.root.findall("Entities/ScenarioObject")
    return [e for o in objects if o.get("name") == "Ego" for e in o.iter(tag)]


def box_of_no_size(draft: Draft, random: Random) -> bool:
    """Give the ego a box without extent."""
    found = _boxes(draft, "Dimensions")
    for element in found:
        for name in ("width", "length", "height"):
            element.set(name, random.choice(("0", "1e-300")))
    return bool(found)


def box_out_of_reach(draft: Draft, random: Random) -> bool:
    """Put the centre of the ego's box far above or beside it."""
    found = _boxes(draft, "Center")
    for element in found:
        element.set(random.choice(("y", "z")), "100000")
    return bool(found)


def names_exchanged(draft: Draft, random: Random) -> bool:
    """Exchange the names of the ego and its partner everywhere: the same two collide."""
    swapped = {"Ego": draft.partner, draft.partner: "Ego"}
    for element in draft.root.iter(etree.Element):
        for name, value in element.attrib.items():
            if value in swapped and name in ("name", "entityRef"):
                element.set(name, swapped[value])
    return True


def ego_of_another_name(draft: Draft, random: Random) -> bool:
    """Rename the ego everywhere: it collides still, or the run has no ego."""
    for element in draft.root.iter(etree.Element):
        for name, value in element.attrib.items():
            if value == "Ego" and name in ("name", "entityRef"):
                element.set(name, "Fahrzeug_7")
    return True


def ego_asked_for_is_missing(draft: Draft, random: Random) -> bool:
    """Ask for an ego that the scenario does not have."""
    draft.options[:0] = ["--ego", random.choice(("Nobody", "EGO", ""))]
    return True


def system_misspelt(draft: Draft, random: Random) -> bool:
    """Ask for a system under test that does not exist."""
    draft.options[draft.options.index("none")] = random.choice(
        ("cass", "cas:no=1", "no_module:Class")
    )
    return True


def limit_misspelt(draft: Draft, random: Random) -> bool:
    """Ask for a limit that does not exist or that no run can break."""
    draft.options[:0] = ["--fail-if", random.choice(("min_tc<1", "min_ttc<-1", "min_ttc<nan"))]
    return True


def parameter_misspelt(draft: Draft, random: Random) -> bool:
    """Set a parameter that the scenario does not declare."""
    draft.options[:0] = ["--param", "No_Such_Parameter=1"]
    return True


def criterion_misspelt(draft: Draft, random: Random) -> bool:
    """Add a criterion whose name has a slip."""
    trigger = draft.root.find("Storyboard/StopTrigger")
    if trigger is None:
        return False
    name = random.choice(("CollisonTest", "RunningStopTestt", "DrivenDistanceTest "))
    trigger.append(
        etree.fromstring(
            f'<ConditionGroup><Condition name="criteria_{name}" delay="0" conditionEdge="rising">'
            '<ByValueCondition><ParameterCondition parameterRef="" value="" rule="lessThan"/>'
            "</ByValueCondition></Condition></ConditionGroup>"
        )
    )
    return True


MUTATIONS: dict[str, Mutation] = {
    mutation.__name__: mutation
    for mutation in (
        *(ego_without_place, partner_without_place, nobody_placed, ego_deleted, partner_deleted),
        *(ego_undeclared, partner_undeclared, placed_under_another_name, ego_in_the_air),
        *(ego_far_away, ego_beyond_the_road, ego_on_a_missing_lane, nothing_starts),
        *(actors_removed, actions_emptied, ends_at_once, no_time, storyboard_emptied),
        *(storyboard_removed, road_file_missing, catalogue_entry_missing, box_of_no_size),
        *(box_out_of_reach, names_exchanged, ego_of_another_name, ego_asked_for_is_missing),
        *(system_misspelt, limit_misspelt, parameter_misspelt, criterion_misspelt),
    )
}
"""Mutations by name"""
