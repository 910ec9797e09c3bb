"""A small sound project, scenario with road network, catalogue and distribution,
that the tests break in one place.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from schemas import Problem, check

ROAD = """<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="7" name="straight" version="1.00" date="2024-03-01T12:00:00">
    <geoReference>+proj=utm +zone=32 +ellps=WGS84 +units=m</geoReference>
  </header>
  <road name="first" length="100" id="1" junction="-1">
    <link>
      <successor elementType="road" elementId="2" contactPoint="start"/>
    </link>
    <planView>
      <geometry s="0" x="0" y="0" hdg="0" length="60"><line/></geometry>
      <geometry s="60" x="60" y="0" hdg="0" length="40"><spiral curvStart="0" curvEnd="0"/></geometry>
    </planView>
    <lanes>
      <laneSection s="0">
        <center><lane id="0" type="none" level="false"/></center>
        <right>
          <lane id="-1" type="driving" level="false">
            <link><successor id="-1"/></link>
            <width sOffset="0" a="3.5" b="0" c="0" d="0"/>
          </lane>
          <lane id="-2" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
      <laneSection s="50">
        <center><lane id="0" type="none" level="false"/></center>
        <right>
          <lane id="-1" type="driving" level="false"><link><predecessor id="-1"/></link>
            <width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
    </lanes>
    <signals>
      <signal s="80" t="-5" id="11" dynamic="yes" orientation="+" zOffset="0" type="1000001" subtype="-1" value="-1"/>
      <signal s="81" t="-5" id="12" dynamic="yes" orientation="+" zOffset="0" type="1000001" subtype="-1" value="-1"/>
    </signals>
  </road>
  <road name="second" length="50" id="2" junction="-1">
    <planView>
      <geometry s="0" x="100" y="0" hdg="0" length="50"><line/></geometry>
    </planView>
    <lanes>
      <laneSection s="0">
        <center><lane id="0" type="none" level="false"/></center>
        <right>
          <lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"""

CATALOG = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-03-01T12:00:00" description="vehicles" author="tests"/>
  <Catalog name="Vehicles">
    <Vehicle name="car" vehicleCategory="car">
      <ParameterDeclarations>
        <ParameterDeclaration name="topSpeed" parameterType="double" value="50"/>
      </ParameterDeclarations>
      <BoundingBox>
        <Center x="1.4" y="0" z="0.9"/>
        <Dimensions width="2" length="5" height="1.8"/>
      </BoundingBox>
      <Performance maxSpeed="$topSpeed" maxAcceleration="10" maxDeceleration="10"/>
      <Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3.1" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/>
      </Axles>
      <Properties/>
    </Vehicle>
    <Vehicle name="van" vehicleCategory="van">
      <BoundingBox>
        <Center x="1.4" y="0" z="0.9"/>
        <Dimensions width="2" length="5" height="1.8"/>
      </BoundingBox>
      <Performance maxSpeed="40" maxAcceleration="10" maxDeceleration="10"/>
      <Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3.1" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/>
      </Axles>
      <Properties/>
    </Vehicle>
  </Catalog>
</OpenSCENARIO>
"""

