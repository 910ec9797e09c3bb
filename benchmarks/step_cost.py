"""Cost of one step of the interpreter against a bare loop of libsumo: the same moveToXY, step and
read-back.

    python benchmarks/step_cost.py [--steps N] [--timestep S]

Two roads (a motorway, an intersection) with 2, 6 and 20 scripted participants; each changes its
speed all the time and waits for an event that watches another one, some change lanes. The bare loop
moves the same number of participants to the same places on the same network in the same process;
the kinematic world does without SUMO. SUMO drives no one here, so a run would not begin it
(`runner.engine.worlds.sumo`); the interpreter is measured both ways, with SUMO begun at time 0, as
it is where SUMO drives a vehicle, and not. The same steps are done in several rounds, and the least
processor time of each stretch of them counts. Then once more, with SUMO, with a clock around each
part of the step.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import fmean
from time import process_time
from typing import Any, NamedTuple

import libsumo

from runner.engine.storyboard.simulation import Simulation
from runner.judging.execution import open_world, prepare
from xodr.builders import four_way_intersection, straight_highway

COUNTS = (2, 6, 20)
ROUNDS = 8
STRETCH = 50
WORLDS = {"begun": "SUMO begun", "sumo": "SUMO left alone", "kinematic": "kinematic"}


class Start(NamedTuple):
    """Start of an entity, and its speed (m/s)."""

    road: int
    lane: int
    s: float
    speed: float


def motorway(count: int) -> list[Start]:
    """Three lanes, 40 m between rows."""
    return [Start(1, -1 - k % 3, 50.0 + 40.0 * (k // 3), 25.0 + k % 3) for k in range(count)]


def intersection(count: int) -> list[Start]:
    """From all four arms, two lanes each, 30 m between rows."""
    return [Start(1 + k % 4, 1 + k // 4 % 2, 380.0 - 30.0 * (k // 8), 10.0) for k in range(count)]


ROADS = {
    "motorway": (straight_highway(length=8000.0), motorway),
    "intersection": (four_way_intersection(lanes=2, arm=400.0), intersection),
}


# the scenario -------------------------------------------------------------------------------


def _car(name: str) -> str:
    return f"""<ScenarioObject name="{name}"><Vehicle name="car" vehicleCategory="car">
      <BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5"
      height="1.5"/></BoundingBox>
      <Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
      <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="2.8"
      positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0"
      positionZ="0.3"/></Axles></Vehicle>
    </ScenarioObject>"""


def _speed(value: float, seconds: float) -> str:
    shape = (
        f'dynamicsShape="{"sinusoidal" if seconds else "step"}" dynamicsDimension="time" '
        f'value="{seconds}"'
    )
    return f"""<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics {shape}/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget></SpeedAction>
      </LongitudinalAction>
      </PrivateAction>"""


def _condition(name: str, inner: str) -> str:
    return f"""<StartTrigger><ConditionGroup><Condition name="{name}" delay="0"
      conditionEdge="none">{inner}</Condition>
      </ConditionGroup></StartTrigger>"""


def _at(time: float) -> str:
    return (
        f'<ByValueCondition><SimulationTimeCondition value="{time}" '
        'rule="greaterOrEqual"/></ByValueCondition>'
    )


def _near(name: str, other: str) -> str:
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any">
      <EntityRef entityRef="{name}"/>
      </TriggeringEntities><EntityCondition><RelativeDistanceCondition entityRef="{other}"
      value="0.1" freespace="true"
      relativeDistanceType="euclidianDistance" rule="lessThan"/></EntityCondition>
      </ByEntityCondition>"""


def _event(name: str, action: str, trigger: str) -> str:
    begin = f'<Event name="{name}" priority="parallel"><Action name="{name}A">{action}</Action>'
    return f"{begin}{_condition(f'{name}C', trigger)}</Event>"


