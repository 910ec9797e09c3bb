"""Responsibility-Sensitive Safety: safe distances and their parameter sets.

Source: Shalev-Shwartz, Shammah, Shashua, "On a formal model of safe and scalable self-driving cars"
(2017), definitions 1 and 6. Plain arithmetic, so arguments may be floats or numpy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from schemas.common.errors import UsageError


@dataclass(frozen=True, slots=True)
class RssParameters:
    """Assumptions of RSS: response times (s), accelerations (m/s²), margin (m).

    Args:
        response: ρ of the ego, and of the other in lateral encounters.
        response_other: ρ of the other participant.
        accelerate: greatest longitudinal acceleration during the response time.
        brake_min: deceleration that the rear one will at least apply.
        brake_max: deceleration that the front one can at most apply.
        lateral_accelerate: greatest lateral acceleration during the response time.
        lateral_brake: lateral deceleration that both will at least apply.
        margin: μ, lateral distance that always remains.
    """

    response: float
    response_other: float
    accelerate: float
    brake_min: float
    brake_max: float
    lateral_accelerate: float
    lateral_brake: float
    margin: float


PARAMETERS = {
    "ad-rss": RssParameters(1.0, 2.0, 3.5, 4.0, 8.0, 0.2, 0.8, 0.1),
    "r157": RssParameters(0.75, 0.75, 3.0, 6.0, 6.0, 1.0, 1.0, 0.3),
}
"""Parameter sets by name: the defaults of the ad-rss library, and those of the performance models
of UN Regulation 157."""


def parameter_set(name: str) -> RssParameters:
    """The parameter set of that name.

    Raises:
        UsageError: there is none.
    """
    if name not in PARAMETERS:
        raise UsageError(
            f"no RSS parameter set is called {name!r}; there are {', '.join(PARAMETERS)}"
        )
    return PARAMETERS[name]


def longitudinal_distance(
    rear_speed: Any, front_speed: Any, p: RssParameters, response: float | None = None
) -> Any:
    """Least safe longitudinal gap (m) of a rear participant behind a front one, m/s in the rear
    one's direction.

    A front participant that comes towards the rear one (negative speed) needs its own stopping
    distance as well.

    Args:
        response: of the rear participant, s; the ego's where it is not given.
    """
    time = p.response if response is None else response
    reached = rear_speed + time * p.accelerate
    responding = rear_speed * time + 0.5 * p.accelerate * time**2
    # Definition 1: the rear one accelerates during its response time, then brakes at least with
    # `brake_min`, while the front one brakes with `brake_max`. v·|v| keeps the sign of a front one
    # that comes towards it.
    distance = (
        responding
        + reached**2 / (2.0 * p.brake_min)
        - front_speed * abs(front_speed) / (2.0 * p.brake_max)
    )
    # A product, not max(): arguments may be arrays.
    return (distance > 0) * distance


def lateral_distance(
    left_speed: Any, right_speed: Any, left_response: float, right_response: float, p: RssParameters
) -> Any:
    """Least safe lateral gap (m) between a left and a right participant; lateral speeds (m/s)
    positive to the right."""
    left = left_speed + left_response * p.lateral_accelerate
    right = right_speed - right_response * p.lateral_accelerate
    # Definition 6: both accelerate towards each other during the response time, then brake to a
    # lateral speed of 0. One that still moves away at its end has no braking distance.
    closing = (left_speed + left) / 2.0 * left_response + (left > 0) * left**2 / (
        2.0 * p.lateral_brake
    )
    opening = (right_speed + right) / 2.0 * right_response - (right < 0) * right**2 / (
        2.0 * p.lateral_brake
    )
    distance = closing - opening
    return p.margin + (distance > 0) * distance
