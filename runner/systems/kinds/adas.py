"""`adas`: adaptive cruise control with emergency braking, seen by a radar."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from runner.engine.participants.boxes import outlook, spans
from runner.systems.base import Control, Observation, Participant
from runner.systems.kinds.reference import HARDEST, JERK

SYSTEMS = {
    "adas": (
        "DriverAssistance",
        "adaptive cruise control and emergency braking by radar; sees no lights",
    ),
}
_SLOW, _FAST = 5.0, 20.0
"""Speeds (m/s) between which ISO 15622 interpolates its limits"""
_STRAIGHT = 1e-4
"""Curvatures below this (1/m) are none"""
_CRAWL = 1.0
"""Speed (m/s) below which the curvature of the path is not known: it is the lateral acceleration over the squared speed"""
_ONCOMING = -0.5
"""Speeds along the ego's path below this (m/s) are those of oncoming traffic"""
_LEAST_GAP = 0.1
"""Gap (m) below which a required deceleration has no meaning any more"""


class RadarTarget(NamedTuple):
    """A participant in the field of view, in coordinates along the ego's predicted path.

    Args:
        name: the participant's name.
        gap: from the ego's front to its rear, m.
        aside: lateral gap to the ego's swath, m; negative where it is in it.
        width: its lateral extent and the ego's, together, m.
        approach: rate at which the lateral gap shrinks, m/s.
        speed, acceleration: along the path, m/s and m/s².
    """

    name: str
    gap: float
    aside: float
    width: float
    approach: float
    speed: float
    acceleration: float

    def is_in_way(self, speed: float, clearance: float) -> bool:
        """Whether it is in the swath when an ego of that speed (m/s) reaches it, widened by a clearance (m)."""
        closing = speed - self.speed
        left = self.aside - self.approach * (max(self.gap, 0.0) / closing if closing > 0.0 else 0.0)
        return -self.width - clearance < left < clearance

    def needed(self, speed: float, delay: float) -> float:
        """Constant deceleration (m/s²) that avoids the collision if braking begins after a delay (s); 0 where none is needed.

        A target that brakes is taken to brake on until it stands; one that approaches to keep its
        speed.
        """
        closing = speed - self.speed
        gap = max(self.gap - max(closing, 0.0) * delay, _LEAST_GAP)
        if self.speed < 0.0:
            return speed * closing / (2.0 * gap)
        braking = max(-self.acceleration, 0.0)
        if (
            braking > 0.0 and self.speed * closing <= 2.0 * gap * braking
        ):  # it stands before it is reached
            return speed * speed / (2.0 * gap + self.speed * self.speed / braking)
        return braking + closing * closing / (2.0 * gap) if closing > 0.0 else 0.0