def _lane_change(lane: int) -> str:
    return f"""<PrivateAction><LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="5"/>
      <LaneChangeTarget><AbsoluteTargetLane value="{lane}"/></LaneChangeTarget></LaneChangeAction>
      </LateralAction>
      </PrivateAction>"""


def _group(number: int, start: Start, count: int) -> str:
    name, other = f"V{number}", f"V{(number + 1) % count}"
    events = _event(f"Speed{number}", _speed(start.speed + 3.0, 100.0), _at(0.0))
    events += _event(f"Watch{number}", _speed(0.0, 3.0), _near(name, other))
    if start.lane == -3:
        events += _event(f"Change{number}", _lane_change(-2), _at(2.0))
    return f"""<ManeuverGroup name="G{number}" maximumExecutionCount="1">
      <Actors selectTriggeringEntities="false">
      <EntityRef entityRef="{name}"/></Actors><Maneuver name="M{number}">{events}</Maneuver>
      </ManeuverGroup>"""


def _private(number: int, start: Start) -> str:
    where = f'<LanePosition roadId="{start.road}" laneId="{start.lane}" s="{start.s}"/>'
    position = f"<Position>{where}</Position>"
    teleport = f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"
    return f'<Private entityRef="V{number}">{teleport}{_speed(start.speed, 0.0)}</Private>'


def write_scenario(folder: Path, road: str, count: int) -> Path:
    """Write road and scenario."""
    built, starts_of = ROADS[road]
    starts = starts_of(count)
    built.write(folder / f"{road}.xodr")
    path = folder / f"{road}{count}.xosc"
    path.write_text(
        f"""<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00"
      author="benchmark" description="cost"/>
    <CatalogLocations/><RoadNetwork><LogicFile filepath="{road}.xodr"/></RoadNetwork>
    <Entities>{"".join(_car(f"V{k}") for k in range(count))}</Entities>
    <Storyboard><Init><Actions>{
            "".join(_private(k, start) for k, start in enumerate(starts))
        }</Actions></Init>
    <Story name="S"><Act name="A">{
            "".join(_group(k, start, count) for k, start in enumerate(starts))
        }
    <StartTrigger/></Act></Story><StopTrigger/></Storyboard></OpenSCENARIO>""",
        encoding="utf-8",
    )
    return path


# the two loops ------------------------------------------------------------------------------

Moves = list[list[tuple[str, float, float, float]]]


def timed(step: Callable[[int], object], steps: int) -> list[float]:
    """Seconds a step, for each stretch of steps; `step` gets their numbers."""
    times = []
    for first in range(0, steps - STRETCH + 1, STRETCH):
        start = process_time()
        for number in range(first, first + STRETCH):
            step(number)
        times.append((process_time() - start) / STRETCH)
    return times


def simulation(path: Path, timestep: float, world: str = "begun") -> Simulation:
    """A simulation that has begun, on a world by its name, or on SUMO that has begun too."""
    sim = Simulation(
        prepare(path).scenario, open_world("sumo" if world == "begun" else world), timestep, 0
    )
    sim.begin()
    if world == "begun":
        sim.world.begin()  # type: ignore[attr-defined]
    return sim


def interpreter(path: Path, steps: int, timestep: float, world: str) -> list[float]:
    """Seconds a step of the whole interpreter, by stretches."""
    sim = simulation(path, timestep, world)
    try:
        return timed(lambda _: sim.tick(), steps)
    finally:
        sim.world.close()


def moves_of(path: Path, steps: int, timestep: float) -> Moves:
    """Return the interpreter's commands to SUMO: id, front bumper and angle of every entity in
    every step."""
    sim = simulation(path, timestep)
    moves: Moves = []
    try:
        for _ in range(steps):
            sim.tick()
            vehicle = libsumo.vehicle
            moves.append(
                [
                    (name, *vehicle.getPosition(name), vehicle.getAngle(name))
                    for name in vehicle.getIDList()
                ]
            )
    finally:
        sim.world.close()
    return moves


