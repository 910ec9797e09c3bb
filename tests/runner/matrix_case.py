"""A run with a value in each field of exports: linked roads on a projection, signs, lights,
vehicles with roles and lamps.
"""

from __future__ import annotations

from pathlib import Path

import runner

ROAD = """<?xml version="1.0"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="8" name="matrix" version="1" date="2026-01-01T00:00:00" north="0" south="0" east="0" west="0">
    <geoReference><![CDATA[+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs]]></geoReference>
    <offset x="690000" y="5330000" z="500" hdg="{turn}"/>
  </header>
  <road name="a" id="1" length="120" junction="-1">
    <link><successor elementType="road" elementId="2" contactPoint="start"/></link>
    <type s="0" type="town"><speed max="50" unit="km/h"/></type>
    <planView>
      <geometry s="0" x="10" y="20" hdg="0.3" length="60"><arc curvature="0.04"/></geometry>
      <geometry s="60" x="36.47" y="68.9" hdg="2.7" length="60"><line/></geometry>
    </planView>
    <elevationProfile><elevation s="0" a="3" b="0.05" c="0" d="0"/></elevationProfile>
    <lateralProfile><superelevation s="0" a="0.04" b="0" c="0" d="0"/></lateralProfile>
    {lanes}
    <objects>
      <object id="9" type="pole" name="mast" s="30" t="8" zOffset="0" radius="0.2" height="4" orientation="none"/>
    </objects>
    <signals>
      <signal id="7" name="light" s="100" t="-6" zOffset="3" hOffset="0" dynamic="yes" orientation="+" type="1000001"
              subtype="-1" country="OpenDRIVE" value="-1" width="0.4" height="1"/>
      <signal id="8" name="limit" s="20" t="-6" zOffset="2" hOffset="0" dynamic="no" orientation="+" type="274" subtype="-1"
              country="DE" value="50" unit="km/h" width="0.6" height="0.6"/>
    </signals>
  </road>
  <road name="b" id="2" length="80" junction="-1">
    <link><predecessor elementType="road" elementId="1" contactPoint="end"/></link>
    <type s="0" type="rural"/>
    <planView><geometry s="0" x="{x}" y="{y}" hdg="2.7" length="80"><line/></geometry></planView>
    <elevationProfile><elevation s="0" a="9" b="0.05" c="0" d="0"/></elevationProfile>
    <lateralProfile><superelevation s="0" a="0.04" b="0" c="0" d="0"/></lateralProfile>
    {lanes}
  </road>
</OpenDRIVE>"""

_LANES = """<lanes><laneSection s="0">
  <left>{left}</left>
  <center><lane id="0" type="none"><roadMark sOffset="0" type="broken" color="white" width="0.15"/></lane></center>
  <right>{right}</right>
</laneSection></lanes>"""

_LANE = """<lane id="{id}" type="{type}"><link>{link}</link><width sOffset="0" a="{width}" b="0" c="0" d="0"/>
<roadMark sOffset="0" type="solid" color="white" width="0.12"/>{speed}{height}</lane>"""


def _lanes(link: str) -> str:
    def lane(number: int, kind: str, width: float, speed: str = "", height: str = "") -> str:
        return _LANE.format(
            id=number,
            type=kind,
            width=width,
            link=f'<{link} id="{number}"/>',
            speed=speed,
            height=height,
        )

    kerb = '<height sOffset="0" inner="0.15" outer="0.15"/>'
    limit = '<speed sOffset="0" max="30" unit="km/h"/>'
    left = lane(2, "sidewalk", 2.0, height=kerb) + lane(1, "driving", 3.5)
    right = (
        lane(-1, "driving", 3.5)
        + lane(-2, "driving", 3.25, limit)
        + lane(-3, "sidewalk", 1.5, height=kerb)
    )
    return _LANES.format(left=left, right=right)


def road(turn: float = 0.0) -> str:
    """The road file; its header turns coordinates by `turn` (rad)."""
    import math

    k, h = 0.04, 0.3  # where the arc ends, and the line after it
    x, y = (
        10 + (math.sin(h + 60 * k) - math.sin(h)) / k,
        20 - (math.cos(h + 60 * k) - math.cos(h)) / k,
    )
    end = x + 60 * math.cos(2.7), y + 60 * math.sin(2.7)
    text = ROAD.replace('x="36.47" y="68.9"', f'x="{x!r}" y="{y!r}"')
    first, second = text.split("{lanes}", 1)
    text = first + _lanes("successor") + second.replace("{lanes}", _lanes("predecessor"))
    return text.format(turn=turn, x=repr(end[0]), y=repr(end[1]))


_VEHICLE = """<ScenarioObject name="{name}">
  <Vehicle name="{name}" vehicleCategory="{category}" role="{role}" mass="{mass}">
    <BoundingBox><Center x="{x}" y="0" z="0.8"/><Dimensions width="{width}" length="{length}" height="1.6"/></BoundingBox>
    <Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
    <Axles>
      <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="2.9" positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/>
    </Axles><Properties/>
  </Vehicle></ScenarioObject>"""

_SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="tests" description="matrix">
    <Properties><Property name="scenarioClass" value="cut in"/></Properties>
  </FileHeader>
  <CatalogLocations/>
  <RoadNetwork><LogicFile filepath="matrix.xodr"/><TrafficSignals>
    <TrafficSignalController name="c">
      <Phase name="go" duration="0.5"><TrafficSignalState trafficSignalId="7" state="green"/></Phase>
      <Phase name="stop" duration="10"><TrafficSignalState trafficSignalId="7" state="red"/></Phase>
    </TrafficSignalController></TrafficSignals></RoadNetwork>
  <Entities>{entities}</Entities>
  <Storyboard>
    <Init><Actions>{init}</Actions></Init>
    <Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1">
      <Actors selectTriggeringEntities="false"><EntityRef entityRef="Other"/></Actors>
      <Maneuver name="m"><Event name="e" priority="parallel"><Action name="x"><PrivateAction><AppearanceAction>
        <LightStateAction transitionTime="0"><LightType><VehicleLight vehicleLightType="indicatorLeft"/></LightType>
        <LightState mode="flashing"/></LightStateAction></AppearanceAction></PrivateAction></Action>
      <StartTrigger><ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="0.35" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>
      </Event></Maneuver></ManeuverGroup>
      <StartTrigger><ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="-1" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>
    </Act></Story>
    <StopTrigger><ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>
      <SimulationTimeCondition value="0.95" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
  </Storyboard>
</OpenSCENARIO>"""

_PRIVATE = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
<LanePosition roadId="1" laneId="{lane}" s="{s}" offset="0.2"/></Position></TeleportAction></PrivateAction>
<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="2"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>
</Private>"""


def write(folder: Path, turn: float = 0.0) -> Path:
    """Write the files of the case; the scenario's path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "matrix.xodr").write_text(road(turn), encoding="utf-8")
    ego = _VEHICLE.format(
        name="Ego", category="car", role="civil", mass=1500, x=1.4, width=1.9, length=4.7
    )
    other = _VEHICLE.format(
        name="Other", category="van", role="ambulance", mass=2500, x=1.8, width=2.1, length=6.2
    )
    init = _PRIVATE.format(name="Ego", lane=-1, s=10, speed=12) + _PRIVATE.format(
        name="Other", lane=-2, s=40, speed=10
    )
    path = folder / "case.xosc"
    path.write_text(_SCENARIO.format(entities=ego + other, init=init), encoding="utf-8")
    return path


def case(folder: Path) -> runner.RunResult:
    """The run."""
    return runner.run(write(folder), world="kinematic", timestep=0.1, sut="none", ego="Ego")
