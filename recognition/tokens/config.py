"""What windows of tokens look like: how long, how many participants, and what is known of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

from recognition.sites.roles import ROLES
from schemas.errors import UsageError

MOTION = ("speed", "acceleration", "yaw_rate", "lateral_speed", "length", "width")
"""Of a participant by itself: m/s, m/s², rad/s, m/s to the left of its lane, m."""
RELATIVE = (
    "along", "aside", "ahead", "left", "closing_ahead", "closing_left", "cos", "sin", "lanes_left",
    "is_lead", "is_follower", "same_way", "merging",
)  # fmt: skip
"""Of a participant relative to the ego at the same time; of the ego relative to itself at the middle of the window:

- `along`, `aside`: distance along the lanes, and to the left across them, m; 0 where lanes do not connect the two;
- `ahead`, `left`, `closing_ahead`, `closing_left`: place (m) and velocity (m/s) in the axes of the ego's heading;
- `cos`, `sin`: of the difference of headings; `lanes_left`: how many lanes to the left;
- `is_lead`, `is_follower`: whether it is the ego's lead or follower; `same_way`: whether one is on the way of the other, or
  beside it; `merging`: whether their ways lead to one lane, in which case `along` is by how much it is nearer to it.
"""
TRAFFIC = ("offset", "gap", "headway", "has_lead")
"""Of a participant in its lane: m to the left of the centre; gap (m) and time headway (s) to its lead, which may be absent."""
ROAD = ("border_left", "border_right", "lanes_to_left", "lanes_to_right", "lane_behind", "lane_ahead", "limit", "has_limit")
"""Of the lane that a participant is in: distances from its box to the borders (m), lanes of the same direction beside it,
distances to the lane's beginning and end (m), speed limit (m/s)."""
FEATURES = (*MOTION, *RELATIVE, *TRAFFIC, *ROAD, *(f"role_{role}" for role in ROLES))
"""All features in the order of the last axis; a role is 1 where the lane has it. Lights do not show: lanes through
junctions with lights are `inside` as others are, and `signalised` stays 0. Values are divided by `SCALES`."""
SCALES = {
    "speed": 15.0, "acceleration": 2.0, "yaw_rate": 0.3, "length": 8.0, "width": 2.5, "along": 30.0, "aside": 3.5, "ahead": 30.0,
    "left": 10.0, "closing_ahead": 8.0, "closing_left": 4.0, "gap": 40.0, "headway": 3.0, "border_left": 1.5, "border_right": 1.5,
    "lanes_to_left": 2.0, "lanes_to_right": 2.0, "lane_behind": 50.0, "lane_ahead": 50.0, "limit": 20.0,
}  # fmt: skip
"""What features are divided by, so that they are mostly between -1 and 1; those that are not listed stay."""


@dataclass(frozen=True)
class Tokens:
    """Windows about an ego: rows of features for the ego, first, and for the others that matter most to it.

    Attributes:
        span, frames: length of a window, s, and how many equally long parts it has; a frame is the middle of each.
        others: most other participants: the ego's leads and followers, then the nearest.
        reach: nobody farther away than this counts, but for leads, m.
        core: time about the middle for which the ego has to be there, s; beyond it a track may begin or end.
    """

    span: float = 6.4
    frames: int = 16
    others: int = 8
    reach: float = 120.0
    core: float = 1.5

    def __post_init__(self) -> None:
        if not 0.0 < self.core <= self.span < math.inf or self.frames < 2:
            raise UsageError("a window of tokens needs two or more frames over a positive time, and a core no longer than that")
        if self.others < 0 or not 0.0 < self.reach < math.inf:
            raise UsageError("a window of tokens has a number of others, within a positive reach")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of one window: participants, frames, features."""
        return 1 + self.others, self.frames, len(FEATURES)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Times of the frames relative to the middle of the window, s."""
        return tuple(self.span * ((k + 0.5) / self.frames - 0.5) for k in range(self.frames))