def bare(path: Path, moves: Moves, timestep: float) -> list[float]:
    """Seconds a step of libsumo alone, by stretches: the world is opened by the runner, then only
    libsumo is called."""
    sim = simulation(path, timestep)
    vehicle, step = libsumo.vehicle, libsumo.simulationStep
    move, position, angle, speed = (
        vehicle.moveToXY,
        vehicle.getPosition,
        vehicle.getAngle,
        vehicle.getSpeed,
    )

    def once(number: int) -> None:
        for name, x, y, h in moves[number]:
            move(name, "", -1, x, y, h, 6, 3.0)
        step()
        for name, *_ in moves[number]:
            position(name)
            angle(name)
            speed(name)

    try:
        return timed(once, len(moves))
    finally:
        sim.world.close()


# where it goes ------------------------------------------------------------------------------


class Clock:
    """Adds up the time spent in functions, by name."""

    def __init__(self) -> None:
        self.total: dict[str, float] = defaultdict(float)

    def around(self, owner: Any, function: str, name: str) -> None:
        """Replace a method of one object by one that is timed."""
        original: Callable[..., Any] = getattr(owner, function)

        def timed(*args: Any) -> Any:
            start = process_time()
            try:
                return original(*args)
            finally:
                self.total[name] += process_time() - start

        setattr(owner, function, timed)


class _TimedCall:
    """A running action that is timed."""

    def __init__(self, running: Any, clock: Clock) -> None:
        self.stop, self.rest = running.stop, running.rest
        self.step = running.step
        clock.around(self, "step", "actions")


def profile(path: Path, steps: int, timestep: float) -> Iterator[tuple[str, float]]:
    """Seconds a step by part, the largest first. What is left over is the tick itself and the
    clock."""
    sim, clock = simulation(path, timestep), Clock()
    for _ in range(300):  # all actions have started
        sim.tick()
    for owner, function, name in (
        (sim.storyboard, "evaluate", "triggers"),
        (sim, "_move", "motion"),
        (sim.world, "mirror", "mirror"),
        (sim.world, "step", "SUMO step"),
        (sim.contacts, "update", "contacts"),
        (sim.recorder, "record", "recording"),
    ):
        clock.around(owner, function, name)
    for process in sim.processes:
        process.running = _TimedCall(process.running, clock)
    try:
        start = process_time()
        for _ in range(steps):
            sim.tick()
        whole = process_time() - start
    finally:
        sim.world.close()
    yield from sorted(
        ((name, spent / steps) for name, spent in clock.total.items()), key=lambda item: -item[1]
    )
    yield "rest", (whole - math.fsum(clock.total.values())) / steps


def main() -> None:
    """Print costs, ratios and profiles."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--steps", type=int, default=1000)
    arguments.add_argument("--timestep", type=float, default=0.01, help="s")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for road in ROADS:
            for count in COUNTS:
                path = write_scenario(Path(folder), road, count)
                moves = moves_of(path, options.steps, options.timestep)
                rounds = [
                    (
                        *(
                            interpreter(path, options.steps, options.timestep, world)
                            for world in WORLDS
                        ),
                        bare(path, moves, options.timestep),
                    )
                    for _ in range(ROUNDS)
                ]
                *ours, bared = (
                    fmean(map(min, zip(*column, strict=True))) * 1e6
                    for column in zip(*rounds, strict=True)
                )
                costs = (
                    f"{name} {cost:5.1f} µs ({cost / bared:.2f})"
                    for name, cost in zip(WORLDS.values(), ours, strict=True)
                )
                print(
                    f"{road:<12} {count:>2}: {', '.join(costs)}, bare libsumo {bared:5.1f} µs",
                    flush=True,
                )
                parts = profile(path, options.steps // 2, options.timestep)
                print("    " + ", ".join(f"{name} {spent * 1e6:.1f}" for name, spent in parts))


if __name__ == "__main__":
    main()