SCENARIO = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-03-01T12:00:00" description="sound" author="tests"/>
  <ParameterDeclarations>
    <ParameterDeclaration name="speed" parameterType="double" value="20">
      <ConstraintGroup>
        <ValueConstraint rule="lessThan" value="5"/>
      </ConstraintGroup>
      <ConstraintGroup>
        <ValueConstraint rule="greaterOrEqual" value="10"/>
        <ValueConstraint rule="lessOrEqual" value="30"/>
      </ConstraintGroup>
    </ParameterDeclaration>
    <ParameterDeclaration name="twice" parameterType="double" value="${2 * $speed}"/>
    <ParameterDeclaration name="lane" parameterType="string" value="-1"/>
    <ParameterDeclaration name="wet" parameterType="boolean" value="true"/>
  </ParameterDeclarations>
  <VariableDeclarations>
    <VariableDeclaration name="count" variableType="int" value="0"/>
  </VariableDeclarations>
  <MonitorDeclarations>
    <MonitorDeclaration name="seen" value="false"/>
  </MonitorDeclarations>
  <CatalogLocations>
    <VehicleCatalog>
      <Directory path="catalogs"/>
    </VehicleCatalog>
  </CatalogLocations>
  <RoadNetwork>
    <LogicFile filepath="road.xodr"/>
    <TrafficSignals>
      <TrafficSignalController name="north">
        <Phase name="go" duration="10">
          <TrafficSignalState trafficSignalId="11" state="green"/>
        </Phase>
      </TrafficSignalController>
      <TrafficSignalController name="south" delay="5" reference="north">
        <Phase name="stop" duration="10"/>
      </TrafficSignalController>
    </TrafficSignals>
  </RoadNetwork>
  <Entities>
    <ScenarioObject name="Ego">
      <CatalogReference catalogName="Vehicles" entryName="car">
        <ParameterAssignments>
          <ParameterAssignment parameterRef="topSpeed" value="60"/>
        </ParameterAssignments>
      </CatalogReference>
      <ObjectController name="driver">
        <Controller name="default">
          <Properties/>
        </Controller>
      </ObjectController>
    </ScenarioObject>
    <ScenarioObject name="Target">
      <CatalogReference catalogName="Vehicles" entryName="van"/>
    </ScenarioObject>
    <EntitySelection name="all">
      <Members>
        <EntityRef entityRef="Ego"/>
        <EntityRef entityRef="Target"/>
      </Members>
    </EntitySelection>
  </Entities>
  <Storyboard>
    <Init>
      <Actions>
        <Private entityRef="Ego">
          <PrivateAction>
            <TeleportAction>
              <Position>
                <LanePosition roadId="1" laneId="$lane" s="10"/>
              </Position>
            </TeleportAction>
          </PrivateAction>
          <PrivateAction>
            <LongitudinalAction>
              <SpeedAction>
                <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
                <SpeedActionTarget>
                  <AbsoluteTargetSpeed value="${$twice / 2}"/>
                </SpeedActionTarget>
              </SpeedAction>
            </LongitudinalAction>
          </PrivateAction>
          <PrivateAction>
            <ActivateControllerAction lateral="true" longitudinal="true" objectControllerRef="driver"/>
          </PrivateAction>
        </Private>
        <Private entityRef="Target">
          <PrivateAction>
            <TeleportAction>
              <Position>
                <RoadPosition roadId="2" s="10" t="-1.75"/>
              </Position>
            </TeleportAction>
          </PrivateAction>
        </Private>
      </Actions>
    </Init>
    <Story name="story">
      <Act name="act">
        <ManeuverGroup name="group" maximumExecutionCount="1">
          <Actors selectTriggeringEntities="false">
            <EntityRef entityRef="Ego"/>
          </Actors>
          <Maneuver name="maneuver">
            <Event name="follow" priority="override">
              <Action name="path">
                <PrivateAction>
                  <RoutingAction>
                    <FollowTrajectoryAction>
                      <TimeReference>
                        <Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>
                      </TimeReference>
                      <TrajectoryFollowingMode followingMode="position"/>
                      <TrajectoryRef>
                        <Trajectory name="curve" closed="false">
                          <Shape>
                            <Nurbs order="2">
                              <ControlPoint time="0">
                                <Position><GeoPosition latitudeDeg="48" longitudeDeg="9"/></Position>
                              </ControlPoint>
                              <ControlPoint time="1">
                                <Position><WorldPosition x="10" y="0"/></Position>
                              </ControlPoint>
                              <Knot value="0"/>
                              <Knot value="0"/>
                              <Knot value="1"/>
                              <Knot value="1"/>
                            </Nurbs>
                          </Shape>
                        </Trajectory>
                      </TrajectoryRef>
                    </FollowTrajectoryAction>
                  </RoutingAction>
                </PrivateAction>
              </Action>
              <Action name="count">
                <GlobalAction>
                  <VariableAction variableRef="count">
                    <SetAction value="1"/>
                  </VariableAction>
                </GlobalAction>
              </Action>
              <Action name="see">
                <GlobalAction>
                  <SetMonitorAction monitorRef="seen" value="true"/>
                </GlobalAction>
              </Action>
              <Action name="switch">
                <GlobalAction>
                  <InfrastructureAction>
                    <TrafficSignalAction>
                      <TrafficSignalControllerAction trafficSignalControllerRef="north" phase="go"/>
                    </TrafficSignalAction>
                  </InfrastructureAction>
                </GlobalAction>
              </Action>
              <Action name="light">
                <GlobalAction>
                  <InfrastructureAction>
                    <TrafficSignalAction>
                      <TrafficSignalStateAction name="12" state="red"/>
                    </TrafficSignalAction>
                  </InfrastructureAction>
                </GlobalAction>
              </Action>
              <Action name="blink">
                <PrivateAction>
                  <AppearanceAction>
                    <LightStateAction transitionTime="0.5">
                      <LightType>
                        <VehicleLight vehicleLightType="indicatorLeft"/>
                      </LightType>
                      <LightState mode="on"/>
                    </LightStateAction>
                  </AppearanceAction>
                </PrivateAction>
              </Action>
              <Action name="distance">
                <PrivateAction>
                  <LongitudinalAction>
                    <LongitudinalDistanceAction entityRef="Target" continuous="false" freespace="true" distance="20"/>
                  </LongitudinalAction>
                </PrivateAction>
              </Action>
              <StartTrigger>
                <ConditionGroup>
                  <Condition name="later" delay="0" conditionEdge="rising">
                    <ByValueCondition>
                      <SimulationTimeCondition value="3" rule="greaterThan"/>
                    </ByValueCondition>
                  </Condition>
                  <Condition name="rain" delay="0" conditionEdge="none">
                    <ByValueCondition>
                      <ParameterCondition parameterRef="wet" value="true" rule="equalTo"/>
                    </ByValueCondition>
                  </Condition>
                </ConditionGroup>
              </StartTrigger>
            </Event>
          </Maneuver>
        </ManeuverGroup>
        <StartTrigger>
          <ConditionGroup>
            <Condition name="start" delay="0" conditionEdge="none">
              <ByValueCondition>
                <SimulationTimeCondition value="0" rule="greaterOrEqual"/>
              </ByValueCondition>
            </Condition>
          </ConditionGroup>
        </StartTrigger>
      </Act>
    </Story>
    <StopTrigger>
      <ConditionGroup>
        <Condition name="done" delay="0" conditionEdge="none">
          <ByValueCondition>
            <StoryboardElementStateCondition storyboardElementType="event" state="completeState"
                                             storyboardElementRef="act::group::maneuver::follow"/>
          </ByValueCondition>
        </Condition>
        <Condition name="standing" delay="0" conditionEdge="none">
          <ByEntityCondition>
            <TriggeringEntities triggeringEntitiesRule="any">
              <EntityRef entityRef="all"/>
            </TriggeringEntities>
            <EntityCondition>
              <StandStillCondition duration="2"/>
            </EntityCondition>
          </ByEntityCondition>
        </Condition>
      </ConditionGroup>
    </StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""

