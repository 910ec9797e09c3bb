"""Location of a scenario's road network: the path of its LogicFile, or else a file of the same name
nearby.

Libraries get moved about, and scenarios for CARLA name towns (`Town01`) instead of files. The one
look-up for all that load.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from schemas.checks.road_references import VARIABLE, asked_for, candidates, first
from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.remarks import Remark
from schemas.common.storage import above, in_any_case, search_path, similar_file
from xosc.document.node import Node

RULE = "xosc.toolchain:xosc:1.0.0:reference_control.resolvable_file_reference"


class NoRoadNetwork(InvalidFile):
    """The road network that a scenario names is nowhere."""


class RoadFile(NamedTuple):
    """The file of a road network. remark: None where it is where the LogicFile says, or in a folder
    that was asked for."""

    path: Path
    remark: Remark | None


def logic_file(scenario: Node) -> Node | None:
    """The element LogicFile of a scenario; None where it names no road network."""
    logic = scenario.find("RoadNetwork", "LogicFile")
    return logic if logic is not None and logic.get("filepath").strip() else None


def find_roads(logic: Node, folders: Sequence[str | PathLike[str]] = ()) -> RoadFile:
    """The road network that a LogicFile names.

    A file that is not there is looked for by its name, with and without the ending .xodr: in the
    folders that were asked for, then where it should be, in other case, in the folder of the
    scenario and all folders above that, there by its relative path too, and in the folders that
    were asked for in other case.

    Args:
        logic: the element LogicFile, its attributes literals.
        folders: where else to look, before the folders in XOSC_ROAD_PATH.

    Raises:
        NoRoadNetwork: it is nowhere; the message says what can be done.
        InvalidFile: it is outside of what may be read.
    """
    named = logic.file("filepath")
    if not current().allows(named):
        raise logic.invalid(
            f"the road network {named} {current().outside}, which --untrusted refuses"
        )
    # Functions of os.path take names of any length, those of Path raise OSError.
    if os.path.exists(named) and not os.path.isdir(named):
        return RoadFile(named, None)
    file = asked_for(named.name, folders)
    if file is not None:
        return RoadFile(file, None)
    scenario = Path(os.path.abspath(logic.path)).parent
    alike = in_any_case(named)
    places = (
        named.parent,
        scenario,
        *scenario.parents,
        *(place.parent for place in above(named, logic.path)),
    )
    found = alike if alike and os.path.isfile(alike) else first(places, named.name)
    if found is None:
        spelt = map(in_any_case, candidates(search_path(folders, VARIABLE), named.name))
        found = next((file for file in spelt if file and os.path.isfile(file)), None)
    if found is None:
        raise NoRoadNetwork(
            f"the road network {named} does not exist: {similar_file(named, scenario)}put it "
            f"there, name its folder with --road-path (or in {VARIABLE}), or have one made by "
            "--road auto",
            path=logic.path, line=logic.line, element=logic.tag,
        )  # fmt: skip
    return RoadFile(
        found, logic.remark(RULE, f"the road network {named} does not exist; {found} is taken")
    )
