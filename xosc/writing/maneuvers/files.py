"""Complete files: scenarios, catalogues of all eight kinds, and documents in which elements of some
forms repeat."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from string import Template
from typing import Any
from xml.sax.saxutils import escape

from lxml import etree
from scenariogeneration import xosc as sg

from schemas.common.errors import UsageError
from xosc.document import Document, to_bytes
from xosc.writing.files import FileHeader, new_document
from xosc.writing.maneuvers.actions import Conditions, trigger
from xosc.writing.maneuvers.entities import (
    ESCAPED,
    Number,
    PolylineTrajectory,
    declarations,
    number,
    rendered,
)
from xosc.writing.versions import Version

CATALOG_KINDS = (
    "Vehicle",
    "Pedestrian",
    "MiscObject",
    "Controller",
    "Environment",
    "Maneuver",
    "Trajectory",
    "Route",
)
"""Kinds of catalogue entries."""


def scenario(
    path: str | os.PathLike[str],
    header: FileHeader,
    *,
    road: str | None,
    entities: Mapping[str, Any],
    init: Mapping[str, Sequence[Any]],
    maneuvers: Sequence[tuple[str, Any]] = (),
    parameters: Sequence[Any] = (),
    catalogs: Mapping[str, str] | None = None,
    stop: Conditions = (),
    controllers: Mapping[str, Any] | None = None,
    environment: Any | None = None,
    version: Version = (1, 3),
) -> Document:
    """A scenario document; `xosc.write(document, document.path)` makes the file.

    Args:
        path: the file that it is to become.
        header: what the file says about itself.
        road: the OpenDRIVE file, relative to `path`; None for a scenario without roads.
        entities: participants by name: a `vehicle`, `pedestrian`, `obstacle`, or a `reference` to
            one of a catalogue.
        init: actions at the beginning, by participant.
        maneuvers: a participant and its `maneuver` (or a `reference` to one) each; they all may
            start at once.
        parameters: `parameter` declarations.
        catalogs: directories by the kind of catalogue in them (see `CATALOG_KINDS`).
        stop: the scenario ends when these conditions hold; without one it is up to the simulator.
        controllers: the `controller`, or a `reference` to one, of participants.
        environment: a `reference` to one that holds from the beginning.
        version: of the standard.

    Raises:
        UsageError: an action or a manoeuvre belongs to no participant, or there is no such kind of
            catalogue.
        Unsupported: the version cannot say all of it.
    """
    unknown = [name for name in (*init, *(actor for actor, _ in maneuvers)) if name not in entities]
    if unknown:
        raise UsageError(f"{unknown[0]!r} is not among the entities {', '.join(entities)}")
    participants = _entities(entities, controllers or {})
    built = [_catalogs(catalogs or {}), sg.RoadNetwork(road), participants]
    if parameters:
        built.insert(0, declarations(parameters))
    parts = [*(rendered(part) for part in built), storyboard(init, maneuvers, stop, environment)]
    return new_document(path, header, parts, version)


def catalog(
    path: str | os.PathLike[str],
    header: FileHeader,
    name: str,
    entries: Sequence[Any],
    version: Version = (1, 3),
) -> Document:
    """A catalogue document.

    Args:
        path: the file that it is to become.
        header: what the file says about itself.
        name: of the catalogue, which references use.
        entries: objects of scenariogeneration, all of one of the `CATALOG_KINDS`.
        version: of the standard.

    Raises:
        UsageError: the entries are not of one kind that a catalogue can hold, or two have the same
            name.
        Unsupported: the version cannot say all of it.
    """
    element = etree.Element("Catalog", name=name)
    element.extend(rendered(entry) for entry in entries)
    kinds = {str(child.tag) for child in element}
    if len(kinds) != 1 or not kinds <= set(CATALOG_KINDS):
        raise UsageError(
            f"a catalogue holds entries of one kind ({', '.join(CATALOG_KINDS)}), not "
            f"{', '.join(kinds) or 'none'}"
        )
    if len({child.get("name") for child in element}) < len(element):
        raise UsageError(f"two entries of the catalogue {name!r} have the same name")
    return new_document(path, header, [element], version)


def trajectory_catalog(
    header: FileHeader, entries: Sequence[PolylineTrajectory], version: Version = (1, 3)
) -> bytes:
    """The content of a file with a catalogue of polylines, which takes a tenth of the time of
    making its document.

    The document of one entry with two vertices gives what is around the entries, valid by the XSD
    of the version; an entry is the same text in all versions.

    Args:
        entries: with names that differ.
    """
    before, after = _around_trajectories(header, version)
    return "".join([before, *(entry.text for entry in entries), after]).encode()


@lru_cache(maxsize=32)
def _around_trajectories(header: FileHeader, version: Version) -> tuple[str, str]:
    """Return the text before and after the entries of a catalogue of polylines."""
    # Two vertices: the XSD asks for no fewer.
    few = PolylineTrajectory("few", dict.fromkeys("txy", (0.0, 1.0)))
    text = to_bytes(catalog("", header, "TrajectoryCatalog", [few], version)).decode()
    before, after = re.split(r" *<Trajectory .*</Trajectory>\n", text, maxsplit=1, flags=re.DOTALL)
    return before, after


def _catalogs(directories: Mapping[str, str]) -> Any:
    locations = sg.Catalog()
    for kind, directory in directories.items():
        if kind not in CATALOG_KINDS:
            raise UsageError(
                f"there are no catalogues of {kind!r}, only of {', '.join(CATALOG_KINDS)}"
            )
        locations.add_catalog(f"{kind}Catalog", directory)
    return locations


def _entities(entities: Mapping[str, Any], controllers: Mapping[str, Any]) -> Any:
    built = sg.Entities()
    for name, entity in entities.items():
        built.add_scenario_object(name, entity, controllers.get(name))
    return built


def storyboard(
    init: Mapping[str, Sequence[Any]],
    maneuvers: Sequence[tuple[str, Any]] = (),
    stop: Conditions = (),
    environment: Any | None = None,
) -> etree._Element:
    """A `Storyboard` alone, as it stands in 1.3; arguments as in `scenario`."""
    beginning = sg.Init()
    if environment is not None:
        beginning.add_global_action(sg.EnvironmentAction(environment))
    for name, actions in init.items():
        for action in actions:
            beginning.add_init_action(name, action)
    built = sg.StoryBoard(beginning, trigger(stop, "stop") if stop else sg.Trigger("stop"))
    if maneuvers:
        act = sg.Act("act")
        for actor, maneuver in maneuvers:
            name = (
                maneuver.entryname if isinstance(maneuver, sg.CatalogReference) else maneuver.name
            )
            group = sg.ManeuverGroup(f"{name} of {actor}")
            group.add_actor(actor)
            group.add_maneuver(maneuver)
            act.add_maneuver_group(group)
        story = sg.Story("story", sg.ParameterDeclarations())
        story.add_act(act)
        built.add_story(story)
    return rendered(built)


class Form:
    """The elements of some tags of a document, with references `$name` for values.

    Args:
        document: in the version that is written; each tag is there once or not at all.
        tags: of the elements.
    """

    def __init__(self, document: Document, tags: Sequence[str]) -> None:
        text = to_bytes(document).decode()
        matches = {tag: re.search(rf"<{tag} .*?</{tag}>\n", text, re.DOTALL) for tag in tags}
        self._texts = {
            tag: Template(re.sub(r">\n *<", "><", match[0]))
            for tag, match in matches.items()
            if match is not None
        }

    def filled(self, names: Mapping[str, str], numbers: Mapping[str, Number]) -> dict[str, str]:
        """The elements by their tags, a line for each without indentation, with values in place of
        references.

        Raises:
            UsageError: a number is not finite.
        """
        values = {key: escape(name, ESCAPED) for key, name in names.items()}
        values |= {key: str(number(value)) for key, value in numbers.items()}
        return {tag: text.substitute(values) for tag, text in self._texts.items()}


def extended(document: Document, more: Iterable[Mapping[str, str]]) -> bytes:
    """The content of the file of a document, with more elements.

    Args:
        document: has one element of each tag.
        more: elements by their tags (`Form.filled`), which follow those of the document in this
            order.
    """
    text, more = to_bytes(document).decode(), list(more)
    for tag in dict.fromkeys(tag for elements in more for tag in elements):
        before, end, after = text.partition(f"</{tag}>\n")
        text = "".join(
            [before, end, *(elements[tag] for elements in more if tag in elements), after]
        )
    return text.encode()
