"""Growth of the cost of a step with the participants and events of scripted traffic, side by side
with a bare loop of libsumo.

    python -m benchmarks.traffic [--steps N] [--counts 10,60,300,1000]

A motorway of five lanes. Each participant has six events, of which two wait for the distance of the
next one ahead and four for a time; they change lanes and speeds. Steps are of 0.01 s. The bare loop
moves the same participants to the same places. Processor times; the least of three rounds of each
stretch of steps.

For comparison (measured elsewhere, not by this script): esmini 3.6.0 needs 0.08 ms a step for 60
such participants on a machine where this runner needed 0.52 ms (kinematic) and 1.72 ms (SUMO)
before triggers could be dormant.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from random import Random
from statistics import fmean

from benchmarks.step_cost import (
    _at,
    _car,
    _event,
    _lane_change,
    _speed,
    bare,
    interpreter,
    moves_of,
)
from xodr.builders import straight_highway

LANES = 5
TIMESTEP = 0.01
ROUNDS = 3
EVENTS = 6


def _distance(name: str, other: str, value: float) -> str:
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any">
      <EntityRef entityRef="{name}"/>
      </TriggeringEntities><EntityCondition><RelativeDistanceCondition entityRef="{other}"
      value="{value}" freespace="false"
      relativeDistanceType="longitudinal" coordinateSystem="road" rule="lessThan"/>
      </EntityCondition></ByEntityCondition>"""


def _group(number: int, count: int, random: Random) -> str:
    events = ""
    for index in range(EVENTS):
        action = (
            _speed(random.randint(18, 33), 4.0)
            if index % 2
            else _lane_change(-random.randint(1, LANES))
        )
        time = round(0.1 + 60.0 * (index + random.random()) / EVENTS, 2)
        trigger = (
            _at(time)
            if index % 3
            else _distance(f"V{number}", f"V{(number + LANES) % count}", 10.0 + 5.0 * index)
        )
        events += _event(f"E{number}_{index}", action, trigger)
    return f"""<ManeuverGroup name="G{number}" maximumExecutionCount="1">
      <Actors selectTriggeringEntities="false">
      <EntityRef entityRef="V{number}"/></Actors><Maneuver name="M{number}">{events}</Maneuver>
      </ManeuverGroup>"""


def write_traffic(folder: Path, count: int) -> Path:
    """Write the road and the scenario of some participants, the same each time."""
    random = Random(1)
    straight_highway(length=40.0 * (count // LANES) + 3000.0, lanes=LANES).write(
        folder / "road.xodr"
    )
    privates = ""
    for number in range(count):
        where = (
            f'<LanePosition roadId="1" laneId="{-1 - number % LANES}" '
            f's="{50.0 + 40.0 * (number // LANES)}"/>'
        )
        position = f"<Position>{where}</Position>"
        teleport = f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"
        speed = _speed(25.0 + number * 7 % 5, 0.0)
        privates += f'<Private entityRef="V{number}">{teleport}{speed}</Private>'
    path = folder / f"traffic{count}.xosc"
    path.write_text(
        f"""<OpenSCENARIO>
    <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="benchmark"
    description="traffic"/>
    <CatalogLocations/><RoadNetwork><LogicFile filepath="road.xodr"/></RoadNetwork>
    <Entities>{"".join(_car(f"V{number}") for number in range(count))}</Entities>
    <Storyboard><Init><Actions>{privates}</Actions></Init>
    <Story name="S"><Act name="A">{
            "".join(_group(number, count, random) for number in range(count))
        }
    <StartTrigger/></Act></Story><StopTrigger/></Storyboard></OpenSCENARIO>""",
        encoding="utf-8",
    )
    return path


def main() -> None:
    """Print a line for each number of participants."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--counts", default="10,60,300,1000")
    given = parser.parse_args()
    print(
        "participants  events  kinematic ms/step  µs/participant  SUMO ms/step  bare libsumo "
        "ms/step  SUMO/bare"
    )
    for count in map(int, given.counts.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            path = write_traffic(Path(folder), count)
            kinematic, sumo = (
                fmean(
                    map(
                        min,
                        *(interpreter(path, given.steps, TIMESTEP, world) for _ in range(ROUNDS)),
                    )
                )
                for world in ("kinematic", "sumo")
            )
            steps = min(given.steps, 100)
            alone = fmean(bare(path, moves_of(path, steps, TIMESTEP), TIMESTEP))
        print(
            f"{count:12d} {EVENTS * count:7d} {1e3 * kinematic:18.3f} "
            f"{1e6 * kinematic / count:15.2f} "
            f"{1e3 * sumo:13.3f} {1e3 * alone:21.3f} {sumo / alone:10.2f}"
        )


if __name__ == "__main__":
    main()
