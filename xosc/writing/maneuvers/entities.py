"""Participants with given dimensions, references to catalogues, parameters with constraints;
numbers and enumerations."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache, partial
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np
from lxml import etree
from scenariogeneration import xosc as sg

from schemas.common.errors import UsageError

# numbers, enumerations, elements ----------------------------------------------------------------


Number = float | str
"""A number, or the text of a parameter reference `$Speed` or an expression `${2 * $Speed}`."""


def number(value: Number) -> float | str:
    """A finite number or a reference for scenariogeneration; UsageError for anything else."""
    if isinstance(value, str):
        if value.startswith("$"):
            return value
        raise UsageError(
            f"{value!r} is neither a number nor a parameter reference, which begins with $"
        )
    if not math.isfinite(value):
        raise UsageError(f"{value} is not a finite number")
    return float(value)


@cache
def enum_value(kind: str, name: str) -> Any:
    """The member of one of the standard's enumerations; UsageError where it has no such member."""
    members = {
        key: value for key, value in vars(getattr(sg, kind)).items() if not key.startswith("_")
    }
    if name not in members:
        raise UsageError(f"{kind} has no {name!r}, it has {', '.join(members)}")
    return members[name]


_TRAJECTORY = """<Trajectory name="{name}" closed="false"><Shape><Polyline>
{vertices}</Polyline></Shape></Trajectory>
"""
_VERTEX = '<Vertex time="%r"><Position><WorldPosition %s/></Position></Vertex>\n'
"""A line per vertex without indentation: half of a catalogue of recorded motion would be blanks"""
_PLACES = 1 << 17
"""Places of vertices whose texts are kept, some 50 MB: scenes of one recording that overlap have
them in common"""
_BETWEEN = re.compile(r">\n *<")
ESCAPED = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}


class PolylineTrajectory(sg.Trajectory):
    """A `Trajectory` with one vertex a row of columns t, x, y and perhaps z and h, kept as its
    text, as it stands in a catalogue.

    Three objects a vertex would take most of the time of writing recorded motion.

    Raises:
        UsageError: a value is not finite.
    """

    def __init__(self, name: str, columns: Mapping[str, Sequence[float]]) -> None:
        super().__init__(name, False)
        # + 0.0 leaves no -0.0, which is equal to 0.0 in the cache of `_place` and has another text.
        values = np.array(list(columns.values()), np.float64) + 0.0
        for value in values[~np.isfinite(values)].tolist():
            number(value)  # refuses it
        time, *places = values.tolist()
        texts = map(partial(_place, tuple(columns)[1:]), *places)
        vertices = "".join([_VERTEX % vertex for vertex in zip(time, texts, strict=True)])
        self.text = _TRAJECTORY.format(name=escape(name, ESCAPED), vertices=vertices)

    @property
    def dense(self) -> str:
        """The text without indentation."""
        return _BETWEEN.sub("><", self.text).strip()

    def get_element(self) -> ElementTree.Element:
        """The element, as scenariogeneration asks for it."""
        return ElementTree.fromstring(self.dense)  # noqa: S314 - made here


@lru_cache(maxsize=_PLACES)
def _place(axes: tuple[str, ...], *values: float) -> str:
    """Attributes of a place."""
    return " ".join(f'{axis}="{value!r}"' for axis, value in zip(axes, values, strict=True))


def rendered(built: Any) -> etree._Element:
    """The element of a scenariogeneration object, in version 1.3 of the standard.

    The version that scenariogeneration writes is a global of the process: it is set here only, and
    put back.
    """
    if isinstance(built, PolylineTrajectory):
        return etree.fromstring(built.dense)
    before = sg.VersionBase.version_major, sg.VersionBase.version_minor
    sg.VersionBase().setVersion(1, 3)
    try:
        return _copied(built.get_element())
    finally:
        sg.VersionBase().setVersion(*before)


def _copied(element: Any, parent: etree._Element | None = None) -> etree._Element:
    """An element of the standard library's XML tree as one of lxml's."""
    tag, attributes = element.tag, element.attrib
    copied = (
        etree.Element(tag, attributes)
        if parent is None
        else etree.SubElement(parent, tag, attributes)
    )
    copied.text = element.text
    for child in element:
        _copied(child, copied)
    return copied


# entities ---------------------------------------------------------------------------------------


WHEELBASE = 0.6
"""Wheelbase as a share of the length, where it is not known: cars have 0.55 to 0.65 of it."""
_WHEEL_DIAMETER, _STEERING = 0.6, 0.6
_TRACK = 0.85


