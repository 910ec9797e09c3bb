"""Continuity of motion: limits of the Performance, heights, participants that vanish or jump, the
end of a run.

A run says little about participants that move as no vehicle does, that are taken away before the
ego reaches them, or that the end of the run leaves a moment before a contact.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from runner.engine.participants.boxes import Spot, entry, outlook, vertical_gap
from runner.engine.participants.entity import JUMP
from runner.judging.measures.measure import GREATEST_DECELERATION
from runner.systems.drivers import SystemDriver

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from runner.engine.compile.compiler import Scenario
    from runner.engine.participants.entity import Entity
    from runner.recording import Recording, Track
    from xodr.graph.network import RoadNetwork

TOLERANCE = 1.01
"""Share of a limit of the Performance above which it is exceeded"""
SUSTAINED = 0.5
"""Time (s) for which an acceleration must last: a change within a step is a change of state, and
has none"""
APPROACH = 5.0
"""Time (s) within which the ego and another would touch at their velocities: the ego approaches it
"""
ALOFT = 5.0
"""Height (m) above or below the road's surface at which nothing stands on it"""
_ASTRAY = 5.0
"""Distance (m) between reference point and bounding box beyond which they are not of one object"""


class PredictedContact(NamedTuple):
    """A contact to come.

    Attributes:
        after: time until then, s.
        speed: relative speed, m/s.
        other: name of the other participant.
    """

    after: float
    speed: float
    other: str

    @property
    def reserve(self) -> float:
        """Greatest deceleration of tyres, as a multiple of the least one that avoids it; below 1
        none does."""
        needed = self.speed / (2.0 * self.after) if self.after > 0.0 else math.inf
        return GREATEST_DECELERATION / needed if needed else math.inf


NEVER = PredictedContact(math.inf, 0.0, "")
"""No contact"""


def beyond_performance(
    scenario: Scenario, recording: Recording, ego: Entity | None
) -> Iterator[str]:
    """Sentences on participants faster than their Performance, an ego that changes its speed faster
    or jumps.

    Others may: `SynchronizeAction`, whose purpose is to arrive in time, is bounded by no
    Performance.
    """
    driver = ego.controls.driver if ego is not None else None
    if isinstance(driver, SystemDriver) and driver.implausible:
        yield f"{driver.implausible}: no vehicle moves so"
    for track in recording.tracks.values():
        entity = scenario.entities.get(track.name)
        if entity is None or not len(track.columns["time"]):
            continue
        limits, node = entity.declared.performance, entity.declared.node
        where = f"{node.where}: " if node is not None else ""
        speed, time = np.abs(track.columns["speed"]), track.columns["time"]
        fast = np.flatnonzero(speed > TOLERANCE * limits.max_speed)
        if fast.size:
            told = f"drives at {speed[fast[0]]:.2f} m/s at {time[fast[0]]:.2f} s"
            yield f"{where}{track.name} {told}; its Performance allows {limits.max_speed:g} m/s"
        # One sentence for each participant: an excess of speed tells more than one of its rate.
        elif entity is ego:
            yield from _hasty(track, limits.max_acceleration, limits.max_deceleration, where)


def _hasty(track: Track, most: float, least: float, where: str) -> Iterator[str]:
    """Changes of speed beyond the limits (m/s²) in each step of `SUSTAINED`."""
    speed, time = np.abs(track.columns["speed"]), track.columns["time"]
    steps = round(SUSTAINED / (time[1] - time[0])) if len(time) > 1 else 0
    if not 0 < steps < len(time):
        return
    rate = np.diff(speed) / np.diff(time)
    change = np.lib.stride_tricks.sliding_window_view(rate, steps)
    # A whole window exceeds a limit only if its least rate does.
    sides = (
        ("accelerates", most, change.min(axis=1)),
        ("brakes", least, (-change).min(axis=1)),
    )
    for word, limit, found in sides:
        over = np.flatnonzero(found > TOLERANCE * limit)
        if over.size:
            told = f"{word} by {found[over[0]]:.2f} m/s² at {time[over[0]]:.2f} s"
            yield f"{where}{track.name} {told}; its Performance allows {limit:g} m/s²"
            return


def displaced(scenario: Scenario, recording: Recording) -> Iterator[str]:
    """Sentences on participants that begin far above or below the road, or far from their box."""
    for track in recording.tracks.values():
        entity = scenario.entities.get(track.name)
        if entity is None or not len(track.columns["time"]):
            continue
        node = entity.declared.node
        where = f"{node.where}: " if node is not None else ""
        yield from displaced_boxes([entity])
        height = 0.0
        # Miscellaneous objects, such as gantries, may hang above the road.
        if scenario.network is not None and track.kind != "miscellaneous":
            x, y, z, h = (float(track.columns[name][0]) for name in ("x", "y", "z", "h"))
            height = above_road(scenario.network, x, y, z, h)
        if abs(height) > ALOFT:
            side = "above" if height > 0.0 else "below"
            yield f"{where}{track.name} begins {abs(height):.2f} m {side} the road"


