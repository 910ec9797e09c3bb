"""Remove parts that a later version made optional, or that a repair supplies: no trajectory
changes.

    python -m benchmarks.optional_parts FOLDER... [--road-path DIR] [--sample N] [--seed N]

A part is an element, or an attribute, that the declared version of a file requires. Each kind of
part is tried in each file that has it, in two copies: in one the parts of that kind are removed, in
the other they have the form that says the same as absence (`NEUTRAL`), or stay as they are where
they say nothing about motion (`SILENT`). Both copies play alike: the same places at the same times
until the earlier end, or the same refusal. Kinds in neither table have no such form (`FORMLESS`).

Runs are those of the kinematic world, without a system under test. Exit code: 0 all alike, 1 not.
"""

from __future__ import annotations

import copy
import random
import re
import sys
import tempfile
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from lxml import etree

import runner
from benchmarks.corpora_diff import scenarios
from schemas.common.errors import ToolchainError
from schemas.common.xml import parse
from xosc.document import VERSIONS, load
from xosc.document.node import Node
from xosc.document.repairs.attributes import attributes, content
from xosc.document.repairs.revisions import claimed, is_valid

Version = tuple[int, int]
Part = tuple[str, str]
"""Names of an element and of a child; the name of an attribute begins with `@`"""

AT_ONCE = """<StartTrigger><ConditionGroup><Condition name="always" delay="0" conditionEdge="none">
<ByValueCondition><SimulationTimeCondition value="-1" rule="greaterThan"/></ByValueCondition>
</Condition></ConditionGroup></StartTrigger>"""

NEUTRAL: dict[Part, str] = {
    ("Act", "StartTrigger"): AT_ONCE,
    ("Event", "StartTrigger"): AT_ONCE,
    ("Storyboard", "StopTrigger"): "<StopTrigger/>",
    ("Storyboard", "Init"): "<Init><Actions/></Init>",
    ("Init", "Actions"): "<Actions/>",
    ("ManeuverGroup", "Actors"): '<Actors selectTriggeringEntities="false"/>',
    ("SpeedAction", "SpeedActionDynamics"): "<SpeedActionDynamics dynamicsShape='step' "
    "value='0' dynamicsDimension='time'/>",
    ("FollowTrajectoryAction", "TimeReference"): "<TimeReference><None/></TimeReference>",
    ("FollowTrajectoryAction", "TrajectoryFollowingMode"): "<TrajectoryFollowingMode "
    "followingMode='position'/>",
    ("OpenSCENARIO", "CatalogLocations"): "<CatalogLocations/>",
    ("OpenSCENARIO", "RoadNetwork"): "<RoadNetwork/>",
    ("FileHeader", "@description"): "",
    ("Condition", "@delay"): "0",
    ("Condition", "@conditionEdge"): "none",
    ("RelativeObjectPosition", "@dx"): "0",
    ("RelativeObjectPosition", "@dy"): "0",
    ("RelativeWorldPosition", "@dx"): "0",
    ("RelativeWorldPosition", "@dy"): "0",
    ("RelativeRoadPosition", "@ds"): "0",
    ("RelativeRoadPosition", "@dt"): "0",
    ("RelativeLanePosition", "@dLane"): "0",
    ("RoadPosition", "@t"): "0",
    ("FromRoadCoordinates", "@t"): "0",
    ("Center", "@x"): "0",
    ("Center", "@y"): "0",
    ("Center", "@z"): "0",
    ("Timing", "@offset"): "0",
    ("Timing", "@scale"): "1",
    ("ManeuverGroup", "@maximumExecutionCount"): "1",
    ("Performance", "@maxSpeed"): "INF",
    ("Performance", "@maxAcceleration"): "INF",
    ("Performance", "@maxDeceleration"): "INF",
    ("SpeedActionDynamics", "@dynamicsDimension"): "time",
    ("LaneChangeActionDynamics", "@dynamicsDimension"): "time",
    ("RelativeTargetSpeed", "@speedTargetValueType"): "delta",
    ("TriggeringEntities", "@triggeringEntitiesRule"): "any",
    ("TrajectoryFollowingMode", "@followingMode"): "position",
    ("SpeedProfileAction", "@followingMode"): "position",
    ("Actors", "@selectTriggeringEntities"): "false",
    ("Route", "@closed"): "false",
    ("Trajectory", "@closed"): "false",
    ("TimeOfDay", "@animation"): "false",
    **{
        (f"{name}Condition", f"@{flag}"): "false"
        for name in ("Distance", "RelativeDistance", "TimeHeadway", "TimeToCollision")
        for flag in ("freespace", "alongRoute")
    },
    **{
        (f"{name}DistanceAction", f"@{flag}"): "false"
        for name in ("Lateral", "Longitudinal")
        for flag in ("freespace", "continuous")
    },
    ("LaneOffsetAction", "@continuous"): "false",
    ("RelativeTargetSpeed", "@continuous"): "false",
}
"""Forms that say the same as absence."""

