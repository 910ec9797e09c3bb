"""Messages of ASAM OSI 3.8 for one moment: bases, types and lamps of objects, the frame, version
and time.

Needs the extra `osi`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from runner.engine.participants.declaration import BoundingBox
from schemas.common.packages import optional

if TYPE_CHECKING:
    from xodr import RoadNetwork

_TYPES = {
    "car": "TYPE_CAR", "van": "TYPE_VAN", "truck": "TYPE_HEAVY_TRUCK", "trailer": "TYPE_TRAILER",
    "semitrailer": "TYPE_SEMITRAILER", "bus": "TYPE_BUS", "motorbike": "TYPE_MOTORBIKE",
    "bicycle": "TYPE_BICYCLE",
    "train": "TYPE_TRAIN", "tram": "TYPE_TRAM", "motorcycle": "TYPE_MOTORCYCLE",
    "heavyTruck": "TYPE_HEAVY_TRUCK",
    "semitractor": "TYPE_SEMITRACTOR", "wheelchair": "TYPE_WHEELCHAIR",
    "standupScooter": "TYPE_STANDUP_SCOOTER",
    "micromobilityDevice": "TYPE_MICROMOBILITY_DEVICE", "workMachine": "TYPE_WORK_MACHINE",
    "landVehicle": "TYPE_LAND_VEHICLE", "aircraft": "TYPE_AIRCRAFT",
    "watercraft": "TYPE_WATERCRAFT",
}  # fmt: skip
"""OSI's vehicle types by OpenSCENARIO category."""
_ROLES = {
    "civil": "ROLE_CIVIL", "ambulance": "ROLE_AMBULANCE", "fire": "ROLE_FIRE",
    "police": "ROLE_POLICE",
    "publicTransport": "ROLE_PUBLIC_TRANSPORT", "roadAssistance": "ROLE_ROAD_ASSISTANCE",
    "garbageCollection": "ROLE_GARBAGE_COLLECTION", "roadConstruction": "ROLE_ROAD_CONSTRUCTION",
    "military": "ROLE_MILITARY",
}  # fmt: skip
"""OSI's roles by OpenSCENARIO role."""
_KINDS = {"vehicle": "TYPE_VEHICLE", "pedestrian": "TYPE_PEDESTRIAN"}
_NANO = 1_000_000_000
_AXES = (
    ("position", "xyz"),
    ("orientation", ("yaw", "pitch", "roll")),
    ("velocity", "xyz"),
    ("acceleration", "xyz"),
)


class ObjectKind(Protocol):
    """Properties of an object."""

    @property
    def kind(self) -> str: ...
    @property
    def category(self) -> str: ...
    @property
    def box(self) -> BoundingBox: ...
    @property
    def front_axle(self) -> float: ...


def fill_base(base: Any, box: BoundingBox, values: Sequence[float], moves: bool) -> None:
    """Fill a BaseStationary, or BaseMoving where it moves.

    Args:
        values: position (m), yaw, pitch, roll (rad), velocity, acceleration, yaw, pitch and roll
            rate, of the box's centre in the world frame.
    """
    base.dimension.length, base.dimension.width, base.dimension.height = (
        box.length,
        box.width,
        box.height,
    )
    for (field, axes), start in zip(_AXES if moves else _AXES[:2], range(0, 12, 3), strict=False):
        for axis, value in zip(axes, values[start : start + 3], strict=True):
            setattr(getattr(base, field), axis, value)
    if moves:
        for axis, value in zip(("yaw", "pitch", "roll"), values[12:], strict=True):
            setattr(base.orientation_rate, axis, value)


def fill_type(each: Any, one: ObjectKind, osi: Osi, role: str = "") -> None:
    """Fill the type of a MovingObject.

    Args:
        role: of the participant, as OpenSCENARIO names it; empty where it is not known.
    """
    moving = osi.objects.MovingObject
    each.type = moving.Type.Value(_KINDS.get(one.kind, "TYPE_OTHER"))
    if one.kind == "vehicle":
        each.vehicle_classification.type = moving.VehicleClassification.Type.Value(
            _TYPES.get(one.category, "TYPE_OTHER")
        )
        rear = each.vehicle_attributes.bbcenter_to_rear
        rear.x, rear.y, rear.z = -one.box.x, -one.box.y, -one.box.z
        if one.front_axle:
            front = each.vehicle_attributes.bbcenter_to_front
            front.x, front.y, front.z = one.front_axle - one.box.x, -one.box.y, -one.box.z
        if role:
            kind = _ROLES.get(role, "ROLE_OTHER")
            each.vehicle_classification.role = moving.VehicleClassification.Role.Value(kind)
    elif one.kind == "pedestrian":
        root = each.pedestrian_attributes.bbcenter_to_root
        root.x, root.y, root.z = -one.box.x, -one.box.y, -one.box.z


