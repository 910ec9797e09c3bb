"""`adas`: adaptive cruise control with emergency braking, seen by a radar."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.engine.participants.boxes import outlook, spans
from runner.engine.participants.outlines import extents, seen_by
from runner.systems.arrays import BatchControl
from runner.systems.base import Control, Observation, Participant
from runner.systems.encounters import (
    choose,
    greatest,
    least,
    ratio,
    tanh,
)
from runner.systems.kinds.reference import HARDEST, JERK

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation, BatchParticipants
    from schemas.common.array_types import BoolArray, FloatArray, IntArray

Extent = tuple[Any, Any, Any, Any]
"""Least and greatest x, least and greatest y of a box in the ego's frame, m; numbers or arrays"""

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
"""Speed (m/s) below which the curvature of the path is not known: it is the lateral acceleration
over the squared speed"""
_ONCOMING = -0.5
"""Speeds along the ego's path below this (m/s) are those of oncoming traffic"""
_ROUNDING = 1e-9
"""Rounding of times, s"""
_LEAST_GAP = 0.1
"""Gap (m) below which a required deceleration has no meaning any more"""


class RadarTarget(NamedTuple):
    """A participant in the field of view, in coordinates along the ego's predicted path.

    Numbers, or arrays of them over many runs.

    Args:
        name: the participant's name.
        gap: from the ego's front to its rear, m.
        aside: lateral gap to the ego's swath, m; negative where it is in it.
        width: its lateral extent and the ego's, together, m.
        approach: rate at which the lateral gap shrinks, m/s.
        speed, acceleration: along the path, m/s and m/s².
    """

    name: str
    gap: Any
    aside: Any
    width: Any
    approach: Any
    speed: Any
    acceleration: Any

    def at(self, places: Any) -> RadarTarget:
        """Targets at some places (m,) of arrays (p, n)."""
        return RadarTarget("", *(values[places] for values in self[1:]))

    def is_in_way(self, speed: Any, clearance: float) -> Any:
        """Whether it is in the swath when an ego of that speed (m/s) reaches it, widened by a
        clearance (m)."""
        time = ratio(greatest(self.gap, 0.0), speed - self.speed, 0.0)
        left = self.aside - self.approach * time
        return (-self.width - clearance < left) & (left < clearance)

    def needed(self, speed: Any, delay: float) -> Any:
        """Constant deceleration (m/s²) that avoids the collision if braking begins after a delay
        (s); 0 where none is needed.

        A target that brakes is taken to brake on until it stands; one that approaches to keep its
        speed.
        """
        return needed_deceleration(self.gap, self.speed, self.acceleration, speed, delay)


def needed_deceleration(
    gap: Any, its_speed: Any, its_acceleration: Any, speed: Any, delay: float
) -> Any:
    """`RadarTarget.needed` for a gap (m), a target's speed (m/s) and acceleration (m/s²)."""
    closing = speed - its_speed
    twice = 2.0 * greatest(gap - greatest(closing, 0.0) * delay, _LEAST_GAP)
    # A target that speeds up is taken at its speed: its acceleration may end at any time.
    braking = greatest(-its_acceleration, 0.0)
    faster = choose(closing > 0.0, braking + closing * closing / twice, 0.0)
    # it stands before it is reached
    stands = (braking > 0.0) & (its_speed * closing <= twice * braking)
    way = twice + ratio(its_speed * its_speed, braking, 0.0)
    behind = choose(stands, speed * speed / way, faster)
    return choose(its_speed < 0.0, speed * closing / twice, behind)


