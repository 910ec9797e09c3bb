"""Scenario and distribution files for tests: two cars one behind the other on
the straight road of the conformance tests.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

ROADS = Path(__file__).parents[1] / "conformance" / "roads"

HEADER = (
    '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="tests" '
    'description="test"/>'
)

SLOW_SYSTEM = """
import os
import time
from runner.systems import Control

class Slow:
    def reset(self, ego, timestep, seed): pass
    def control(self, observation, dt):
        time.sleep(0.02)
        return Control()

class Deadly(Slow):
    def control(self, observation, dt):
        if observation.others[0].x - observation.ego.x == 30.0:
            os._exit(1)
        return Control()
"""
"""Source of systems under test: one takes 20 ms for each step, one also ends its
process where the gap is 30 m
"""


def car(name: str, controller: str = "", performance: str = "") -> str:
    """A ScenarioObject of a car, with an ObjectController where a controller is named."""
    performance = performance or 'maxSpeed="70" maxAcceleration="10" maxDeceleration="10"'
    control = (
        "<ObjectController><Controller "
        f'name="{controller}"><Properties/></Controller></ObjectController>'
    )
    return f"""
    <ScenarioObject name="{name}">
      <Vehicle name="car" vehicleCategory="car">
        <BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" height="1.5"/></BoundingBox>
        <Performance {performance}/>
        <Axles>
          <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
          <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/>
        </Axles>
      </Vehicle>
      {control if controller else ""}
    </ScenarioObject>"""


def speed_action(
    value: object, dynamics: str = 'dynamicsShape="step" dynamicsDimension="time" value="0"'
) -> str:
    """A PrivateAction that brings its actor to an absolute speed (m/s), at once
    unless other dynamics are given.
    """
    return (
        f"<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics {dynamics}/>"
        f'<SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction></PrivateAction>"
    )


def place(entity: str, s: object, speed: object, lane: int = -1, more: str = "") -> str:
    """The Private of Init that puts a car on a lane of road 1, with a speed
    (m/s) and more actions.
    """
    where = f'<LanePosition roadId="1" laneId="{lane}" s="{s}"/>'
    return (
        f'<Private entityRef="{entity}"><PrivateAction><TeleportAction><Position>{where}</Position></TeleportAction>'
        f"</PrivateAction>{speed_action(speed)}{more}</Private>"
    )


def at_time(time: float, name: str = "time") -> str:
    """A Trigger's content: the simulation time (s) has been reached."""
    return (
        f'<ConditionGroup><Condition name="{name}" delay="0" '
        'conditionEdge="none"><ByValueCondition>'
        f'<SimulationTimeCondition value="{time}" '
        'rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>'
    )


def story(actor: str, events: Sequence[tuple[float, str]]) -> str:
    """A Story whose events start an action of the actor at given times (s); each
    action as its PrivateAction element.
    """
    text = "".join(
        f'<Event name="event{n}" priority="parallel"><Action name="action{n}">{action}</Action>'
        f"<StartTrigger>{at_time(time)}</StartTrigger></Event>"
        for n, (time, action) in enumerate(events)
    )
    return (
        '<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">'
        f'<Actors selectTriggeringEntities="false"><EntityRef entityRef="{actor}"/></Actors>'
        f'<Maneuver name="maneuver">{text}</Maneuver></ManeuverGroup>'
        f"<StartTrigger>{at_time(0)}</StartTrigger></Act></Story>"
    )


def scenario(
    folder: Path,
    name: str = "scenario",
    *,
    entities: Sequence[str] = (),
    init: str = "",
    stories: str = "",
    stop: float = 2.0,
    parameters: Mapping[str, float] | None = None,
    road: str = "straight",
) -> Path:
    """Write a scenario beside its road; by default Ego at 20 m/s, 50 m behind
    Lead at 10 m/s, for `stop` seconds.
    """
    values = (
        {"Gap": 50.0, "Ego_Speed": 20.0, "Lead_Speed": 10.0} if parameters is None else parameters
    )
    declared = "".join(
        f'<ParameterDeclaration name="{k}" parameterType="double" value="{v}"/>'
        for k, v in values.items()
    )
    objects = "".join(entities) or car("Ego") + car("Lead")
    start = init or place("Ego", 100, "$Ego_Speed") + place("Lead", "${100 + $Gap}", "$Lead_Speed")
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / f"{road}.xodr").exists():
        shutil.copy(ROADS / f"{road}.xodr", folder)
    path = folder / f"{name}.xosc"
    path.write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  {HEADER}
  <ParameterDeclarations>{declared}</ParameterDeclarations>
  <CatalogLocations/>
  <RoadNetwork><LogicFile filepath="{road}.xodr"/></RoadNetwork>
  <Entities>{objects}</Entities>
  <Storyboard>
    <Init><Actions>{start}</Actions></Init>
    {stories}
    <StopTrigger>{at_time(stop, "end")}</StopTrigger>
  </Storyboard>
</OpenSCENARIO>
""",
        encoding="utf-8",
    )
    return path


def distribution(
    folder: Path, name: str, ranges: Mapping[str, tuple[float, float, float]], of: str = "scenario"
) -> Path:
    """Write a distribution over a scenario in the same folder: parameter → lower
    limit, upper limit, step width.
    """
    inner = "".join(
        "<DeterministicSingleParameterDistribution "
        f'parameterName="{parameter}"><DistributionRange stepWidth="{step}">'
        f'<Range lowerLimit="{low}" '
        f'upperLimit="{high}"/></DistributionRange></DeterministicSingleParameterDistribution>'
        for parameter, (low, high, step) in ranges.items()
    )
    path = folder / f"{name}.xosc"
    path.write_text(
        f"<OpenSCENARIO>{HEADER}<ParameterValueDistribution>"
        f'<ScenarioFile filepath="{of}.xosc"/><Deterministic>{inner}</Deterministic>'
        "</ParameterValueDistribution></OpenSCENARIO>",
        encoding="utf-8",
    )
    return path