def vehicle(
    name: str,
    length: float,
    width: float,
    height: float,
    *,
    category: str = "car",
    wheelbase: float | None = None,
    centre: float | None = None,
    mass: float | None = None,
    max_speed: float = 70.0,
    max_acceleration: float = 10.0,
    max_deceleration: float = 10.0,
) -> Any:
    """A vehicle with its reference point at the centre of the rear axle, on the ground.

    Args:
        name: its name in a catalogue or as a type.
        length: of the bounding box, m; `width` and `height` likewise.
        category: a VehicleCategory of the standard: car, van, truck, bus, motorbike, bicycle, ...
        wheelbase: distance of the axles, m; by default `WHEELBASE` of the length.
        centre: bounding box centre ahead of the rear axle, m; by default half the wheelbase (equal
            overhangs).
        mass: kg.
        max_speed: m/s; max_acceleration and max_deceleration in m/s².

    Raises:
        UsageError: a dimension is not positive, or there is no such category.
    """
    wheelbase = WHEELBASE * length if wheelbase is None else wheelbase
    for label, value in {
        "length": length,
        "width": width,
        "height": height,
        "wheelbase": wheelbase,
    }.items():
        if not float(number(value)) > 0:
            raise UsageError(f"the {label} of the vehicle {name!r} must be positive, not {value}")
    x = wheelbase / 2 if centre is None else float(number(centre))
    performance = (number(limit) for limit in (max_speed, max_acceleration, max_deceleration))
    return sg.Vehicle(
        name,
        enum_value("VehicleCategory", category),
        # scenariogeneration takes the width before the length.
        sg.BoundingBox(width, length, height, x, 0.0, height / 2),
        # Positions of axles count from the reference point: the rear axle is at 0.
        sg.Axle(_STEERING, _WHEEL_DIAMETER, _TRACK * width, wheelbase, _WHEEL_DIAMETER / 2),
        sg.Axle(0.0, _WHEEL_DIAMETER, _TRACK * width, 0.0, _WHEEL_DIAMETER / 2),
        *performance,
        mass=mass,
    )


def pedestrian(
    name: str,
    length: float,
    width: float,
    height: float,
    *,
    category: str = "pedestrian",
    mass: float = 75.0,
) -> Any:
    """A pedestrian with its reference point in the middle of its box, on the ground.

    Args:
        name: its name in a catalogue or as a type.
        length: of the bounding box, m; `width` and `height` likewise.
        category: a PedestrianCategory of the standard.
        mass: kg.
    """
    box = sg.BoundingBox(width, length, height, 0.0, 0.0, height / 2)
    return sg.Pedestrian(name, mass, enum_value("PedestrianCategory", category), box, name)


def obstacle(
    name: str,
    length: float,
    width: float,
    height: float,
    *,
    category: str = "obstacle",
    mass: float = 100.0,
) -> Any:
    """A `MiscObject` with its reference point in the middle of its box, on the ground; see
    `pedestrian`."""
    box = sg.BoundingBox(width, length, height, 0.0, 0.0, height / 2)
    return sg.MiscObject(name, mass, enum_value("MiscObjectCategory", category), box)


def controller(name: str, properties: Mapping[str, str]) -> Any:
    """A `Controller`, which simulators find out about by its properties."""
    held = sg.Properties()
    for key, value in properties.items():
        held.add_property(key, value)
    return sg.Controller(name, held)


def reference(catalog: str, entry: str, assignments: Mapping[str, Number] | None = None) -> Any:
    """`CatalogReference` to an entry of a catalogue, with values for the entry's parameters."""
    built = sg.CatalogReference(catalog, entry)
    for name, value in (assignments or {}).items():
        built.add_parameter_assignment(name, value)
    return built


Constraint = tuple[str, Number]
"""A rule of the standard (lessThan, equalTo, …) and the value that it compares with."""


def parameter(
    name: str, kind: str, value: Number | bool, constraints: Sequence[Sequence[Constraint]] = ()
) -> Any:
    """A parameter declaration.

    Args:
        name: without `$`.
        kind: a ParameterType of 1.3: double, int, unsignedInt, unsignedShort, boolean, string,
            dateTime.
        value: its default.
        constraints: constraint groups; a group holds where all its constraints do, one group must
            hold.

    Raises:
        UsageError: there is no such type or rule.
    """
    declared = sg.Parameter(name, enum_value("ParameterType", kind), _text(value))
    for constraint_group in constraints:
        group = sg.ValueConstraintGroup()
        for rule, limit in constraint_group:
            group.add_value_constraint(sg.ValueConstraint(enum_value("Rule", rule), _text(limit)))
        declared.add_value_constraint_group(group)
    return declared


def declarations(parameters: Sequence[Any]) -> Any:
    """`ParameterDeclarations` of some `parameter`."""
    declared = sg.ParameterDeclarations()
    for parameter in parameters:
        declared.add_parameter(parameter)
    return declared


def _text(value: Number | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)
