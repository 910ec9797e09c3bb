"""Exports of documents: OpenSCENARIO in its versions, and profiles of other simulators' readers.

A module with a dict `TARGETS` and `export(source, target, folder, settings)` is found by
`runner.exchange.exports`.

Modules:

- `carla`: Target `carla`: the part of OpenSCENARIO 1.0 that CARLA's scenario_runner reads
- `concrete`: scenarios with everything worked out, and conversion to an older version
- `draft`: the files of an export before they are written, and its folder
- `esmini`: Target `esmini`: scenarios that esmini plays as they are meant
- `omissions`: elements that a version lacks and no motion depends on: left out or rewritten
- `references`: files that a scenario refers to, taken along into the output folder
- `shapes`: positions, trajectories
- `standard`: Targets `1.0` to `1.4`: the same scenarios
- `starts`: initial lanes, speeds and positions of entities, and ways of routes

Example::

    xosc-export scenarios --to 1.2 --out older
"""

DOCUMENT_FIELDS = {
    "names and categories": "of entities",
    "bounding boxes": "",
    "performance": "",
    "roles": "",
    "properties": "of entities",
    "controllers": "`ObjectController`",
    "initial places": "",
    "initial speeds": "",
    "parameters": "",
    "expressions": "",
    "variables": "",
    "stories, acts, groups, events": "names",
    "priorities": "of events",
    "times of triggers": "",
    "distances of triggers": "",
    "edges": "of conditions",
    "delays": "of conditions",
    "end": "`StopTrigger`",
    "shapes of transitions": "",
    "followingMode": "of transitions",
    "lane changes": "",
    "routes": "",
    "polylines": "with times",
    "weather": "",
    "lights of vehicles": "",
}
"""Fields of a scenario, with what is meant; each target of documents declares their fates
(`FATES`)."""
