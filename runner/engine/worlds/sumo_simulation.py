"""SUMO, through libsumo: the only module that imports it.

Every scripted participant is mirrored by moveToXY each step, so SUMO's own traffic sees it and
reacts; participants that SUMO drives are read back. libsumo holds one simulation a process. SUMO
moves in the plane.

Frames: SUMO's positions are those of the middle of the front bumper and its angles are degrees
clockwise from north; `_front` and `_reference` convert from and to the reference point and the
mathematical heading, `move` does so in line.

Lengths: all lanes of an edge have one length in SUMO, so in curves its drivers cover a little more
or less ground than their speed says (3 % for a lane 5 m from the middle of the edge's lanes where
the radius is 150 m).

Widths: a mirrored participant is as narrow as can be, so that it is on one lane only. Where
moveToXY puts a wide one onto two lanes of a junction, SUMO 1.28 crashes as soon as a vehicle comes
up behind. SUMO's drivers see a lane change once the middle of the vehicle has changed lane.

Drivers: SUMO's default car-following (Krauss) and lane-changing (LC2013) models without
imperfection and without differences in desired speed between drivers, so that nothing in them is
random; lane changes take 3 s.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable
from itertools import count
from typing import NamedTuple

import libsumo

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.participants.entity import Entity
from runner.engine.worlds.base import DriverRequest, WorldState
from runner.engine.worlds.sumo_translation import (
    KINDS,
    OBSTACLE,
    OFF,
    REACH,
    SumoRoutes,
    joined,
    link_state,
)
from schemas.common.errors import ToolchainError, UsageError
from xodr.formats.sumo_net import DOCK, SumoNet
from xodr.graph.network import RoadNetwork
from xodr.model import RoadPoint

Place = tuple[Entity, float, float, float]
"""A participant with its reference point (m) and heading (rad)"""

_ANYWHERE = 6
"""moveToXY's keepRoute bits: 2, also off the route and off the lanes; 4, whatever the lane permits.
"""
_NEAR = 3.0
"""Distance (m) from a lane's centre up to which SUMO looks for the lane that a participant is on;
further is off the road."""
_LANE_CHANGE = 3.0
"""Duration (s) of SUMO's lane changes."""
_STEERING = {"lcMaxSpeedLatStanding": "0", "lcMaxSpeedLatFactor": "0.3"}
"""Parameters of SUMO's lane changes: sideways with at most 0.3 of the speed, so not at all when
standing."""
_STAYING = {"lcKeepRight": "0"}
"""The same for participants that the scenario declares: they leave the lane where it puts them for
a reason only."""
_ROUNDING = 1e-9
_LARGEST_SEED = 2**31 - 1
_SMALLEST = 0.1
"""Length and width (m) that SUMO needs at least."""
_CAREFUL, _REGARDLESS = 31, 32
"""SUMO's speed modes: all checks (the default), and none."""
_LANE_CHANGES, _NO_LANE_CHANGES = 1621, 512
"""SUMO's lane change modes: its own changes (the default), and none but those asked for."""
_ERRORS = (libsumo.TraCIException, libsumo.FatalTraCIError)
_NOWHERE = libsumo.constants.INVALID_DOUBLE_VALUE
"""Coordinate of what is just leaving the network."""
_DOCK_ROUTE = "dock"
_UNFIT = re.compile(r"[^A-Za-z0-9_-]")
"""Characters of names that are left out of SUMO's ids."""
_UNLIMITED = 1000.0
"""Speed factor with which no speed limit matters."""


class _Arrival(NamedTuple):
    """Place where SUMO's driver takes an entity over, and the heading (rad) of its lane."""

    here: RoadPoint
    h: float


class _Shown(NamedTuple):
    """A participant in SUMO: its SUMO id, and where the middle of its front bumper is in its own
    frame (m)."""

    id: str
    ahead: float
    aside: float


def _front(shown: _Shown, x: float, y: float, h: float) -> tuple[float, float, float]:
    """The middle of the front bumper x, y (m) and SUMO's angle (degrees) for a reference point (m)
    and heading (rad)."""
    cos, sin = math.cos(h), math.sin(h)
    return (
        x + shown.ahead * cos - shown.aside * sin,
        y + shown.ahead * sin + shown.aside * cos,
        90.0 - math.degrees(h),
    )


