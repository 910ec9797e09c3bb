"""Remarks on entities that never appear, a missing ego, and an ego that stands, leaves the road or
reaches its end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from schemas.common.remarks import Remark
from xosc.rules.references import ENTITY_POSITION_UID

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from runner.engine.compile.protocols import Run
    from runner.engine.participants.entity import Entity
    from runner.recording import Track
    from xodr.model import LaneSection

_SLEEPLESS = 8
"""Steps from one try to find out how far the ego is from the road's edge to the next"""


def absences(scenario: Path, entities: Iterable[Entity]) -> tuple[str, ...]:
    """A remark on each entity of a scenario's file that no action has put anywhere in a run, its
    trailers left out."""
    absent = (
        entity for entity in entities if not entity.placed and entity.controls.tractor is None
    )
    return tuple(str(absence(scenario, entity)) for entity in absent)


def absence(scenario: Path, entity: Entity, cause: str = "") -> Remark:
    """The remark on an entity of a scenario's file that no action places; cause as in `Remark`."""
    declared = entity.declared.node.parent if entity.declared.node is not None else None
    text = f"{entity.name!r} never appears: no action of this run gives it a position"
    return Remark(
        ENTITY_POSITION_UID,
        text,
        str(scenario),
        declared.line if declared is not None else None,
        cause,
    )


def standstill(ego: Track | None, system: str) -> tuple[str, ...]:
    """A remark where nothing has set the ego in motion: a verdict on such a run says little.

    Args:
        ego: its recording; None without an ego.
        system: name of the system under test, `none` for none.
    """
    if ego is None or len(ego.columns["time"]) < 2 or ego.columns["speed"].any():
        return ()
    nothing = "nothing" if system == "none" else f"neither the scenario nor {system}"
    driver = "" if system == "sumo" else "; SUMO's driver would drive it (--sut sumo)"
    return (f"{ego.name} stands during the whole run: {nothing} sets it in motion{driver}",)


def jolts(tracks: Iterable[Track]) -> tuple[str, ...]:
    """Return a remark on each vehicle that stops dead, in a step that takes more than any brake, at
    the first such step.

    Scripted steps of the speed are changes of state and have no acceleration: only tracks that the
    end of a road stopped are to be given.
    """
    import numpy as np

    # A brake reaches about 10 m/s²; a loss of speed above `_JOLT` is a model that ends, not a
    # vehicle.
    found = []
    for track in tracks:
        time, speed = track.columns["time"][1:], np.abs(track.columns["speed"][1:])
        if track.kind != "vehicle" or len(time) < 2:
            continue
        change, step = np.diff(speed), np.diff(time)
        beyond = np.flatnonzero((-change > _JOLT * step) & (-change > _ROUNDING))
        if beyond.size:
            row = int(beyond[0])
            told = f"{track.name} stops dead at the end of its road at {time[row + 1]:.2f} s"
            found.append(
                f"{told}: {change[row]:.2f} m/s within {step[row]:.2f} s is beyond physics"
            )
    return tuple(found)


def egoless(
    entities: Iterable[Entity], system: str, contacts: Sequence[tuple[float, str, str]] = ()
) -> tuple[str, ...]:
    """A sentence on a scenario without an ego, if nothing is driven by the system, or no contact
    can fail.

    Args:
        entities: those of the scenario.
        system: name of the system under test that was asked for, `none` for none.
        contacts: time (s) and names of the entities, in order.
    """
    there = list(entities)
    if not there:
        return ("the scenario has no participants: nothing happens in it",)
    vehicles = [entity.name for entity in there if entity.declared.kind == "vehicle"]
    effects = [f"{system} drives nobody"] if system != "none" else []
    effects += [
        f"{first} touches {second} at {time:.2f} s, which fails nothing"
        for time, first, second in contacts[:1]
    ]
    if not effects:
        return ()
    if not vehicles:
        return (f"the scenario has no vehicle: {', and '.join(effects)}",)
    return (
        (
            f"no vehicle is known to be the ego: {', and '.join(effects)}; --ego {vehicles[0]} "
            "would make it that"
        ),
    )


_JOLT, _ROUNDING = 25.0, 1.0
"""Acceleration (m/s²) that no road vehicle reaches, and change of speed (m/s) that may be rounding
"""


class Departures:
    """Notes in the event log when the ego leaves the road, is back on it, and stops where it ends;
    to be called once a step."""

    def __init__(self, ego: Entity | None) -> None:
        self._ego = ego
        self._off = self._ended = False
        self.first: dict[str, tuple[float, str]] = {}
        """Time (s) and sentence on the first time that it left the road (`offRoad`), and came to
        its end (`roadEnd`)"""
        self._judged, self._x, self._y, self._clearance = -1, 0.0, 0.0, 0.0
        """where it was found well on the road, while `Run.changes` was that, and how far from there
        it has not left it"""
        self._section: LaneSection | None = None
        self._lane, self._offset = 0, 0.0
        """where it was found within a lane that keeps its width"""

    @property
    def remarks(self) -> tuple[str, ...]:
        """One sentence on the first time that it left the road, and one on the first time that it
        came to its end."""
        return tuple(text for _, text in self.first.values())

    def __call__(self, run: Run) -> None:
        """Observe the ego, if there is one."""
        ego = self._ego
        if ego is None or not (ego.active and ego.placed):
            return
        # Two shortcuts for an ego known to be well on the road: it is still in the lane section and
        # at the offset judged before, or has not moved further than its clearance.
        if ego.on_lane:
            kept = ego.kept_lane == self._lane and ego.kept_offset == self._offset
            if ego.section is self._section and kept and not ego.at_road_end:
                return
        elif self._judged == run.changes and self._is_clear(ego):
            return
        off, ended = run.roads.is_off_road(ego), ego.at_road_end
        if off and not self._off:
            self._remark(run, ego, "offRoad", "has left the road")
        elif self._off and not off:
            run.note("onRoad", ego.name, "is back on the road")
        if ended and not self._ended:
            self._remark(run, ego, "roadEnd", "has come to the end of the road")
        self._off, self._ended = off, ended
        if off or ended:
            self._section = None
        # Finding the clearance costs more than judging once, so it is tried in some steps only.
        elif run.step_index % _SLEEPLESS:
            return
        elif ego.on_lane:
            self._section = ego.section if run.roads.is_within_lane(ego) else None
            self._lane, self._offset = ego.kept_lane, ego.kept_offset
        else:
            self._judged, self._x, self._y, self._clearance = (
                run.changes,
                ego.x,
                ego.y,
                run.roads.clearance(ego),
            )

    def _is_clear(self, ego: Entity) -> bool:
        """Whether it still can't have left the road."""
        return (
            not ego.at_road_end and math.hypot(ego.x - self._x, ego.y - self._y) < self._clearance
        )

    def _remark(self, run: Run, ego: Entity, kind: str, text: str) -> None:
        run.note(kind, ego.name, text)
        self.first.setdefault(kind, (run.time, f"{ego.name} {text} at {run.time:.2f} s"))