@dataclass
class DriverAssistance:
    """Brakes comfortably behind a target and then keeps a time gap, and brakes fully where that is not enough.

    The scenario's speed is the driver's, and holds until the system acts. Targets are the
    participants in the field of view of a front radar, along the path that the ego's yaw rate
    predicts. Each decision takes effect after `latency`, and every change of braking is limited by
    a jerk. It never steers. Traffic that is hidden behind other traffic is seen. Traffic lights are
    not.

    **Following** begins where the nearest target in the path calls for `comfortable` deceleration
    or is nearer than the time gap `shortest`, and ends where the scenario asks for less speed. It
    is the acceleration of the ACC model, within ISO 15622's limits of deceleration and jerk, which
    are linear between 5 and 20 m/s. **Emergency braking** with `full` begins where the needed
    deceleration, after the latency and the build-up of the brakes, reaches `emergency`, for a
    target that is in the path or will be when it is reached; it ends where the ego is not faster,
    or the target is out of the way.

    Sources: ISO 15622:2018 (6.2, 6.4); Kesting, Treiber and Helbing, "Enhanced intelligent driver
    model to access the impact of driving strategies on traffic capacity" (Philosophical
    Transactions A 368, 2010), the ACC model and its constants; UN Regulations 152 and 157; data
    sheet of the radar Continental ARS 408-21.

    Args:
        far_range: range of the far field, m (ARS 408-21: 250 m).
        far_angle: half angle of the far field, degrees (ARS 408-21: 9°).
        near_range: range of the near field, m (ARS 408-21: 70 m).
        near_angle: half angle of the near field, degrees (ARS 408-21: 45°).
        latency: time from a change in traffic to the start of a reaction, s (UN Regulation 157,
            5.2.5: 0.35 s).
        shortest: time gap beyond `standstill` at which following begins, s (ISO 15622: no setting
            is shorter than 0.8 s).
        headway: time gap that is kept, s (ISO 15622: a setting in 1.5 to 2.2 s; Kesting et al.: 1.5
            s).
        standstill: gap at standstill, m (Kesting et al.: 2 m).
        accelerate: acceleration of the ACC model, m/s² (Kesting et al.: 1.4 m/s²).
        comfortable: comfortable deceleration of the ACC model, at which following begins, m/s²
            (Kesting et al.: 2 m/s²).
        coolness: share of trust that a target does not brake suddenly, 0 to 1 (Kesting et al.:
            0.99).
        slow_brake, fast_brake: greatest deceleration of following below 5 m/s and above 20 m/s,
            m/s² (ISO 15622).
        slow_jerk, fast_jerk: its greatest jerk at these speeds, m/s³ (ISO 15622).
        emergency: needed deceleration at which full braking begins, m/s² (UN Regulation 152: at
            least 5 m/s²).
        full: deceleration of full braking, m/s² (UN Regulation 157, Annex 4, Appendix 3: 0.774 g).
        jerk: build-up of full braking, m/s³ (the same: 0.6 s to 0.774 g).
        clearance: lateral margin of the path, m (that of `aeb` and `idm`).
    """

    far_range: float = 250.0
    far_angle: float = 9.0
    near_range: float = 70.0
    near_angle: float = 45.0
    latency: float = 0.35
    shortest: float = 0.8
    headway: float = 1.5
    standstill: float = 2.0
    accelerate: float = 1.4
    comfortable: float = 2.0
    coolness: float = 0.99
    slow_brake: float = 5.0
    fast_brake: float = 3.5
    slow_jerk: float = 5.0
    fast_jerk: float = 2.5
    emergency: float = 5.0
    full: float = HARDEST
    jerk: float = JERK
    clearance: float = 0.2

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._pending: deque[tuple[float, float, bool, str]] = deque()
        self._acceleration: float | None = None
        self._braking_for = ""
        self._follows = False

    def control(self, observation: Observation, dt: float) -> Control:
        """Acceleration with its reason while it follows or brakes, else nothing."""
        ego, time = observation.ego, observation.time
        if ego.speed < 0.0 or observation.target_speed < 0.0:
            return Control()
        self._pending.append((time, *self._decide(ego, observation)))
        demand, is_full, reason = math.inf, False, ""
        while self._pending and self._pending[0][0] <= time - self.latency + 1e-9:
            _, demand, is_full, reason = self._pending.popleft()
        return self._apply(demand, is_full, reason, observation, dt)

    def _decide(self, ego: Participant, observation: Observation) -> tuple[float, bool, str]:
        """Acceleration that the traffic calls for (infinite: none), whether it is full braking, and the reason."""
        targets = list(self.targets(observation))
        delay = self.latency + self.full / (2.0 * self.jerk)
        threat, worst = None, 0.0
        for each in targets:
            if each.is_in_way(ego.speed, self.clearance):
                needed = each.needed(ego.speed, delay)
                goes_on = each.name == self._braking_for and ego.speed > max(each.speed, 0.0)
                if needed > worst and (needed >= self.emergency or goes_on):
                    threat, worst = each, needed
        self._braking_for = threat.name if threat is not None else ""
        if threat is not None:
            reason = f"{threat.name} is {threat.gap:.1f} m ahead: {worst:.1f} m/s² needed, emergency braking"
            return -self.full, True, reason
        ahead = [each for each in targets if each.aside < self.clearance and each.speed > _ONCOMING]
        if not ahead:
            self._follows = False
            return math.inf, False, ""
        lead = min(ahead, key=lambda one: one.gap)
        near = lead.gap < self.standstill + self.shortest * ego.speed
        self._follows = (
            self._follows or near or lead.needed(ego.speed, self.latency) >= self.comfortable
        )
        if not self._follows:
            return math.inf, False, ""
        return (
            self.following(lead, ego, observation.target_speed),
            False,
            f"{lead.name} is {lead.gap:.1f} m ahead",
        )

    def following(self, lead: RadarTarget, ego: Participant, desired: float) -> float:
        """Acceleration (m/s²) of the ACC model behind a target, with a desired speed (m/s), before the limits of ISO 15622."""
        v, gap, closing = ego.speed, max(lead.gap, _LEAST_GAP), ego.speed - lead.speed
        dynamic = v * self.headway + v * closing / (
            2.0 * math.sqrt(self.accelerate * self.comfortable)
        )
        near = ((self.standstill + max(dynamic, 0.0)) / gap) ** 2
        free = (v / desired) ** 4 if desired > 0.0 else 1.0
        idm = self.accelerate * (1.0 - free - near)
        limited = lead._replace(acceleration=min(lead.acceleration, self.accelerate))
        constant = (
            -limited.needed(v, 0.0)
            if closing > 0.0 or limited.acceleration < 0.0
            else limited.acceleration
        )
        if idm >= constant:
            return idm
        mixed = constant + self.comfortable * math.tanh((idm - constant) / self.comfortable)
        return (1.0 - self.coolness) * idm + self.coolness * mixed

    def targets(self, observation: Observation) -> Iterator[RadarTarget]:
        """Participants in the field of view, in the order of the scenario's entities."""
        ego = observation.ego
        c, s = math.cos(ego.h), math.sin(ego.h)
        curvature = self._curvature(ego)
        for other in observation.others:
            view = outlook(ego, other)
            rear, front, right, left = spans(view, other.box)
            gap = rear - ego.box.length / 2
            x = view.x + ego.box.x
            nearest = max(right, -left, 0.0)
            if front < ego.box.length / 2 or not self._sees(gap, nearest):
                continue
            bend = curvature * x * x / 2.0
            along, across = other.vx * c + other.vy * s, other.vy * c - other.vx * s
            drift = across - curvature * x * along
            middle = view.y - bend
            half = (left - right + ego.box.width) / 2.0
            pulled = other.ax * c + other.ay * s
            yield RadarTarget(
                other.name, gap, abs(middle) - half, 2.0 * half, -drift if middle > 0.0 else drift, along, pulled
            )  # fmt: skip

    def _sees(self, ahead: float, aside: float) -> bool:
        """Whether a point ahead of the front and aside of its middle (m) is in the field of view."""
        distance = math.hypot(max(ahead, 0.0), aside)
        angle = math.degrees(math.atan2(aside, ahead)) if aside > 0.0 else 0.0
        far = distance <= self.far_range and angle <= self.far_angle
        return far or (distance <= self.near_range and angle <= self.near_angle)

    @staticmethod
    def _curvature(ego: Participant) -> float:
        """Curvature of the ego's path by its motion (1/m), positive to the left."""
        if ego.speed < _CRAWL:
            return 0.0
        found = (ego.vx * ego.ay - ego.vy * ego.ax) / ego.speed**3
        return found if abs(found) > _STRAIGHT else 0.0

    def _apply(
        self, demand: float, is_full: bool, reason: str, observation: Observation, dt: float
    ) -> Control:
        """The answer: the demand within its limits of deceleration and jerk; nothing where the scenario asks for less speed."""
        speed = observation.ego.speed
        share = min(max((speed - _SLOW) / (_FAST - _SLOW), 0.0), 1.0)
        jerk = self.jerk if is_full else self.slow_jerk + share * (self.fast_jerk - self.slow_jerk)
        brake = (
            self.full if is_full else self.slow_brake + share * (self.fast_brake - self.slow_brake)
        )
        scripted = (observation.target_speed - speed) / dt if dt > 0.0 else 0.0
        if demand >= scripted and (self._acceleration is None or self._acceleration >= 0.0):
            self._acceleration, self._follows = None, False
            return Control()
        before = (
            self._acceleration
            if self._acceleration is not None
            else min(observation.ego.acceleration, 0.0)
        )
        wanted = max(min(demand, scripted), -brake)
        release = max(jerk, self.jerk if before < -brake else 0.0)
        after = max(min(wanted, before + release * dt), before - jerk * dt)
        if speed <= 0.0 and after < 0.0:
            after = 0.0
        self._acceleration = after
        return Control(acceleration=after, reason=reason or "the way is free")