def fill_frame(message: Any, network: RoadNetwork) -> None:
    """Fill the map of a GroundTruth, its projection, and the offset of the world frame in it."""
    message.map_reference, message.proj_string = network.path.name, network.geo_reference or ""
    # Without a projection an offset has nothing that it is an offset from.
    if network.geo_reference is not None:
        offset, (x, y, z, heading) = message.proj_frame_offset, network.header.offset
        offset.position.x, offset.position.y, offset.position.z, offset.yaw = x, y, z, heading


class Osi:
    """Used parts of the OSI packages, an optional extra.

    Raises:
        MissingExtra: they are not installed.
    """

    def __init__(self) -> None:
        self.groundtruth, self.objects = (
            optional("osi3.osi_groundtruth_pb2"),
            optional("osi3.osi_object_pb2"),
        )
        tools, osi_version = optional("osi_utilities"), optional("osi3.osi_version_pb2")
        self.single, self.multi = tools.SingleTraceWriter, tools.MultiTraceWriter
        options = osi_version.DESCRIPTOR.GetOptions()
        self.interface_version = options.Extensions[osi_version.current_interface_version]
        numbers = self.interface_version
        self.osi_version = (
            f"{numbers.version_major}.{numbers.version_minor}.{numbers.version_patch}"
        )
        self.protobuf_version = optional("google.protobuf").__version__

    def stamp(self, message: Any, time: float) -> None:
        """Give a message its version and timestamp (s)."""
        message.version.CopyFrom(self.interface_version)
        message.timestamp.seconds, message.timestamp.nanos = divmod(round(time * _NANO), _NANO)


_GENERIC = {
    "fogLights": ("front_fog_light", "rear_fog_light"), "fogLightsFront": ("front_fog_light",),
    "fogLightsRear": ("rear_fog_light",), "highBeam": ("high_beam",), "lowBeam": ("head_light",),
    "reversingLights": ("reversing_light",),
    "licensePlateIllumination": ("license_plate_illumination_rear",),
    "daytimeRunningLights": ("tail_light",),
}  # fmt: skip
"""OSI's lights by OpenSCENARIO's"""
_INDICATORS = {"indicatorLeft": "LEFT", "indicatorRight": "RIGHT", "warningLights": "WARNING"}
_BLUE = {"ambulance", "fire", "police"}


def fill_lights(state: Any, modes: Mapping[str, str], role: str = "") -> None:
    """Fill a LightState with the lights that the scenario has set; all others stay unknown.

    Args:
        modes: on, off or flashing by OpenSCENARIO's light.
        role: of the vehicle, for the colour of its special lights; amber without one.
    """

    def value(field: str, name: str) -> None:
        enum = state.DESCRIPTOR.fields_by_name[field].enum_type
        setattr(state, field, enum.values_by_name[name].number)

    for light, mode in modes.items():
        generic = {"on": "ON", "off": "OFF"}.get(mode, "OTHER")
        for field in _GENERIC.get(light, ()):
            value(field, f"GENERIC_LIGHT_STATE_{generic}")
        if light == "brakeLights":
            value("brake_light_state", f"BRAKE_LIGHT_STATE_{'OFF' if mode == 'off' else 'NORMAL'}")
        if light == "specialPurposeLights":
            field = (
                "emergency_vehicle_illumination"
                if role in _BLUE
                else "service_vehicle_illumination"
            )
            colour = "FLASHING_BLUE" if role in _BLUE else "FLASHING_AMBER"
            value(field, f"GENERIC_LIGHT_STATE_{colour if mode == 'flashing' else generic}")
    lit = [word for light, word in _INDICATORS.items() if modes.get(light, "off") != "off"]
    if lit:
        both = set(lit) >= {"LEFT", "RIGHT"} or "WARNING" in lit
        value("indicator_state", f"INDICATOR_STATE_{'WARNING' if both else lit[0]}")
    elif _INDICATORS.keys() & modes.keys():
        value("indicator_state", "INDICATOR_STATE_OFF")
