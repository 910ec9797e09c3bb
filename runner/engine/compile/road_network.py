"""Road network of a scenario: its own, a found one, or one that is made from the
positions in use.
"""

from __future__ import annotations

import hashlib
import math
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import xodr
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import current
from schemas.common.remarks import Remark
from schemas.common.storage import cache_folder
from xosc.document import load
from xosc.document.road_files import RULE, RoadFile, find_roads, logic_file
from xosc.resolve import resolve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from xodr.builders.roads_and_ramps import RoadUse
    from xodr.graph.network import RoadNetwork
    from xosc.document.node import Node
    from xosc.resolve import Resolved

_AHEAD = 1000.0
"""Length (m) of a made road beyond the last position on it."""
_LANE_WIDTH = 3.5


def load_roads(
    document: Resolved, road: str | None, road_path: Sequence[str] = (), strict: bool = False
) -> tuple[RoadNetwork | None, tuple[Remark, ...]]:
    """The road network of a resolved scenario, None where it has none, and what was assumed to find
    it.

    Args:
        road: an OpenDRIVE file, or `auto` for straight roads, where the network is missing; None
            for a plane without roads.
        road_path: folders in which it is looked for too.
        strict: refuse a network that breaks its standard.

    Raises:
        InvalidFile: its file is nowhere, or no road network.
    """
    logic = logic_file(document.node)
    found = _own(logic, road, road_path)
    if found is None and road is not None:
        found = (
            _made(document.node, logic) if road == "auto" else _given(document.node, logic, road)
        )
    if found is None and logic is not None:
        lacks = (
            f"the road network {logic.get('filepath')!r} does not exist, and no "
            "position names a road"
        )
        return None, (logic.remark(RULE, f"{lacks}; a plane without roads is assumed"),)
    if found is None:
        return None, ()
    network = xodr.load(found.path, strict=strict)
    return network, () if found.remark is None else (found.remark,)


def roads_for(
    scenario: Node,
    road: str,
    road_path: Sequence[str] = (),
    catalog_path: Sequence[str] = (),
    enforce_constraints: bool = True,
) -> RoadFile | None:
    """The road network of a scenario, or else the one that the setting `road` gives; errors as in
    `load_roads`.

    None where there is no LogicFile and no position that needs one.
    """
    logic = logic_file(scenario)
    roads = _own(logic, road, road_path)
    if roads is None and road != "auto":
        roads = _given(scenario, logic, road)
    if roads is None:
        resolved = resolve(
            load(scenario.path), enforce_constraints=enforce_constraints, catalog_path=catalog_path
        )
        roads = _made(resolved.node, logic)
    if roads is None and logic is not None:
        raise logic.invalid(
            "--road auto makes the roads that positions name, and no position of "
            "this scenario names one"
        )
    return roads


def _own(logic: Node | None, road: str | None, road_path: Sequence[str]) -> RoadFile | None:
    """The road network that a LogicFile names; None where there is none, or where another is given
    for one that is missing."""
    if logic is None:
        return None
    try:
        return find_roads(logic, road_path)
    except InvalidFile:
        if road is None or not current().allows(logic.file("filepath")):
            raise
        return None


def _given(scenario: Node, logic: Node | None, road: str) -> RoadFile:
    lacks = (
        "the scenario names no road network"
        if logic is None
        else f"the road network {logic.get('filepath')!r} does not exist"
    )
    return RoadFile(Path(road), (logic or scenario).remark(RULE, f"{lacks}; {road} is taken"))


def _made(scenario: Node, logic: Node | None) -> RoadFile | None:
    """Roads as the positions of a resolved scenario use them, in a file of the cache folder."""
    from xodr.builders.roads_and_ramps import assumed_roads  # imported on demand

    used = road_uses(scenario)
    if not used:
        return None
    content = assumed_roads(used).to_xml()
    path = cache_folder("roads") / f"{hashlib.blake2b(content, digest_size=20).hexdigest()}.xodr"
    _keep(content, path)
    roads = ", ".join(
        f"{road.road_id} ({road.right} + {road.left} lanes, {road.length:g} m)" for road in used
    )
    instead = (
        f"the road network {logic.get('filepath')!r} does not exist"
        if logic is not None
        else "the scenario names no road network"
    )
    remark = (logic or scenario).remark(
        RULE, f"{instead}; straight ones are assumed, not connected: {roads}"
    )
    return RoadFile(path, remark)


def _keep(content: bytes, path: Path) -> None:
    from schemas.common.storage import keep

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        keep(content, path)
    except OSError as error:
        message = (
            f"the cache folder cannot be written ({error.strerror or error}); set XOSC_CACHE_DIR "
            "to another one"
        )
        raise UsageError(message, path=path.parent) from None


def road_uses(scenario: Node) -> list[RoadUse]:
    """The roads that the positions of a resolved scenario name, with the lengths and lanes that
    they need."""
    from xodr.builders.roads_and_ramps import RoadUse

    ends: dict[str, float] = defaultdict(float)
    lanes: dict[str, set[int]] = defaultdict(set)
    for position in scenario.iter("LanePosition", "RoadPosition"):
        road = position.get("roadId")
        ends[road] = max(ends[road], position.float("s"))
        lanes[road].add(
            position.int("laneId")
            if position.tag == "LanePosition"
            else _lane_at(position.float("t"))
        )
    absolute = {target.int("value") for target in scenario.iter("AbsoluteTargetLane")}
    steps = [*(target.int("value") for target in scenario.iter("RelativeTargetLane"))]
    steps += [position.int("dLane") for position in scenario.iter("RelativeLanePosition")]
    reach = max(map(abs, steps), default=0)
    uses = []
    for road in ends:
        right, left = (
            max((side * lane for lane in lanes[road] | absolute if side * lane > 0), default=0)
            for side in (-1, 1)
        )
        if right:
            left, right = max(left, reach - right + 1, 0), right + reach
        else:
            left, right = left + reach, max(reach - left + 1, 0)
        uses.append(RoadUse(road, math.ceil(ends[road] + _AHEAD), right, left))
    return uses


def _lane_at(t: float) -> int:
    number = max(math.ceil(abs(t) / _LANE_WIDTH), 1)
    return number if t > 0.0 else -number
