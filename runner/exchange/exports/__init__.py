"""Exports for other tools: every module of `xosc.exports` and `runner.exchange.exports` that names
targets is one.

`TARGETS` in such a module is a dict of names and summaries. Its function `export(source, target,
folder, settings)` (of documents, in `xosc.exports`) or `export(result, name, folder)` (of runs,
here; `name` is the run's, see `runner.batch.jobs.Job`) returns remarks on what is changed or left
out, and refuses by name what the target cannot say. What each keeps is listed in docs/exports.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from schemas.common.errors import UsageError
from schemas.common.packages import described
from schemas.common.plugins import installed, load, told


class ExportTarget(NamedTuple):
    """Export target: name, module, whether it needs a run, and summary."""

    name: str
    module: str
    of_run: bool
    summary: str


def find_targets() -> dict[str, ExportTarget]:
    """All targets by name, targets of documents first."""
    return {
        target.name: target for of_run in (False, True) for target in sorted(_in_folder(of_run))
    }


def _in_folder(of_run: bool) -> Iterator[ExportTarget]:
    package = "runner.exchange.exports" if of_run else "xosc.exports"
    for module, targets in described(package, "TARGETS").items():
        for name, summary in targets.items():
            yield ExportTarget(name, f"{package}.{module}", of_run, summary)


TARGETS = find_targets()
"""The toolchain's own targets by name."""
GROUP = "xosc.export"
"""Entry points of installed packages: modules of targets, called by the target's name"""


def target_of(name: str) -> ExportTarget | None:
    """The target of that name, of the toolchain or of an installed package; None where there is
    none.

    A module of a package has `TARGETS` and `export` as one of `runner.exchange.exports` has; with
    `OF_RUN = False` as one of `xosc.exports`.

    Raises:
        UsageError: its module can't be imported, or has no such target; a package takes the name
            of another target; or --untrusted, which loads no code of others.
    """
    entry = installed(GROUP, TARGETS).get(name)
    if name in TARGETS or entry is None:
        return TARGETS.get(name)
    module = load(entry, ("TARGETS", "export"))
    summary = module.TARGETS.get(name)
    if summary is None:
        raise UsageError(f"{told(entry)} has no target of this name in TARGETS")
    return ExportTarget(name, module.__name__, getattr(module, "OF_RUN", True), summary)


def target_lines() -> list[tuple[str, str, str]]:
    """Name, source (a run, the file, a plug-in) and summary of all targets; no
    plug-in is imported.
    """
    own = [
        (target.name, "a run" if target.of_run else "the file", target.summary)
        for target in TARGETS.values()
    ]
    return own + [
        (name, "plug-in", f"of {entry.module}, installed by pip")
        for name, entry in sorted(installed(GROUP, TARGETS).items())
    ]


RUN_FIELDS = {
    "name": "of each participant",
    "kind": "vehicle, pedestrian, miscellaneous",
    "category": "car, truck, …",
    "role": "ambulance, police, …",
    "length and width": "of the box",
    "height of the box": "",
    "box about the reference point": "",
    "front axle": "",
    "mass": "",
    "ego": "which one it is",
    "time": "",
    "position": "x, y at every step",
    "height": "z at every step",
    "heading": "",
    "pitch": "",
    "roll": "",
    "speed": "",
    "acceleration": "",
    "place on the road": "road, lane, s, t",
    "lights": "of vehicles, at every step",
    "events": "",
    "verdict": "",
    "criticality": "",
    "tags": "",
    "projection": "geoReference",
    "offset": "of the header",
    "lane borders": "within 5 cm",
    "road heights": "",
    "lane heights": "",
    "lane types": "",
    "speed limits": "",
    "road marks": "",
    "lane links": "",
    "neighbours": "of lanes",
    "junctions": "",
    "signs": "place, number, value",
    "traffic lights": "place, lanes",
    "light states": "at every step",
    "objects": "of the roads",
}
"""Fields of a run and its roads, with what is meant; each target of runs declares their fates
(`FATES`)."""
