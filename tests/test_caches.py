"""Caches of the product: each names its key and the reason why an entry can't be stale.

A cache that is not in `CACHES` fails here. `cached_property` is allowed anywhere: its key is an
object, and it ends with it.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation", "xosc_toolchain")
PROGRAM = "program"
"""Key: names of modules, types or versions. The entry is a fact about installed
code, which a process does not change.
"""
VALUE = "value"
"""Key: all inputs of a pure function."""
FILE = "file"
"""Key: path and stamp (time of change, size, inode). A changed file has another
stamp, so that it is read again.
"""
OBJECT = "object"
"""Key: an object that does not change once it is built. The size is bounded, so
that a cache does not keep all of them.
"""
INPUTS = "inputs"
"""Key: paths that one command reads. They are read once per process; a command
does not read what it has written.
"""
CACHES = {
    "recognition.catalogue.pipeline._material": OBJECT,
    "recognition.catalogue.pipeline.recorded": INPUTS,
    "recognition.catalogue.recordings._loaded": FILE,
    "recognition.catalogue.writing.replay._entry": VALUE,
    "recognition.catalogue.writing.replay._form": VALUE,
    "recognition.recordings.formats.commonroad._archive": FILE,
    "recognition.recordings.formats.interaction._cases": FILE,
    "recognition.recordings.formats.ngsim._public": FILE,
    "recognition.recordings.formats.nuscenes._document": FILE,
    "recognition.recordings.formats.nuscenes._table": FILE,
    "recognition.recordings.formats.osi._trace": FILE,
    "recognition.recordings.formats.waymo_records._scene": FILE,
    "recognition.recordings.formats.waymo_records._tables": VALUE,
    "recognition.recordings.road_sources._code": PROGRAM,
    "recognition.recordings.road_sources._converted": FILE,
    "recognition.trfe.inputs.grids.picture": OBJECT,
    "recognition.recordings.source.by_name": INPUTS,
    "recognition.recordings.source.listed": INPUTS,
    "recognition.recordings.source.opened": INPUTS,
    "recognition.scenes.lanes.graph": OBJECT,
    "recognition.trfe.inputs.tokens._ways": OBJECT,
    "runner.view.assessment._declared": INPUTS,
    "runner.batch.inputs._by_stamp": FILE,
    "runner.batch.inputs.program": PROGRAM,
    "runner.batch.inputs._referred": FILE,
    "runner.judging.criteria.criterion._of_plugins": PROGRAM,
    "runner.judging.criteria.criterion._own": PROGRAM,
    "xodr.lookup.lanelets.lanelets": OBJECT,
    "runner.judging.measures.measure._formula": VALUE,
    "runner.judging.measures.measure._of_plugins": PROGRAM,
    "runner.judging.measures.measure._own": PROGRAM,
    "runner.judging.measures.relations.common": OBJECT,
    "runner.judging.measures.relations.joined": OBJECT,
    "runner.engine.motion.nurbs.sampled": VALUE,
    "runner.engine.motion.trajectories._bent": VALUE,
    "runner.systems.outside.fmi._described": FILE,
    "runner.engine.positions.world._projection": OBJECT,
    "runner.view.replay.frames._font": PROGRAM,
    "runner.systems._installed": PROGRAM,
    "runner.systems._own": PROGRAM,
    "runner.engine.worlds.traffic.places_of": OBJECT,
    "schemas.catalogs._catalog": FILE,
    "schemas.checks.registry.all_rules": PROGRAM,
    "schemas.checks.road_references._read": FILE,
    "schemas.common.plugins._declared": PROGRAM,
    "schemas.common.packages.described": PROGRAM,
    "schemas.common.packages.names": PROGRAM,
    "schemas.common.terminal.files.shipped": PROGRAM,
    "schemas.common.terminal.files.shipped_roads": PROGRAM,
    "schemas.expressions.parse": VALUE,
    "schemas.checks.osi._concerned": PROGRAM,
    "schemas.checks.osi._rules": PROGRAM,
    "schemas.checks.osi.all_osi_rules": PROGRAM,
    "schemas.common.packages.version": PROGRAM,
    "schemas.versions.registry._schemas": PROGRAM,
    "schemas.versions.differences.known_differences": PROGRAM,
    "schemas.validate._compiled": PROGRAM,
    "schemas.validate._explainer": PROGRAM,
    "schemas.expressions.values.number": VALUE,
    "xodr.lookup.placing._parts": OBJECT,
    "xodr.reader.document._load": FILE,
    "xodr.formats.sumo_net.building._build": FILE,
    "xodr.formats.sumo_net.building.sumo_home": PROGRAM,
    "xosc.distributions.values._plugin": PROGRAM,
    "xosc.document._load": FILE,
    "xosc.writing.maneuvers.entities._place": VALUE,
    "xosc.writing.maneuvers.entities.enum_value": PROGRAM,
    "xosc.writing.maneuvers.files._around_trajectories": VALUE,
    "xosc.document.node._path": VALUE,
    "xosc.document.repairs.attributes._similar": VALUE,
    "xosc.document.repairs.attributes.attributes": PROGRAM,
    "xosc.document.repairs.attributes.children": PROGRAM,
    "xosc.document.repairs.attributes.content": PROGRAM,
    "xosc.document.repairs.attributes.is_standard": PROGRAM,
    "xosc.document.repairs.attributes.names": PROGRAM,
}
"""Kind of each cached function."""
STAMPED = ("Stamp", "version")
"""Parts of a parameter's declaration by which a file's state is in the key."""


@cache
def cached() -> dict[str, tuple[str, str]]:
    """Return parameters and decorator of each cached function, by the function's full name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            source = path.read_text("utf-8")
            if "cache" not in source:
                continue
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(
                ".__init__"
            )
            for node in ast.walk(ast.parse(source)):
                for each in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
                    text = ast.unparse(each)
                    if "cache" in text and "cached_property" not in text:
                        assert isinstance(node, ast.FunctionDef)
                        found[f"{module}.{node.name}"] = ast.unparse(node.args), text
    return found


def test_each_cache_names_its_key() -> None:
    assert sorted(cached()) == sorted(CACHES)


def test_files_are_keyed_by_their_state_and_objects_are_not_all_kept() -> None:
    for name, (parameters, decorator) in cached().items():
        if CACHES[name] == FILE:
            assert any(each in parameters for each in STAMPED), name
        if CACHES[name] in (OBJECT, FILE):
            assert "maxsize" in decorator, name