def displaced_boxes(entities: Iterable[Entity]) -> Iterator[str]:
    """Sentences on participants with a reference point far from their box."""
    for entity in entities:
        box, node = entity.box, entity.declared.node
        where = f"{node.where}: " if node is not None else ""
        # 0 or less as long as the reference point lies within the box along that axis.
        beside = max(
            abs(box.x) - box.length / 2, abs(box.y) - box.width / 2, abs(box.z) - box.height / 2
        )
        if entity.declared.kind != "miscellaneous" and beside > _ASTRAY:
            yield (
                f"{where}the bounding box of {entity.name} lies {beside:.2f} m beside its "
                "reference point"
            )


def above_road(network: RoadNetwork, x: float, y: float, z: float, h: float) -> float:
    """Height (m) of a pose above the road under it; 0 where there is none."""
    point = network.locate(x, y, z, h)
    return z - float(network.pose(point).z) if network.on_road(point) else 0.0


def interrupted(
    scenario: Scenario, recording: Recording, ego: Entity | None, end: float
) -> Mapping[str, str]:
    """Sentences by name on an ego that was taken away, and on encounters with it that vanishing or
    a jump ended.

    Args:
        end: time of the run's last row, s.
    """
    own = recording.tracks.get(ego.name) if ego is not None else None
    if ego is None or own is None:
        return {}
    reasons: dict[str, str] = {}
    half = recording.timestep / 2
    left = float(own.columns["time"][-1])
    if left < end - half:
        reasons[ego.name] = (
            f"{ego.name} was removed at {left:.2f} s, {end - left:.2f} s before the end"
        )
    jumps = _jumps(own)
    for track in recording.tracks.values():
        if track is own or track.name not in scenario.entities:
            continue
        last = float(track.columns["time"][-1])
        moments = [(time, f"{track.name} was put elsewhere") for time in _jumps(track)]
        moments += [(time, f"{ego.name} was put elsewhere") for time in jumps]
        # Participants that outlast the ego were not taken from it; times differ by whole steps.
        if last < min(end, left) - half:
            moments.append((last, f"{track.name} was removed"))
        for time, text in moments:
            contact = contact_after(own, track, time)
            if contact.after <= APPROACH:
                told = (
                    f"{text} at {time:.2f} s, {contact.after:.2f} s before "
                    f"{ego.name} would touch it"
                )
                reasons.setdefault(track.name, told)
    return reasons


def _jumps(track: Track) -> list[float]:
    """Times (s) of the rows before jumps of a participant."""
    columns = track.columns
    time, speed = columns["time"], np.abs(columns["speed"])
    if len(time) < 2:
        return []
    way = np.linalg.norm([np.diff(columns[axis]) for axis in "xyz"], axis=0)
    # The speed may have changed within the step; `JUMP` is what scripted steps may add.
    most = np.maximum(speed[1:], speed[:-1]) * np.diff(time) + JUMP
    return [float(time[row]) for row in np.flatnonzero(way > most)]


def contact_at_end(recording: Recording, ego: Entity | None, end: float) -> PredictedContact:
    """First contact of the ego after the end of a run, at the velocities of the end.

    Its time is infinite where there is none.
    """
    own = recording.tracks.get(ego.name) if ego is not None else None
    others = [track for track in recording.tracks.values() if track is not own]
    contact = [contact_after(own, other, end) for other in others] if own is not None else []
    return min(contact, default=NEVER)


def contact_after(own: Track, other: Track, time: float) -> PredictedContact:
    """The contact of two participants that keep their velocities from an instant (s) on.

    Participants that are not both there at the instant, or that touch already, have none.
    """
    mine, its = _row(own, time), _row(other, time)
    if mine is None or its is None:
        return NEVER
    return next_contact(mine, its, other.name)


def next_contact(own: tuple[Spot, float], other: tuple[Spot, float], name: str) -> PredictedContact:
    """The contact of two boxes that keep their headings and speeds (m/s), the other one of that
    name."""
    (a, va), (b, vb) = own, other
    # Velocities are horizontal: what passes above the ego now will not touch it.
    if vertical_gap(a, b) > 0.0:
        return NEVER
    seen = outlook(a, b)
    vx, vy = vb * math.cos(b.h) - va * math.cos(a.h), vb * math.sin(b.h) - va * math.sin(a.h)
    c, s = math.cos(a.h), math.sin(a.h)
    after = entry(seen, a.box, b.box, vx * c + vy * s, vy * c - vx * s)
    return PredictedContact(after, math.hypot(vx, vy), name) if 0.0 < after < math.inf else NEVER


def _row(track: Track, time: float) -> tuple[Spot, float] | None:
    """Box and speed (m/s) of a participant at a time (s); None where it is not there."""
    columns = track.columns
    # Times are rounded to ns: a time that a caller works out may differ from the row's.
    row = int(np.searchsorted(columns["time"], time - 1e-6))
    if row >= len(columns["time"]) or columns["time"][row] > time + 1e-6:
        return None
    x, y, z, h = (float(columns[name][row]) for name in ("x", "y", "z", "h"))
    return Spot(x, y, z, h, track.box), float(columns["speed"][row])
