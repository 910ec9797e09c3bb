"""Share of crossed borders that the rules find as lane changes, or as entering and leaving by
ramps.

    python benchmarks/crossings.py PATH...

A plain count without thresholds stands against the rules: the lane below a motor vehicle's
reference point becomes the one beside it, and that holds for a second or to the end of the track.
Junctions and roundabouts are left out: their lanes overlap.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition import recordings as datasets
from recognition.labels import Label, LabelledEvent, Rules, label
from recognition.labels.scene import Scene, prepare
from recognition.recordings import cache_roads
from recognition.scenes import LaneRole, site_of
from schemas.common.errors import ToolchainError

_BACK = 1.0
"""Time (s) within which a return undoes a crossing"""
_NEAR = 1.6
"""Greatest time (s) between a crossing and the event that shows it"""
_TO = {True: Label.LANE_CHANGE_LEFT, False: Label.LANE_CHANGE_RIGHT}
_RAMPS = (Label.RAMP_ENTERING, Label.RAMP_EXITING)


class Crossing(NamedTuple):
    """Crossing of a border: vehicle, time (s), direction, and roles of the two lanes."""

    ego: str
    time: float
    left: bool
    kind: str


def main() -> None:
    """Print how many crossings of each kind there are, and how many are found."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("paths", nargs="+", type=Path, help="recordings")
    crossed: Counter[tuple[str, bool]] = Counter()
    found: Counter[tuple[str, bool]] = Counter()
    read = failed = 0
    for source in (
        source for path in arguments.parse_args().paths for source in datasets.open(path).sources
    ):
        try:
            recording = source.load()
            site = site_of(source, recording, cache_roads())
        except ToolchainError as error:
            failed += 1
            print(f"{source.name} was not read: {error}")
            continue
        read += 1
        events = label(recording, site, source.name)
        for crossing in crossings(prepare(recording, site, Rules())):
            key = crossing.kind, crossing.left
            crossed[key] += 1
            found[key] += shown(crossing, events)
    print(f"{read} recordings, {failed} not read")
    for kind in sorted({kind for kind, _ in crossed}):
        print(
            f"{kind}: {share(found, crossed, kind, True)} to the left, "
            f"{share(found, crossed, kind, False)} to the right"
        )
    print(f"all: {found.total()} of {crossed.total()} found")


def share(
    found: Counter[tuple[str, bool]], crossed: Counter[tuple[str, bool]], kind: str, left: bool
) -> str:
    """Format a share with its counts."""
    return f"{found[kind, left]} of {crossed[kind, left]}"


def crossings(scene: Scene) -> Iterator[Crossing]:
    """The borders that egos cross, but those that they cross back at once."""
    steps, back = scene.changes.step, scene.rows(_BACK)
    overlapping = scene.has_role(
        LaneRole.RING, LaneRole.ENTRY, LaneRole.EXIT, LaneRole.INSIDE, LaneRole.SIGNALISED
    )
    ramp = scene.has_role(LaneRole.ON_RAMP, LaneRole.OFF_RAMP, LaneRole.WEAVING)
    main = scene.has_role(LaneRole.MAIN)
    beside = (np.abs(steps) == 1) & scene.egos[scene.track] & ~overlapping
    for row in np.flatnonzero(beside).tolist():
        about = steps[max(row - back, scene.first[row]) : min(row + back, scene.last[row]) + 1]
        if np.count_nonzero(about) == 1 and not overlapping[row - 1]:
            kind = (
                "ramps"
                if ramp[row] != ramp[row - 1]
                else "motorways"
                if main[row]
                else "other roads"
            )
            yield Crossing(
                scene.names[scene.track[row]], float(scene.time[row]), bool(steps[row] > 0), kind
            )


def shown(crossing: Crossing, events: list[LabelledEvent]) -> bool:
    """Whether an event shows a crossing."""
    labels = (_TO[crossing.left], *_RAMPS)
    return any(
        each.ego == crossing.ego
        and each.label in labels
        and abs(each.time - crossing.time) <= _NEAR
        for each in events
    )


if __name__ == "__main__":
    main()