SILENT: frozenset[Part] = frozenset(
    {
        *((name, "Properties") for name in ("Vehicle", "Pedestrian", "MiscObject", "Controller")),
        *(("Environment", name) for name in ("RoadCondition", "TimeOfDay", "Weather")),
        *(("Weather", name) for name in ("Fog", "Precipitation", "Sun", "@cloudState")),
        ("Pedestrian", "@model"),
        ("Pedestrian", "@mass"),
        ("MiscObject", "@mass"),
        ("MiscObject", "@miscObjectCategory"),
        ("Precipitation", "@intensity"),
        ("Sun", "@intensity"),
        *(("FileHeader", f"@{name}") for name in ("author", "date")),
        *((name, "@name") for name in ("Trajectory", "Route", "Environment")),
        *(("VisibilityAction", f"@{name}") for name in ("graphics", "traffic", "sensors")),
    }
)
"""Parts that say nothing about motion."""

FORMLESS: dict[Part, str] = {
    ("Axles", "FrontAxle"): "trailers without one are tracked by their rear axle alone",
    ("GeoPosition", "@latitude"): "renamed",
    ("GeoPosition", "@longitude"): "renamed",
    ("RelativeLanePosition", "@ds"): "one of two attributes since",
    ("Vertex", "@time"): "its absence is untimed, which no number says",
    ("Clothoid", "@curvatureDot"): "renamed",
    ("Storyboard", "Story"): "a storyboard without stories ends at once or never",
    ("ControllerAction", "AssignControllerAction"): "the absent one is not assigned",
    ("ControllerAction", "OverrideControllerValueAction"): "the absent one is not overridden",
    **{
        ("OverrideControllerValueAction", name): "the absent one is not overridden"
        for name in ("Brake", "Clutch", "Gear", "ParkingBrake", "SteeringWheel", "Throttle")
    },
    **dict.fromkeys(
        (("Brake", "@value"), ("ParkingBrake", "@value"), ("Gear", "@number")), "the driver decides"
    ),
    ("TrafficSourceAction", "TrafficDefinition"): "renamed",
    ("TrafficSwarmAction", "TrafficDefinition"): "renamed",
}
"""Parts without such a form, and why."""

STEP, LONGEST = 0.05, 20.0
"""Step and greatest length of runs (s)"""
_LEVELS = 4
"""Folders above a file that its references may lead up to"""
SAME = 1e-6
"""Distance (m) that is rounding"""


@dataclass(frozen=True)
class Case:
    """A file, and a kind of part that it has."""

    path: Path
    part: Part

    def __str__(self) -> str:
        return f"{self.path.name}: {'/'.join(self.part)}"


@cache
def later_optional(version: Version) -> frozenset[Part]:
    """Parts that a version requires and a later one does not."""
    found = set()
    for later in VERSIONS[VERSIONS.index(version) + 1 :]:
        for read, mark in ((content, ""), (attributes, "@")):
            for tag, declared in read(version).items():
                after = read(later).get(tag, {})
                found |= {
                    (tag, mark + name)
                    for name, each in declared.items()
                    if each.required and name in after and not after[name].required
                }
    return frozenset(found)


@cache
def required(version: Version) -> frozenset[Part]:
    """Parts that a version requires."""
    return frozenset(
        (tag, mark + name)
        for read, mark in ((content, ""), (attributes, "@"))
        for tag, declared in read(version).items()
        for name, each in declared.items()
        if each.required
    )


def cases(paths: Sequence[Path]) -> Iterator[Case]:
    """Valid scenario files with each kind of part that can be removed."""
    for path in paths:
        try:
            document = load(path)
        except ToolchainError:
            continue
        root = parse(path).getroot()
        node = Node(root, path)
        version = claimed(node)
        if document.kind != "scenario" or version not in VERSIONS or not is_valid(node, version):
            continue
        tried = (NEUTRAL.keys() | SILENT) & (required(version) | later_optional(version))
        yield from (Case(path, part) for part in sorted(tried) if next(parts(root, part), None))