DISTRIBUTION = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-03-01T12:00:00" description="variation" author="tests"/>
  <ParameterValueDistribution>
    <ScenarioFile filepath="scenario.xosc"/>
    <Deterministic>
      <DeterministicSingleParameterDistribution parameterName="speed">
        <DistributionRange stepWidth="5">
          <Range lowerLimit="10" upperLimit="30"/>
        </DistributionRange>
      </DeterministicSingleParameterDistribution>
    </Deterministic>
  </ParameterValueDistribution>
</OpenSCENARIO>
"""


@dataclass
class Project:
    """The files by short names; `edit` breaks one, `check` checks it."""

    folder: Path

    def __post_init__(self) -> None:
        (self.folder / "catalogs").mkdir()
        self.files = {
            "scenario": self.folder / "scenario.xosc",
            "road": self.folder / "road.xodr",
            "catalog": self.folder / "catalogs" / "vehicles.xosc",
            "distribution": self.folder / "variation.xosc",
        }
        for name, text in (
            ("scenario", SCENARIO),
            ("road", ROAD),
            ("catalog", CATALOG),
            ("distribution", DISTRIBUTION),
        ):
            self.files[name].write_text(text, encoding="utf-8")

    def edit(self, name: str, *replacements: tuple[str, str]) -> None:
        """Replace the first occurrence of each text, which must be there."""
        text = self.files[name].read_text(encoding="utf-8")
        for old, new in replacements:
            assert old in text, f"{old!r} is not in the {name}"
            text = text.replace(old, new, 1)
        self.files[name].write_text(text, encoding="utf-8")

    def check(self, name: str) -> list[Problem]:
        """Problems of one of the files."""
        return check(self.files[name])

    def line(self, name: str, text: str) -> int:
        """Number of the first line that holds a text."""
        lines = self.files[name].read_text(encoding="utf-8").splitlines()
        return next(number for number, line in enumerate(lines, 1) if text in line)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A sound project in a folder of its own."""
    return Project(tmp_path)
