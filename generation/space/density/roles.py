"""Roles of parameters: the value of a recorded unit that each stands for. Options name them, so
nothing heavy is imported."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from recognition.labels.maneuvers.parameters import (
    BRAKING,
    CUT_IN,
    CUT_OUT,
    DECLARED,
    JERK,
    LANE_CHANGE,
    PARAMETERS,
)
from recognition.labels.maneuvers.parameters import EGO_SPEED as CATALOGUED_EGO_SPEED
from recognition.labels.maneuvers.parameters import OTHER_SPEED as CATALOGUED_OTHER_SPEED

EGO_SPEED = "ego_speed"
"""Role of the initial speed of the vehicle that is not the actor."""
ROLES = (*PARAMETERS, EGO_SPEED, JERK)
"""Names of the values of a recorded unit: seven of its actor, the other one's speed, and the
actor's jerk where it is known."""
ON_REQUEST = (JERK,)
"""Roles of parameters that are searched only where they are asked for."""
AHEAD, BEGINS, BEHIND = "ahead", "begins", "behind"
"""Roles of parameters of the second of two actors: the gap from the first one to it and when it
begins, or its gap to the ego."""
NUISANCES = ("start_time", "rest_time")
"""Roles of parameters that say when a scene begins and ends, not what happens in it."""
EGO, LEAD = "Ego", "Lead"
PAIRED = ("cut_in_before_braking_leader", "squeezed", "merge_beside_tail_gater")
"""Scenarios of the library with two adversaries, by the beginning of their names: each is a kind of
its own."""
KINDS_OF_SCENARIOS: Mapping[str, str] = {
    **{name: name for name in PAIRED},  # first: the name of one begins with that of a manoeuvre
    "free_cruise": BRAKING,
    "car_following": BRAKING,
    "braking_leader": BRAKING,
    "cut_in": CUT_IN,
    "cut_out": CUT_OUT,
    "lane_change_left": LANE_CHANGE,
    "lane_change_right": LANE_CHANGE,
    "congestion": BRAKING,
    "merging": CUT_IN,
    "diverging": CUT_OUT,
    "ramp_entering": LANE_CHANGE,
    "ramp_exiting": LANE_CHANGE,
    "turn_off": BRAKING,
}
"""Kinds of recorded units by the beginning of a library scenario's name. They stand here since
reading the tables of manoeuvres loads all that writes scenarios."""
_SPEED = "Speed_mps"
_OF_SHORT = {declared.name: role for role, declared in DECLARED.items()}


class Role(NamedTuple):
    """Role of a parameter in units of recordings.

    Attributes:
        actor: participant whose unit it is.
        role: one of `ROLES`.
        factor: the parameter's value is this times the unit's, which is in SI units.
    """

    actor: str
    role: str
    factor: float = 1.0


def roles_of(
    names: Iterable[str], mapped: Mapping[str, Role] | None = None, ego: str = EGO
) -> dict[str, Role]:
    """The roles of those parameters that have one: by their names, or as they are mapped.

    `CutIn_Gap_m` is the gap of the actor CutIn. The speed of the vehicle that is not an actor is
    the ego's, or where the ego acts the leader's. Scenarios of catalogues have one actor, whose
    parameters have no name in front.
    """
    names, roles = list(names), dict(mapped or {})
    if not roles:
        split = {name: name.partition("_") for name in names}
        roles |= {
            name: Role(actor, _OF_SHORT[short])
            for name, (actor, _, short) in split.items()
            if short in _OF_SHORT
        }
        roles |= {name: Role("", _OF_SHORT[name]) for name in names if name in _OF_SHORT}
        actors = [role.actor for role in roles.values()]
        # Names that mean the speed of the vehicle that does not act.
        passive = (
            f"{LEAD if ego in actors else ego}_{_SPEED}",
            CATALOGUED_EGO_SPEED,
            CATALOGUED_OTHER_SPEED,
        )
        roles |= {name: Role(actors[0], EGO_SPEED) for name in names if actors and name in passive}
    return {name: roles[name] for name in names if name in roles}
