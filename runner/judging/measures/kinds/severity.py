"""Severity of the ego's first contact: impact speed, change of velocity, and risk of a death by
published curves.

A contact is taken as plastic and central: both participants move on together. That is an upper
bound of the change of velocity where they hit each other off centre. Striking entity, side and
point: `runner.judging.measures.contacts`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.judging.measures.measure import Extreme, RunMeasure, measure

if TYPE_CHECKING:
    from runner.judging.measures.criticality import Criticality
    from runner.judging.measures.relations import MotionRows

_KMH, _MPH = 3.6, 3600.0 / 1609.344
"""Per m/s"""
MASSES = {
    "bicycle": 90.0, "bus": 12000.0, "car": 1500.0, "motorbike": 270.0, "pedestrian": 75.0,
    "semitrailer": 12000.0,
    "trailer": 1000.0, "train": 100000.0, "tram": 40000.0, "truck": 12000.0, "van": 2500.0,
}  # fmt: skip
"""Masses (kg) that are assumed where a file declares none; of other vehicles that of a car."""
UNPROTECTED = ("bicycle", "motorbike", "pedestrian", "wheelchair")
"""Categories of participants without a body of a car around them."""
FIXED = "miscellaneous"
"""Kind of participants that do not move when they are hit."""


def mass(motion: MotionRows) -> float:
    """Mass of a participant (kg), declared or assumed; infinite for a fixed object."""
    if motion.kind == FIXED:
        return math.inf
    return motion.mass or MASSES.get(
        "pedestrian" if motion.kind == "pedestrian" else motion.category, MASSES["car"]
    )


def change_of_velocity(speed: float, own: float, other: float) -> float:
    """Change of velocity (m/s) of a participant with a mass that hits one of another mass (kg) at a
    relative speed (m/s)."""
    # inf / inf has no value: against a fixed object the whole speed is lost.
    if math.isinf(other):
        return speed
    return 0.0 if math.isinf(own) else speed * other / (own + other)


def occupant_risk(change: float) -> float:
    """Probability that a driver dies at a change of velocity (m/s): (Δv / 71
    mph)⁴, Joksch (1993).
    """
    return min((change * _MPH / 71.0) ** 4, 1.0)


def pedestrian_risk(speed: float) -> float:
    """Probability that an adult pedestrian dies at an impact speed (m/s): 1 / (1 + exp(6.9 − 0.090
    v)), v in km/h.

    Rosén and Sander (2009); used for riders of bicycles and motorcycles too.
    """
    return 1.0 / (1.0 + math.exp(6.9 - 0.090 * speed * _KMH))


def _is_unprotected(motion: MotionRows) -> bool:
    return motion.kind == "pedestrian" or motion.category in UNPROTECTED


def _risk(motion: MotionRows, other: MotionRows, speed: float) -> float:
    """Probability of a fatality in an entity."""
    if motion.kind == FIXED:
        return 0.0
    if _is_unprotected(motion):
        return pedestrian_risk(speed)
    return occupant_risk(change_of_velocity(speed, mass(motion), mass(other)))


class _OfContact(RunMeasure):
    critical = "high"
    validity = "the ego touches another participant"

    def of(self, run: Criticality) -> Extreme | None:
        impact, opponent = run.impact, run.opponent
        if impact is None or opponent is None:
            return None
        return Extreme(self.value(run.ego, opponent, impact.speed), impact.time, impact.other)

    def value(self, ego: MotionRows, other: MotionRows, speed: float) -> float:
        """The measure of a contact at a relative speed (m/s)."""
        raise NotImplementedError


@measure
class ImpactSpeed(_OfContact):
    """Relative speed at the first contact."""

    name = "impact_speed"
    label = "Impact speed"
    unit = "m/s"
    formula = "relative speed at the first contact of the ego"
    source = "-"
    most = 60.0

    def value(self, ego: MotionRows, other: MotionRows, speed: float) -> float:
        return speed


@measure
class ChangeOfVelocity(_OfContact):
    """Change of velocity of the ego by the first contact."""

    name = "delta_v"
    label = "Change of velocity"
    unit = "m/s"
    formula = "impact speed · other mass / (ego mass + other mass)"
    source = "conservation of momentum; masses as declared, else by category"
    most = 40.0

    def value(self, ego: MotionRows, other: MotionRows, speed: float) -> float:
        return change_of_velocity(speed, mass(ego), mass(other))


@measure
class FatalityRisk(_OfContact):
    """Fatality risk of the first contact, for the entity with the greater risk."""

    name = "fatality_risk"
    label = "Fatality risk"
    formula = (
        "occupants: (Δv / 71 mph)⁴; pedestrians and riders: 1 / (1 + exp(6.9 − 0.090 · impact "
        "speed in km/h)); the greater"
    )
    source = "Joksch (1993); Rosén and Sander (2009)"
    greatest = 1.0
    most = 1.0

    def value(self, ego: MotionRows, other: MotionRows, speed: float) -> float:
        return max(_risk(ego, other, speed), _risk(other, ego, speed))
