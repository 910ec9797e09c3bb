"""Objects of OSI ground truth, and the packages that make them: an optional extra."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from runner.participants.declaration import BoundingBox
from schemas.common.packages import optional

_TYPES = {
    "car": "TYPE_CAR", "van": "TYPE_VAN", "truck": "TYPE_HEAVY_TRUCK", "trailer": "TYPE_TRAILER",
    "semitrailer": "TYPE_SEMITRAILER", "bus": "TYPE_BUS", "motorbike": "TYPE_MOTORBIKE", "bicycle": "TYPE_BICYCLE",
    "train": "TYPE_TRAIN", "tram": "TYPE_TRAM", "motorcycle": "TYPE_MOTORCYCLE", "heavyTruck": "TYPE_HEAVY_TRUCK",
    "semitractor": "TYPE_SEMITRACTOR", "wheelchair": "TYPE_WHEELCHAIR", "standupScooter": "TYPE_STANDUP_SCOOTER",
    "micromobilityDevice": "TYPE_MICROMOBILITY_DEVICE", "workMachine": "TYPE_WORK_MACHINE",
    "landVehicle": "TYPE_LAND_VEHICLE", "aircraft": "TYPE_AIRCRAFT", "watercraft": "TYPE_WATERCRAFT",
}  # fmt: skip
"""OSI's vehicle types by OpenSCENARIO category."""
_KINDS = {"vehicle": "TYPE_VEHICLE", "pedestrian": "TYPE_PEDESTRIAN"}
_NANO = 1_000_000_000
_AXES = (("position", "xyz"), ("orientation", ("yaw", "pitch", "roll")), ("velocity", "xyz"), ("acceleration", "xyz"))


class Kind(Protocol):
    """Properties of an object."""

    @property
    def kind(self) -> str: ...
    @property
    def category(self) -> str: ...
    @property
    def box(self) -> BoundingBox: ...


def fill_base(base: Any, box: BoundingBox, values: Sequence[float], moves: bool) -> None:
    """Fill a BaseStationary, or BaseMoving where it moves.

    Args:
        values: position (m), yaw, pitch, roll (rad), velocity, acceleration, yaw, pitch and roll rate, of the box's centre in the
            world frame.
    """
    base.dimension.length, base.dimension.width, base.dimension.height = box.length, box.width, box.height
    for (field, axes), start in zip(_AXES if moves else _AXES[:2], range(0, 12, 3), strict=False):
        for axis, value in zip(axes, values[start : start + 3], strict=True):
            setattr(getattr(base, field), axis, value)
    if moves:
        for axis, value in zip(("yaw", "pitch", "roll"), values[12:], strict=True):
            setattr(base.orientation_rate, axis, value)


def fill_type(each: Any, one: Kind, osi: Osi) -> None:
    """Fill what a MovingObject is."""
    moving = osi.objects.MovingObject
    each.type = moving.Type.Value(_KINDS.get(one.kind, "TYPE_OTHER"))
    if one.kind == "vehicle":
        each.vehicle_classification.type = moving.VehicleClassification.Type.Value(_TYPES.get(one.category, "TYPE_OTHER"))
        rear = each.vehicle_attributes.bbcenter_to_rear
        rear.x, rear.y, rear.z = -one.box.x, -one.box.y, -one.box.z
    elif one.kind == "pedestrian":
        root = each.pedestrian_attributes.bbcenter_to_root
        root.x, root.y, root.z = -one.box.x, -one.box.y, -one.box.z


class Osi:
    """Used parts of the OSI packages, an optional extra.

    Raises:
        MissingExtra: they are not installed.
    """

    def __init__(self) -> None:
        self.groundtruth, self.objects = optional("osi3.osi_groundtruth_pb2"), optional("osi3.osi_object_pb2")
        tools, osi_version = optional("osi_utilities"), optional("osi3.osi_version_pb2")
        self.single, self.multi = tools.SingleTraceWriter, tools.MultiTraceWriter
        options = osi_version.DESCRIPTOR.GetOptions()
        self.interface_version = options.Extensions[osi_version.current_interface_version]
        numbers = self.interface_version
        self.osi_version = f"{numbers.version_major}.{numbers.version_minor}.{numbers.version_patch}"
        self.protobuf_version = optional("google.protobuf").__version__

    def stamp(self, message: Any, time: float) -> None:
        """Give a message its version and timestamp (s)."""
        message.version.CopyFrom(self.interface_version)
        message.timestamp.seconds, message.timestamp.nanos = divmod(round(time * _NANO), _NANO)
