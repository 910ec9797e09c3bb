"""Target `carla`: the part of OpenSCENARIO 1.0 that CARLA's scenario_runner reads, worked out, on
standalone OpenDRIVE roads.

Source: scenario_runner's page on its OpenSCENARIO support and its parser (0.9.16). What it stops
at, leaves out or reads otherwise is refused (`REFUSED`), unless it can be expressed in its own way
(`carla_changes`); `IGNORED` gives remarks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from schemas.common.fates import changed, kept, lost
from xosc.document import Document, load, to_bytes
from xosc.document.carla import is_for_carla
from xosc.document.node import Node
from xosc.exports import DOCUMENT_FIELDS
from xosc.exports.carla.changes import (
    IGNORED,
    REFUSED,
    change,
    change_lanes,
    need_entities,
    need_map,
    settle,
)
from xosc.exports.carla.ways import (
    begin,
    kept_distances,
    no_delays,
    profiles,
    routes,
    steer,
    teleports,
    times,
    trajectories,
)
from xosc.exports.concrete import concrete_scenarios, in_version
from xosc.exports.draft import DEFAULTS, Draft, ExportSettings, Folder
from xosc.exports.omissions import leave_out, omit, refuse, remarks
from xosc.exports.references import take_roads
from xosc.exports.shapes import earlier, in_world, polylines, to_init
from xosc.exports.starts import InitialState, RoadGeometry, as_expected, as_started, starts

TARGETS = {"carla": "the part of 1.0 that CARLA's scenario_runner reads"}
_UNREAD = lost("scenario_runner does not read it")
FATES = {
    "carla": {
        **dict.fromkeys(DOCUMENT_FIELDS, kept()),
        "names and categories": changed("the ego is `hero`"),
        "bounding boxes": lost("scenario_runner does not read it: CARLA's models have their sizes"),
        **dict.fromkeys(("performance", "controllers", "priorities", "edges"), _UNREAD),
        "roles": lost("scenario_runner does not read it: a Property"),
        "properties": changed("with a `type` that tells egos from others"),
        "parameters": changed("values"),
        "expressions": changed("values"),
        "variables": changed("values"),
        "delays": changed("of time alone: the time itself"),
        "end": changed("its times end the acts, and a run ends when all have"),
        "shapes of transitions": lost(
            "scenario_runner does not read it: speeds are its controller's"
        ),
        "followingMode": lost("no attribute before 1.2"),
        "lane changes": changed("relative to the actor, over a distance"),
        "routes": changed("trajectories, or none where the lanes lead that way"),
        "polylines": changed("closer vertices, from the time 0 on"),
        "lights of vehicles": lost("no element before 1.2"),
    }
}
"""Fates of the fields of a scenario"""
_CURVES = ("Clothoid", "ClothoidSpline", "Nurbs")
_POSITIONS = ("RoutePosition", "TrajectoryPosition", "GeoPosition")


def export(
    source: Path, target: str, folder: Folder, settings: ExportSettings = DEFAULTS
) -> Sequence[str]:
    """Write a scenario, or that of a distribution with each set of its parameters, for
    scenario_runner.

    Returns:
        Remarks on what is approximated, or not read.

    Raises:
        Unsupported: scenario_runner can't say it, named with file, line and reason.
        InvalidFile, UsageError: a file can't be read, or not be written.
    """
    document = load(source, strict=settings.strict)
    if document.kind == "catalog":
        return [f"{source}: its entries are part of the scenarios that use them"]
    draft = Draft(folder, settings)
    for name, scenario in concrete_scenarios(source, settings):
        draft.note(*scenario.remarks)
        need_map(scenario, settings.roads(scenario.node))
        if not settings.strict:
            draft.note(*omit(scenario, (1, 0)))
        # After `omit`, which leaves out trailers of no name: they tow nothing.
        need_entities(scenario)
        if settings.locate:
            draft.note(*to_init(scenario))
        geometry = settings.locate(scenario) if settings.locate else None
        known = prepare(scenario, geometry, draft) if geometry else starts(scenario.node)
        # After `prepare`, which says otherwise much of what is refused here.
        refuse(scenario, REFUSED)
        draft.note(*remarks(scenario, IGNORED))
        state = (
            as_expected(scenario.node, known, geometry.during)
            if geometry
            else as_started(scenario.node, known)
        )
        network = take_roads(scenario, draft)
        draft.note(*settle(scenario, network), *change_lanes(scenario, state, network, geometry))
        draft.note(*change(scenario, known, state, network))
        if not is_for_carla(document.node):  # whose delays are scenario_runner's already
            draft.note(*no_delays(scenario, geometry))
        written = in_version(scenario, (1, 0), draft)
        steer(written)
        draft.add(folder.name(scenario.path, f"{name}.xosc"), to_bytes(written))
    return draft.write()


def prepare(scenario: Document, geometry: RoadGeometry, draft: Draft) -> Mapping[str, InitialState]:
    """Replace, in place, what scenario_runner lacks by places and ways on the roads; the initial
    states of all entities.

    Raises:
        Unsupported: a way is not known before the scenario runs.
    """
    known = geometry.starts()
    draft.note(*_controllers(scenario), *earlier(scenario, geometry))
    draft.note(
        *polylines(scenario, geometry, _CURVES, offsets=True, during=geometry.during),
        *in_world(scenario, geometry, _is_read_otherwise),
    )
    draft.note(*routes(scenario, geometry), *begin(scenario, known))
    draft.note(*profiles(scenario, geometry), *kept_distances(scenario, geometry))
    draft.note(*trajectories(scenario, geometry), *teleports(scenario, geometry))
    times(scenario)
    return {**starts(scenario.node), **known}


def _is_read_otherwise(position: Node) -> bool:
    """Whether a position is none of scenario_runner's, or has an offset, orientation or layer,
    which it reads its own way."""
    if position.tag not in ("LanePosition", "RoadPosition"):
        return position.tag in _POSITIONS
    orientation = position.find("Orientation")
    turned = orientation is not None and orientation.get("type", "absolute") != "relative"
    return turned or position.has("layer") or bool(position.float("offset", 0.0))


def _controllers(scenario: Document) -> Iterator[str]:
    for action in list(scenario.node.iter("ActivateControllerAction")):
        yield (
            f"{action.where}: {action.tag}: left out, scenario_runner would "
            "switch CARLA's autopilot"
        )
        leave_out(action, scenario.node)