def parts(root: etree._Element, part: Part) -> Iterator[tuple[etree._Element, str]]:
    """Elements that hold a part, with its name."""
    tag, name = part
    for element in root.iter(tag):
        if element.get(name[1:]) is not None if name[0] == "@" else element.find(name) is not None:
            yield element, name


def copies(case: Case, folder: Path) -> tuple[Path, Path]:
    """Write both copies: the parts in the form of absence, and absent."""
    tree, beside = parse(case.path), _mirrored(case.path, folder)
    written = []
    for removed in (False, True):
        changed = copy.deepcopy(tree)
        for holder, name in list(parts(changed.getroot(), case.part)):
            _change(holder, name, NEUTRAL.get(case.part), removed)
        target = beside / f"{'removed' if removed else 'neutral'}.xosc"
        target.write_bytes(etree.tostring(changed, xml_declaration=True, encoding="UTF-8"))
        written.append(target)
    return written[0], written[1]


def _mirrored(path: Path, folder: Path) -> Path:
    """Link what relative references of a file may lead to; return the folder for copies of it."""
    chain = [*reversed(path.resolve().parents[:_LEVELS]), path.resolve()]
    here = folder
    for outer, inner in pairwise(chain):
        for other in outer.iterdir():
            if other.name != inner.name:
                (here / other.name).symlink_to(other)
        if inner.is_dir():
            here = here / inner.name
            here.mkdir()
    return here


def _change(holder: etree._Element, name: str, neutral: str | None, removed: bool) -> None:
    if name[0] == "@":
        if removed:
            del holder.attrib[name[1:]]
        elif neutral is not None:
            holder.set(name[1:], neutral)
        return
    for child in holder.findall(name):
        if not removed and neutral is not None:
            holder.replace(child, etree.fromstring(neutral))
        elif removed:
            holder.remove(child)


def difference(case: Case, road_path: Sequence[Path] = ()) -> str:
    """Return the difference between the runs of both copies; "" where there is none."""
    with tempfile.TemporaryDirectory() as folder:
        one, other = (_played(path, road_path) for path in copies(case, Path(folder)))
    if isinstance(one, str) or isinstance(other, str):
        texts = [each if isinstance(each, str) else "plays" for each in (one, other)]
        return "" if texts[0] == texts[1] else " / ".join(texts)
    if one.recording.tracks.keys() != other.recording.tracks.keys():
        return f"entities {sorted(one.recording.tracks.keys() ^ other.recording.tracks.keys())}"
    worst, told = SAME, ""
    for name, track in one.recording.tracks.items():
        mine, theirs = track.columns, other.recording.tracks[name].columns
        end = min(one.end_time, other.end_time) + 1e-6
        times = [columns["time"][columns["time"] <= end] for columns in (mine, theirs)]
        if not np.array_equal(*times):
            return f"{name} is there at other times"
        for axis in ("x", "y", "z"):
            gap = np.abs(mine[axis][: len(times[0])] - theirs[axis][: len(times[0])])
            if gap.size and gap.max() > worst:
                worst = float(gap.max())
                told = f"{name}: {worst:.3f} m in {axis} at {times[0][gap.argmax()]:.2f} s"
    return told


def _played(path: Path, road_path: Sequence[Path]) -> runner.RunResult | str:
    try:
        return runner.run(
            path,
            timestep=STEP,
            sut=None,
            world="kinematic",
            max_time=LONGEST,
            road_path=road_path,
        )
    except ToolchainError as error:
        return re.sub(r"^.*\.xosc:\d+: ", "", str(error)).replace(path.name, "")
    except Exception as error:  # any other error is a finding, and the rest is still to be tried
        return f"internal error: {error!r} in {path.name}"


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--road-path", action="append", default=[], type=Path)
    parser.add_argument("--sample", type=int, help="number of drawn cases; all by default")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    chosen = list(cases(scenarios(arguments.folders)))
    total = len(chosen)
    if arguments.sample is not None:
        chosen = random.Random(arguments.seed).sample(chosen, min(arguments.sample, total))
    changed = 0
    for case in chosen:
        told = difference(case, arguments.road_path)
        if told:
            changed += 1
            print(f"{case}: {told}", flush=True)
    print(f"{len(chosen)} of {total} cases, {changed} change a trajectory")
    sys.exit(min(changed, 1))


if __name__ == "__main__":
    main()