@dataclass
class DriverAssistance:
    """Brakes comfortably behind a target and then keeps a time gap, and brakes fully where that is
    not enough.

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

    sensors = True
    """It may see through a `runner.systems.encounters.SensorModel`"""
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

    def __post_init__(self) -> None:
        fields = (self.far_range, self.far_angle), (self.near_range, self.near_angle)
        # A negative range sees nothing: its sign survives the square.
        self._fields = [
            (reach * abs(reach), math.sin(math.radians(angle)), math.cos(math.radians(angle)))
            for reach, angle in fields
        ]
        """squared ranges (m²) of the fields of view, and sine and cosine of their half angles"""
        self._delay = self.latency + self.full / (2.0 * self.jerk)
        """time (s) from a change in traffic to full braking, the half of their build-up included"""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._pending: deque[tuple[float, float, bool, str]] = deque()
        self._acceleration: float | None = None
        self._braking_for = ""
        self._follows = False

    def control(self, observation: Observation, dt: float) -> Control:
        """Acceleration with its reason while it follows or brakes, else nothing."""
        ego, time = observation.ego, observation.time
        # The radar looks ahead: reversing stays with the scenario.
        if ego.speed < 0.0 or observation.target_speed < 0.0:
            return Control()
        self._pending.append((time, *self._decide(ego, observation)))
        # Until a first decision is due, traffic calls for nothing.
        demand, is_full, reason = math.inf, False, ""
        while self._pending and self._pending[0][0] <= time - self.latency + _ROUNDING:
            _, demand, is_full, reason = self._pending.popleft()
        scripted = (observation.target_speed - ego.speed) / dt if dt > 0.0 else 0.0
        before = self._acceleration
        if self.lets_go(demand, scripted, before is None, before or 0.0):
            self._acceleration, self._follows = None, False
            return Control()
        # From braking at most: the limit of jerk must not begin at an acceleration of the scenario.
        if before is None:
            before = least(ego.acceleration, 0.0)
        self._acceleration = after = self.limited(
            least(demand, scripted), is_full, before, ego.speed, dt
        )
        return Control(acceleration=after, reason=reason or "the way is free")

    def reset_batch(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Forget the last runs."""
        n = len(seeds)
        # Decisions of the latency, and one at either end of it.
        self._delayed = _Delayed(n, math.ceil(self.latency / timestep) + 2)
        self._acts, self._accelerations = np.zeros(n, bool), np.zeros(n)
        self._threats = np.full(n, -1)
        """rows of the participants for which it brakes fully; −1 for none"""
        self._followers = np.zeros(n, bool)

    def control_batch(self, observations: BatchObservation, dt: float) -> BatchControl:
        """`control` in many runs."""
        forwards = (observations.ego.speed >= 0.0) & (observations.target_speed >= 0.0)
        wanted, acts = np.zeros(len(forwards)), np.zeros(len(forwards), bool)
        places = np.flatnonzero(forwards)
        seen = observations if len(places) == len(forwards) else observations.take(places)
        if places.size:
            wanted[places], acts[places] = self._drive(seen, dt)
        return BatchControl(wanted, acts)

    def _drive(self, seen: BatchObservation, dt: float) -> tuple[FloatArray, BoolArray]:
        """Acceleration (n,), and where it counts (n,), of egos that drive forwards."""
        run, ego = seen.run, seen.ego
        demand, is_full = self._delayed.pass_on(
            run, seen.time, *self._decide_arrays(seen), self.latency
        )
        scripted = (seen.target_speed - ego.speed) / dt if dt > 0.0 else np.zeros(len(run))
        acts, before = self._acts[run], self._accelerations[run]
        free = self.lets_go(demand, scripted, ~acts, before)
        rows, after = np.flatnonzero(~free), np.zeros(len(run))
        held = np.where(acts[rows], before[rows], least(ego.acceleration[rows], 0.0))
        asked = least(demand[rows], scripted[rows])
        after[rows] = self.limited(asked, is_full[rows], held, ego.speed[rows], dt)
        self._acts[run], self._accelerations[run] = ~free, after
        self._followers[run] &= ~free
        return after, ~free

    def _decide(self, ego: Participant, observation: Observation) -> tuple[float, bool, str]:
        """Acceleration that the traffic calls for (infinite: none), whether it is full braking, and
        the reason."""
        targets = list(self.targets(observation))
        threat, worst, delay = None, 0.0, self._delay
        for target in targets:
            if target.is_in_way(ego.speed, self.clearance):
                needed = target.needed(ego.speed, delay)
                is_braking_for = target.name == self._braking_for
                if needed > worst and self.is_emergency(target, needed, ego.speed, is_braking_for):
                    threat, worst = target, needed
        self._braking_for = threat.name if threat is not None else ""
        if threat is not None:
            reason = (
                f"{threat.name} is {threat.gap:.1f} m ahead: {worst:.1f} m/s² "
                "needed, emergency braking"
            )
            return -self.full, True, reason
        ahead = [target for target in targets if self.is_lead(target)]
        if not ahead:
            self._follows = False
            return math.inf, False, ""
        lead = min(ahead, key=lambda one: one.gap)
        self._follows = self._follows or self.begins_to_follow(lead, ego.speed)
        if not self._follows:
            return math.inf, False, ""
        return (
            self.following(lead, ego.speed, observation.target_speed),
            False,
            f"{lead.name} is {lead.gap:.1f} m ahead",
        )

    def _decide_arrays(self, seen: BatchObservation) -> tuple[FloatArray, BoolArray]:
        """`_decide` in many runs (n,)."""
        run, speed = seen.run, seen.ego.speed
        sees, targets = self.targets_arrays(seen)
        n = len(run)
        if not len(sees):
            self._threats[run], self._followers[run] = -1, False
            return np.full(n, np.inf), np.zeros(n, bool)
        # What is costly is worked out where it decides only.
        in_way = np.nonzero(sees & targets.is_in_way(speed, self.clearance))
        dangers, own = targets.at(in_way), speed[in_way[1]]
        needed = dangers.needed(own, self._delay)
        is_braking_for = in_way[0] == self._threats[run[in_way[1]]]
        urgent = (needed > 0.0) & self.is_emergency(dangers, needed, own, is_braking_for)
        worst = np.zeros(sees.shape)
        worst[in_way] = np.where(urgent, needed, 0.0)
        is_full: Any = worst.any(axis=0)
        self._threats[run] = np.where(is_full, worst.argmax(axis=0), -1)
        gaps = np.where(sees & self.is_lead(targets), targets.gap, np.inf)
        led = np.isfinite(gaps.min(axis=0)) & ~is_full
        rows, row = np.flatnonzero(led), gaps.argmin(axis=0)
        lead = targets.at((row[rows], rows))
        before = self._followers[run]
        follows = before[rows] | self.begins_to_follow(lead, speed[rows])
        # Full braking leaves the follower's state as it was, as `_decide` does by its early return.
        self._followers[run] = before & is_full
        self._followers[run[rows]] = follows
        rows = rows[follows]
        lead = targets.at((row[rows], rows))
        wanted = np.where(is_full, -self.full, np.inf)
        wanted[rows] = self.following(lead, speed[rows], seen.target_speed[rows])
        return wanted, is_full

    # the law, of numbers or of arrays over runs ----------------------------------------------

    def is_emergency(self, each: RadarTarget, needed: Any, speed: Any, is_braking_for: Any) -> Any:
        """Whether a target in the way calls for full braking by a needed deceleration (m/s²), or
        for more of it."""
        # Braking that stopped at the threshold would begin anew in the next step, and pulse.
        goes_on = is_braking_for & (speed > greatest(each.speed, 0.0))
        return (needed >= self.emergency) | goes_on

    def is_lead(self, each: RadarTarget) -> Any:
        """Whether a target is in the path and not oncoming."""
        return (each.aside < self.clearance) & (each.speed > _ONCOMING)

    def begins_to_follow(self, lead: RadarTarget, speed: Any) -> Any:
        """Whether a target is too near, or calls for comfortable braking."""
        near = lead.gap < self.standstill + self.shortest * speed
        return near | (lead.needed(speed, self.latency) >= self.comfortable)

    def following(self, lead: RadarTarget, v: Any, desired: Any) -> Any:
        """Acceleration (m/s²) of the ACC model behind a target, at a speed and with a desired one
        (m/s), before the limits of ISO 15622."""
        gap, closing = greatest(lead.gap, _LEAST_GAP), v - lead.speed
        dynamic = v * self.headway + v * closing / (
            2.0 * math.sqrt(self.accelerate * self.comfortable)
        )
        near = ((self.standstill + greatest(dynamic, 0.0)) / gap) ** 2
        share = ratio(v, desired, 1.0)
        free = (share * share) ** 2
        idm = self.accelerate * (1.0 - free - near)
        its = least(lead.acceleration, self.accelerate)
        needed = needed_deceleration(lead.gap, lead.speed, its, v, 0.0)
        # Constant-acceleration heuristic (Kesting et al.): what is needed if the lead goes on so.
        constant = choose((closing > 0.0) | (its < 0.0), -needed, its)
        mixed = constant + self.comfortable * tanh((idm - constant) / self.comfortable)
        mixed = (1.0 - self.coolness) * idm + self.coolness * mixed
        # The heuristic only tempers the model's braking: where that is milder, the model counts.
        return choose(idm >= constant, idm, mixed)

    def lets_go(self, demand: Any, scripted: Any, is_free: Any, acceleration: Any) -> Any:
        """Whether the scenario's acceleration (m/s²) applies: it asks for no more than the demand,
        and the system does not brake."""
        return (demand >= scripted) & (is_free | (acceleration >= 0.0))

    def limited(self, demand: Any, is_full: Any, before: Any, speed: Any, dt: float) -> Any:
        """A demand (m/s²) within its limits of deceleration and jerk, dt (s) after an acceleration
        before."""
        share = least(greatest((speed - _SLOW) / (_FAST - _SLOW), 0.0), 1.0)
        slow_jerk = self.slow_jerk + share * (self.fast_jerk - self.slow_jerk)
        jerk = choose(is_full, self.jerk, slow_jerk)
        slow_brake = self.slow_brake + share * (self.fast_brake - self.slow_brake)
        # ISO 15622 limits following: full braking has a deceleration and a jerk of its own.
        brake = choose(is_full, self.full, slow_brake)
        wanted = greatest(demand, -brake)
        # Coming from full braking, following's limits are reached as fast as the brakes release.
        release = greatest(jerk, choose(before < -brake, self.jerk, 0.0))
        after = greatest(least(wanted, before + release * dt), before - jerk * dt)
        # Brakes hold a standing ego: they do not reverse it.
        return choose((speed <= 0.0) & (after < 0.0), 0.0, after)

    # the radar -------------------------------------------------------------------------------

    def targets(self, observation: Observation) -> Iterator[RadarTarget]:
        """Participants in the field of view, in the order of the scenario's entities."""
        ego = observation.ego
        c, s = math.cos(ego.h), math.sin(ego.h)
        curvature, half = self._curvature(ego), ego.box.length / 2
        for other in observation.others:
            view = outlook(ego, other)
            extent = spans(view, other.box)
            if extent[1] >= half and self._sees(extent, half):
                yield self._target(view.x, view.y, extent, ego, other, (c, s), curvature)

    def targets_arrays(self, seen: BatchObservation) -> tuple[BoolArray, RadarTarget]:
        """Participants in many runs (p, n): mask of the field of view, and all as targets."""
        ego, others = seen.ego, seen.others
        view = seen_by(ego, others)
        extent = extents(view, others.box)
        half = ego.box.length / 2
        sees = others.present & (extent[1] >= half) & self._sees(extent, half)
        target = self._target(view.x, view.y, extent, ego, others, ego.facing, self._curvature(ego))
        return sees, target

    def _target(
        self, x: Any, y: Any, extent: Extent, ego: Any, other: Any, facing: Any, curvature: Any
    ) -> RadarTarget:
        """A participant with its centre at x and y, m."""
        rear, _, right, left = extent
        c, s = facing
        ahead = x + ego.box.x
        along, across = other.vx * c + other.vy * s, other.vy * c - other.vx * s
        # The predicted path is y = κx²/2 for small angles, with the direction κx.
        drift = across - curvature * ahead * along
        middle = y - curvature * ahead * ahead / 2.0
        half = (left - right + ego.box.width) / 2.0
        return RadarTarget(
            other.name,
            rear - ego.box.length / 2,
            abs(middle) - half,
            2.0 * half,
            choose(middle > 0.0, -drift, drift),
            along,
            other.ax * c + other.ay * s,
        )

    def _sees(self, extent: Extent, half: Any) -> Any:
        """Whether the nearest point of a box, ahead of the ego's front (at half its length), is in
        the field of view."""
        rear, _, right, left = extent
        ahead, aside = rear - half, greatest(greatest(right, -left), 0.0)
        before, is_in_line = greatest(ahead, 0.0), aside == 0.0
        squared = before * before + aside * aside
        (far, sine, cosine), (near, near_sine, near_cosine) = self._fields
        is_far = (squared <= far) & (is_in_line | (ahead * sine >= aside * cosine))
        is_near = (squared <= near) & (is_in_line | (ahead * near_sine >= aside * near_cosine))
        return is_far | is_near

    @staticmethod
    def _curvature(ego: Any) -> Any:
        """Curvature of the ego's path by its motion (1/m), positive to the left."""
        cubed = choose(ego.speed < _CRAWL, 0.0, ego.speed * ego.speed * ego.speed)
        curvature = ratio(ego.vx * ego.ay - ego.vy * ego.ax, cubed, 0.0)
        return choose(abs(curvature) > _STRAIGHT, curvature, 0.0)


class _Delayed:
    """Decisions of many runs that take effect later.

    Args:
        n: runs.
        most: decisions of a run at once.
    """

    def __init__(self, n: int, most: int) -> None:
        self._most = most
        self._first, self._end = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._time, self._demand = np.zeros(n * most), np.zeros(n * most)
        self._is_full = np.zeros(n * most, bool)

    def pass_on(
        self,
        run: IntArray,
        time: FloatArray,
        demand: FloatArray,
        is_full: BoolArray,
        latency: float,
    ) -> tuple[FloatArray, BoolArray]:
        """Add the decisions of runs at times (n,), s, and return the decisions of a latency (s)
        before; infinite without one."""
        begin = run * self._most
        place = begin + self._end[run] % self._most
        self._time[place], self._demand[place], self._is_full[place] = time, demand, is_full
        self._end[run] += 1
        found, full = np.full(len(run), np.inf), np.zeros(len(run), bool)
        while True:
            first = self._first[run]
            place = begin + first % self._most
            due = (first < self._end[run]) & (self._time[place] <= time - latency + _ROUNDING)
            if not due.any():
                return found, full
            found = np.where(due, self._demand[place], found)
            full = np.where(due, self._is_full[place], full)
            self._first[run[due]] += 1
