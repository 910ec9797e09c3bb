"""Exports for other tools: the registry of targets by name.

A target of documents is a module with `export(source, target, folder)`; a target of runs one with
`export(result, name, folder)`, where `name` is the run's (see `runner.batch.jobs.Job`). Both return remarks on what is
changed or left out, and refuse by name what the target cannot say. What each keeps is told in docs/exports.md.
"""

from __future__ import annotations

from typing import NamedTuple


class Target(NamedTuple):
    """A target: its name, the module that writes it, whether that needs a run, and what it is."""

    name: str
    module: str
    of_run: bool
    summary: str


_ALL = (
    *(Target(version, "xosc.exports.standard", False, f"OpenSCENARIO XML {version}") for version in ("1.0", "1.1", "1.2", "1.3")),
    Target("carla", "xosc.exports.carla", False, "the part of 1.0 that CARLA's scenario_runner reads"),
    Target("esmini", "xosc.exports.esmini", False, "scenarios that esmini plays as they are meant"),
    Target("commonroad", "runner.exports.commonroad", True, "CommonRoad 2020a XML: lanelets, obstacles, planning problem"),
    Target("sumo", "runner.exports.sumo", True, "SUMO: network, routes, and the run as FCD"),
    Target("openlabel", "runner.exports.openlabel", True, "ASAM OpenLABEL JSON: tags, and everyone's box in every frame"),
    Target("parquet", "runner.exports.parquet", True, "Parquet tables of trajectories, criticality and tags"),
    Target("osi", "runner.exports.osi", True, "ASAM OSI ground-truth traces, .osi and .mcap"),
)

TARGETS = {target.name: target for target in _ALL}
"""All targets by name."""