def _reference(shown: _Shown, x: float, y: float, angle: float) -> tuple[float, float, float]:
    """Reference point x, y (m) and heading (rad) of the entity whose front bumper SUMO has at x, y
    under an angle (degrees)."""
    h = math.radians(90.0 - angle)
    cos, sin = math.cos(h), math.sin(h)
    x -= shown.ahead * cos - shown.aside * sin
    y -= shown.ahead * sin + shown.aside * cos
    return x, y, math.remainder(h, math.tau)


class SumoSimulation:
    """A SUMO simulation on the network derived from the scenario's road file.

    Args:
        network: the roads; None where there are none, and the dock is all.
        net: their SUMO network.
        timestep: s.
        seed: of SUMO.

    Raises:
        UsageError: a simulation is open in this process.
        ToolchainError: SUMO does not start.
    """

    def __init__(
        self, network: RoadNetwork | None, net: SumoNet, timestep: float, seed: int
    ) -> None:
        self._network, self._net, self._dt = network, net, timestep
        self._shown: dict[Entity, _Shown] = {}
        self._arriving: dict[Entity, _Arrival] = {}
        """entities that SUMO's driver takes over in the coming step"""
        self._driven: dict[Entity, float] = {}
        """entities that SUMO drives, with the odometer (m) at which their route is found anew"""
        self._arrived: dict[Entity, _Arrival] = {}
        """entities that SUMO's driver took over in the step before, at the speed that they had"""
        self._requests: dict[Entity, DriverRequest] = {}
        self._types: dict[tuple[str, BoundingBox, Performance], str] = {}
        self._dark: dict[str, str] = {}
        """link states of each traffic light while it is off"""
        self._routes = SumoRoutes(network, net) if network is not None else None
        self._numbers = count()
        if libsumo.simulation.isLoaded():
            raise UsageError("libsumo has a simulation open in this process, and can hold one")
        try:
            libsumo.start(self._arguments(timestep, seed))
            libsumo.route.add(_DOCK_ROUTE, [DOCK])
            for light in libsumo.trafficlight.getIDList():
                libsumo.trafficlight.setProgram(light, "off")
                self._dark[light] = libsumo.trafficlight.getRedYellowGreenState(light)
        except _ERRORS as error:
            raise ToolchainError(f"SUMO does not start: {error}") from None

    def _arguments(self, timestep: float, seed: int) -> list[str]:
        return [
            "sumo",
            f"--net-file={self._net.path}",
            f"--step-length={max(round(timestep, 3), 0.001)!r}",
            f"--seed={seed % _LARGEST_SEED}",
            f"--lanechange.duration={_LANE_CHANGE!r}",
            "--collision.action=none",
            "--time-to-teleport=-1",
            "--no-step-log",
            "--no-warnings",
        ]

    def close(self) -> None:
        """End SUMO."""
        libsumo.close()

    # participants ---------------------------------------------------------------------------

    def add(self, entity: Entity) -> None:
        """Bring a participant to the dock; the coming step moves it to its place."""
        if entity in self._shown:
            return
        box = entity.box
        shown = _Shown(
            f"{_UNFIT.sub('', entity.name)}.{next(self._numbers)}", box.x + box.length / 2, box.y
        )
        libsumo.vehicle.add(
            shown.id, _DOCK_ROUTE, self._type(entity), departPos="0", departSpeed="0"
        )
        self._shown[entity] = shown

    def _type(self, entity: Entity) -> str:
        """The SUMO vehicle type of an entity, made where there is none yet."""
        key = (entity.declared.category, entity.box, entity.declared.performance)
        if key not in self._types:
            name = self._types[key] = f"type.{len(self._types)}"
            kind, limits = (
                KINDS.get(entity.declared.category, OBSTACLE),
                entity.declared.performance,
            )
            types = libsumo.vehicletype
            types.copy("DEFAULT_VEHTYPE", name)
            types.setVehicleClass(name, kind.vehicle_class)
            types.setLength(name, max(entity.box.length, _SMALLEST))
            types.setWidth(name, _SMALLEST)  # while it is mirrored, see the module
            types.setHeight(name, max(entity.box.height, _SMALLEST))
            types.setMaxSpeed(name, _usual_speed(entity))
            types.setAccel(name, max(min(kind.acceleration, limits.max_acceleration), _SMALLEST))
            types.setEmergencyDecel(
                name, max(min(2.0 * kind.deceleration, limits.max_deceleration), _SMALLEST)
            )
            types.setDecel(name, max(min(kind.deceleration, limits.max_deceleration), _SMALLEST))
            types.setImperfection(name, 0.0)
            types.setSpeedDeviation(name, 0.0)
        return self._types[key]

    def remove(self, entity: Entity) -> None:
        """Take a participant out of SUMO, if it is still there."""
        self.release(entity)
        shown = self._shown.pop(entity, None)
        if shown is not None:
            with contextlib.suppress(libsumo.TraCIException):
                libsumo.vehicle.remove(shown.id)

    def drives(self, entity: Entity) -> bool:
        """Whether a participant is its drivers', or is in the coming step."""
        return entity in self._driven or entity in self._arriving

    def move(self, places: Iterable[Place]) -> None:
        """Move scripted participants to where they are at the end of the coming step."""
        shown, move, cos, sin, degrees = (
            self._shown,
            libsumo.vehicle.moveToXY,
            math.cos,
            math.sin,
            math.degrees,
        )
        remainder, tau = math.remainder, math.tau
        for entity, x, y, heading in places:
            item = shown.get(entity)
            if item is not None:
                name, ahead, aside = item
                h = remainder(
                    heading, tau
                )  # SUMO itself turns an angle into its range by one whole turn at a time
                c, s = cos(h), sin(h)
                move(
                    name,
                    "",
                    -1,
                    x + ahead * c - aside * s,
                    y + ahead * s + aside * c,
                    90.0 - degrees(h),
                    _ANYWHERE,
                    _NEAR,
                )

    def step(self) -> None:
        """Advance SUMO and hand arriving entities to SUMO's drivers."""
        try:
            for entity, (_, h) in self._arriving.items():
                shown, way = self._shown[entity], entity.speed * self._dt
                x, y, angle = _front(
                    shown, entity.x + way * math.cos(h), entity.y + way * math.sin(h), h
                )
                libsumo.vehicle.moveToXY(shown.id, "", -1, x, y, angle, _ANYWHERE, _NEAR)
            libsumo.simulationStep()
        except _ERRORS as error:
            raise ToolchainError(f"SUMO can't go on: {error}") from None
        self._arrived, self._arriving = self._arriving, {}
        for entity, arrival in self._arrived.items():
            self._hand_over(entity, arrival.here)

    # SUMO's drivers -------------------------------------------------------------------------

    def drive(self, entity: Entity) -> bool:
        """Hand a participant to SUMO's driver where SUMO has a lane for it."""
        if abs(round(self._dt, 3) - self._dt) > _ROUNDING:
            raise UsageError(
                f"SUMO counts in milliseconds: its drivers can't drive in steps of {self._dt!r} s"
            )
        arrival = self._arrival(entity)
        if arrival is None:
            self.release(entity)
            return False
        self.add(entity)
        self._arriving[entity] = arrival
        return True

    def _arrival(self, entity: Entity) -> _Arrival | None:
        """Return the lane position at which SUMO can drive an entity, None if there is none."""
        network = self._network
        if network is None or not entity.visible["traffic"]:
            return None
        here = network.locate(entity.x, entity.y, entity.z, entity.h)
        lane = self._net.sumo_lane(here.road_id, here.lane_id, here.s)
        if lane is None or not network.on_road(here):
            return None
        road = network.road(here.road_id)
        slope = math.atan(road.lane_slope(here.s, here.lane_id))
        h = (
            road.heading(here.s)
            + slope
            + (0.0 if road.direction(here.lane_id, here.s) > 0 else math.pi)
        )
        allowed = libsumo.lane.getAllowed(lane)
        fits = not allowed or KINDS.get(entity.declared.category, OBSTACLE).vehicle_class in allowed
        return _Arrival(here, h) if fits and math.cos(entity.h - h) > 0.0 else None

    def _hand_over(self, entity: Entity, here: RoadPoint) -> None:
        """Let SUMO's driver go on with a participant that is in its place."""
        name = self._shown[entity].id
        if not libsumo.vehicle.getLaneID(name):
            return  # its first step has led it off the lane: it counts as having left
        libsumo.vehicle.setPreviousSpeed(name, max(entity.speed, 0.0))
        libsumo.vehicle.setWidth(name, max(entity.box.width, _SMALLEST))
        for parameter, value in (_STEERING if entity.spawned else _STEERING | _STAYING).items():
            libsumo.vehicle.setParameter(name, f"laneChangeModel.{parameter}", value)
        self._find_route(entity, here, entity.odometer)
        self._apply(entity, self._requests.get(entity, DriverRequest()))

    def _find_route(self, entity: Entity, here: RoadPoint, odometer: float) -> None:
        """Give SUMO's driver the route from its place; if SUMO knows no such route, the present one
        stays."""
        assert self._routes is not None
        name, vehicle = self._shown[entity].id, libsumo.vehicle
        driving = vehicle.getRoute(name)[vehicle.getRouteIndex(name) :]
        with contextlib.suppress(libsumo.TraCIException):
            vehicle.setRoute(name, joined(driving, self._routes.ahead(entity, here)))
        self._driven[entity] = odometer + REACH / 2

    def release(self, entity: Entity) -> None:
        """Take a participant back; it is mirrored again."""
        self._arriving.pop(entity, None)
        if self._driven.pop(entity, None) is not None and entity in self._shown:
            with contextlib.suppress(libsumo.TraCIException):  # it has left the network
                libsumo.vehicle.setWidth(self._shown[entity].id, _SMALLEST)
        self._requests.pop(entity, None)

    def ask(self, entity: Entity, request: DriverRequest) -> None:
        """Set desired speed and permission to change lanes; speed limits hold only where no speed
        is asked for."""
        if self._requests.get(entity) == request:
            return
        self._requests[entity] = request
        if entity in self._driven:
            self._apply(entity, request)

    def _apply(self, entity: Entity, request: DriverRequest) -> None:
        name, vehicle = self._shown[entity].id, libsumo.vehicle
        vehicle.setLaneChangeMode(name, _LANE_CHANGES if request.lane_changes else _NO_LANE_CHANGES)
        vehicle.setSpeedMode(name, _REGARDLESS if request.exact else _CAREFUL)
        if request.speed is None:
            vehicle.setMaxSpeed(name, _usual_speed(entity))
            vehicle.setSpeedFactor(name, 1.0)
            vehicle.setSpeed(name, -1.0)
            return
        vehicle.setMaxSpeed(name, max(request.speed, _SMALLEST))
        vehicle.setSpeedFactor(name, _UNLIMITED)  # after the speed: setting that forgets the factor
        vehicle.setSpeed(
            name, max(request.speed, 0.0) if request.exact or request.speed < _SMALLEST else -1.0
        )

    def read(self, entity: Entity) -> WorldState | None:
        """State of a participant that SUMO drives; None once it has left at the
        end of its route.
        """
        due = self._driven.get(entity)
        if due is None:
            return None
        shown = self._shown[entity]
        vehicle = libsumo.vehicle
        try:
            x, y = vehicle.getPosition(shown.id)
            angle, speed = vehicle.getAngle(shown.id), vehicle.getSpeed(shown.id)
        except libsumo.TraCIException:
            x = _NOWHERE
        if x == _NOWHERE:
            self.remove(entity)
            return None
        if entity in self._arrived:
            speed = entity.speed
        if entity.odometer > due and self._network is not None:
            self._find_route(
                entity,
                self._network.locate(entity.x, entity.y, entity.z, entity.h),
                entity.odometer,
            )
        return WorldState(*_reference(shown, x, y, angle), speed)

    def signal(self, signal_id: str, state: str) -> None:
        """Show SUMO's traffic a signal's state; one that is not understood as if the light were
        off."""
        letter = link_state(state)
        for light, link in self._net.signals.get(signal_id, ()):
            shown = self._dark[light][link] if letter in (None, OFF) else letter
            libsumo.trafficlight.setLinkState(light, link, shown)


def _usual_speed(entity: Entity) -> float:
    """Greatest speed (m/s) of SUMO's driver in such a vehicle."""
    return max(
        min(
            KINDS.get(entity.declared.category, OBSTACLE).speed,
            entity.declared.performance.max_speed,
        ),
        _SMALLEST,
    )
