"""Rows of the evidence of runs: name, unit, least value, and how each is counted.

`ROWS` is the one table of them; `runner.judging.evidence` makes verdicts of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.compile.protocols import Transition
from runner.engine.storyboard.departures import absence, egoless, standstill
from runner.engine.storyboard.driver import EgoDriver
from runner.judging.evidence.continuity import (
    APPROACH,
    beyond_performance,
    contact_at_end,
    displaced,
    interrupted,
)
from runner.judging.evidence.progress import (
    end_of,
    ended_idle,
    endless,
    first_event,
    idle,
    left_out,
    mishap_awaited,
    out_of_time,
    scene_events,
    unmet,
    without_effect,
)
from runner.judging.result import Cause
from runner.systems.drivers import scripted_at_start

if TYPE_CHECKING:
    from runner.engine.compile.compiler import Scenario
    from runner.engine.participants.entity import Entity
    from runner.engine.storyboard.departures import Departures
    from runner.engine.storyboard.simulation import Simulation
    from runner.judging.criteria.criterion import CriterionResult
    from runner.recording import Recording
    from schemas.common.remarks import Remark


@dataclass(frozen=True)
class Observed:
    """A run that has ended, or has just begun, as evidence is counted from it.

    Args:
        scenario: the compiled scenario.
        sim: its run.
        recording: of the run so far.
        departures: observer of the ego on the road.
        ego: None where there is none.
        system: name of the system under test that was asked for, `none` for none.
        criteria: results of the scenario's criteria.
        ended: whether the run has ended.
    """

    scenario: Scenario
    sim: Simulation
    recording: Recording
    departures: Departures
    ego: Entity | None
    system: str
    criteria: Sequence[CriterionResult] = ()
    ended: bool = True

    @property
    def ego_seconds(self) -> float:
        """Time with the ego in the world, s."""
        track = self.recording.tracks.get(self.ego.name) if self.ego is not None else None
        rows = len(track.columns["time"]) if track is not None else 0
        # n rows are n - 1 steps.
        return max(rows - 1, 0) * self.sim.dt


class Count(NamedTuple):
    """One number of evidence.

    Attributes:
        value: in the unit of its row.
        planned: number that was to be reached, where the value is a share of it or a part of it.
        texts: what is missing, with file and line where there is one.
    """

    value: float
    planned: int | None = None
    texts: tuple[str, ...] = ()


class Row(NamedTuple):
    """One kind of evidence.

    Attributes:
        name: for `--least` and results.
        cause: name of the cause for which a run without it is inconclusive.
        unit: `s`, `share` (0 to 1), `yes` (1, or 0 for no), or the things that are counted.
        least: value from which on it is enough.
        meaning: how it is counted.
        missing: when a run is inconclusive by it.
        early: whether a dry run knows it.
        within: name of the row whose lack explains that of this one, which is then left out; empty
            for none.
        of: function that counts it; None where it says nothing about a run.
    """

    name: str
    cause: str
    unit: str
    least: float
    meaning: str
    missing: str
    early: bool
    within: str
    of: Callable[[Observed], Count | None]


ROWS: dict[str, Row] = {}
"""All kinds of evidence by name, in the order in which causes are named"""


def _row(
    name: str,
    cause: str,
    unit: str,
    least: float,
    meaning: str,
    missing: str,
    *,
    early: bool = False,
    within: str = "",
) -> Callable[[Callable[[Observed], Count | None]], Callable[[Observed], Count | None]]:
    """Register a function as a row of the table."""

    def register(count: Callable[[Observed], Count | None]) -> Callable[[Observed], Count | None]:
        ROWS[name] = Row(name, cause, unit, least, meaning, missing, early, within, count)
        return count

    return register


def _sound(texts: Iterable[str]) -> Count:
    """The count of a row that is yes or no."""
    found = tuple(dict.fromkeys(texts))
    return Count(0.0 if found else 1.0, None, found)


def _share(done: int, planned: int, texts: Iterable[str] = ()) -> Count:
    """Count of a row that is a share of a plan."""
    return Count(done / planned if planned else 1.0, planned, tuple(texts))


def causes_of(remarks: Iterable[Remark]) -> Iterator[Cause]:
    """Causes that are known before any run: from remarks on files."""
    return (Cause(remark.cause, str(remark)) for remark in remarks if remark.cause)


def _remarked(run: Observed, cause: str) -> Iterator[str]:
    remarks = (*run.scenario.remarks, *run.sim.remarks.found)
    return (stated.text for stated in causes_of(remarks) if stated.name == cause)


# the file, as it is known before the first step ----------------------------------------------


@_row(
    "elements",
    "ignored",
    "yes",
    1,
    "no element or attribute was left out",
    "an element or attribute that no version of the standard has was left out; those in "
    "`FileHeader` and `Properties` are remarks",
    early=True,
)
def _elements(run: Observed) -> Count:
    return _sound(_remarked(run, "ignored"))


@_row(
    "revision",
    "version",
    "yes",
    1,
    "the header names no version of the standard after the known ones",
    "the header names a version of the standard that is later than the known ones",
    early=True,
)
def _revision(run: Observed) -> Count:
    return _sound(_remarked(run, "version"))


@_row(
    "actors",
    "no-actor",
    "yes",
    1,
    "private actions have actors",
    "private actions of a maneuver group have no actor",
    early=True,
)
def _actors(run: Observed) -> Count:
    return _sound(_remarked(run, "no-actor"))


@_row(
    "places",
    "misplaced",
    "yes",
    1,
    "participants are where their positions say, on the road, inside their boxes",
    "a position is more than 10 m beyond the end of its road, and the end was taken; CARLA's axes "
    "put all positions off the roads, on which they are without; or a participant begins more "
    "than 5 m above or below the road, or 5 m beside its bounding box",
    early=True,
)
def _places(run: Observed) -> Count:
    return _sound((*_remarked(run, "misplaced"), *displaced(run.scenario, run.recording)))


@_row(
    "participants",
    "absent",
    "share",
    1,
    "declared participants that appeared; trailers count with their tractors",
    "no action placed a participant that the scenario declares",
)
def _participants(run: Observed) -> Count:
    there = [entity for entity in run.scenario.entities.values() if entity.controls.tractor is None]
    # Traffic that actions bring in is not declared: it may appear or not.
    there = [entity for entity in there if not entity.spawned]
    absent = [entity for entity in there if not entity.placed]
    texts = [str(absence(run.scenario.path, entity)) for entity in absent]
    return _share(len(there) - len(absent), len(there), texts)


@_row(
    "actions",
    "empty",
    "yes",
    1,
    "actions have contents, and something executes them",
    "a story, act, maneuver, condition group, list of triggering entities or an action such as "
    "`PrivateAction` has nothing inside, or empty actions and custom commands are all that the "
    "events do",
    early=True,
)
def _actions(run: Observed) -> Count:
    # Empty elements explain events without an effect: one lack is told once.
    return _sound(tuple(_remarked(run, "empty")) or tuple(without_effect(run.sim)))


@_row(
    "parameters",
    "parameters",
    "yes",
    1,
    "parameter values keep the constraints of the file",
    "`--no-constraints` let values through that the file excludes",
    early=True,
)
def _parameters(run: Observed) -> Count:
    return _sound(map(str, run.scenario.violations))


@_row(
    "ego",
    "no-ego",
    "yes",
    1,
    "the scenario has an ego, or needs none",
    "a system under test was chosen and drives no vehicle, or there are no participants, or "
    "participants touch each other in a scenario without an ego, which fails nothing",
    early=True,
)
def _ego(run: Observed) -> Count:
    if run.ego is not None:
        return Count(1.0)
    # Boxes of a tractor and its trailer may overlap by construction, with or without a hitch.
    hitched = {
        entity.name
        for entity in run.scenario.entities.values()
        if "trailer" in entity.declared.category
    }
    contacts = [
        contact
        for contact in run.sim.contacts.history
        if run.ended and hitched.isdisjoint(contact[1:])
    ]
    return _sound(egoless(run.sim.entities.values(), run.system, contacts))


@_row(
    "start",
    "stopped-at-once",
    "yes",
    1,
    "the run outlasts its first step, and an action starts before all stories end it",
    "the stop trigger was true at time 0 or in the first step, or the stories "
    "ended without an action",
    early=True,
)
def _start(run: Observed) -> Count:
    sim = run.sim
    if sim.finished and sim.step_index <= 1:
        step = ", in its first step" if sim.step_index else ""
        return _sound([f"the run ended at {sim.time:.2f} s{step}, by {end_of(sim)}"])
    no_event = scene_events(sim) and first_event(sim) == math.inf  # told as that
    if run.ended and sim.step_index and not no_event and ended_idle(sim):
        ended = f"the run ended at {sim.time:.2f} s, by the end of all stories"
        return _sound([f"{ended}: no action started"])
    return Count(1.0)


@_row(
    "road",
    "off-road",
    "yes",
    1,
    "the ego is on the road until the first event",
    "the ego left the road, or came to its end, before the first event, or in the first step",
    early=True,
)
def _road(run: Observed) -> Count:
    # Without events nothing can come too early: only leaving the road at once counts.
    first = first_event(run.sim) if scene_events(run.sim) else 0.0
    texts = []
    for time, text in run.departures.first.values():
        if time < first or time <= run.sim.dt:
            texts.append(f"{text}, before any event" if time < first else text)
    return _sound(texts)


_ON_MOTION = re.compile(
    "Speed|Dynamics|Vertex|Timing|TimeReference|Traj|Polyline|Clothoid|Nurbs|Knot|Performance"
    "|Position|SteadyState|Synchronize|DistanceAction|Lane|Vehicle|FileHeader"
)
"""Elements that repairs change motion by"""


@_row(
    "performance",
    "performance",
    "yes",
    1,
    "participants move as their Performance allows",
    "a participant was faster than its `Performance` allows by 1 %, or the ego changed its speed "
    "beyond it for 0.5 s",
    early=True,
)
def _performance(run: Observed) -> Count:
    texts = [*beyond_performance(run.scenario, run.recording, run.ego)]
    # A speed beyond the Performance may be ours: the reader has to know of repairs.
    repairs = [remark for remark in run.scenario.remarks if _ON_MOTION.search(remark.element)]
    if texts and repairs:
        more = f" and {len(repairs) - 1} more" if len(repairs) > 1 else ""
        texts = [f"{text}, perhaps by a repair of the file: {repairs[0]}{more}" for text in texts]
    return _sound(texts)


# the run -------------------------------------------------------------------------------------


@_row(
    "motion",
    "standing",
    "yes",
    1,
    "the scenario or the system under test sets the ego in motion",
    "the scenario gives the ego no speed, and the system under test never moves it",
)
def _motion(run: Observed) -> Count | None:
    if run.ego is None or run.system == "none" or scripted_at_start(run.scenario, run.ego):
        return None
    return _sound(standstill(run.recording.tracks.get(run.ego.name), run.system))


@_row(
    "events",
    "no-event",
    "events",
    1,
    "events of the scene that started, of those that a sound run has",
    "no event of the scene started, though the storyboard has some",
)
def _events(run: Observed) -> Count | None:
    planned = scene_events(run.sim)
    if not planned:
        return None
    waiting = [event for event in planned if Transition.START not in event.first]
    started = len(planned) - len(waiting)
    text = f"{waiting[0].where}: no event has started: {idle(waiting, run.sim)}" if waiting else ""
    return Count(float(started), len(planned), (text,))


@_row(
    "completion",
    "unfinished",
    "yes",
    1,
    "no limit of time ended the run while events or the stop trigger were waiting",
    "events were waiting when a limit of time ended the run (`--max-time`, or a stop trigger by "
    "`SimulationTimeCondition` alone), or the stop trigger waited for the end of an action of "
    "others, or for an element that never started",
)
def _completion(run: Observed) -> Count:
    sim = run.sim
    if first_event(sim) == math.inf and scene_events(sim):
        return Count(1.0)  # told already: no event
    if not out_of_time(sim):
        return Count(1.0)
    late = [*left_out(sim), *endless(sim, run.ego), *unmet(sim)]
    # Events that wait for a contact may wait for ever: the limit cut them off only near one.
    contact = contact_at_end(run.recording, run.ego, sim.time)
    if contact.after <= APPROACH:
        late += [f"{text}, {contact.after:.2f} s later" for text in mishap_awaited(sim)]
    return _sound(late)


@_row(
    "seconds",
    "short",
    "s",
    0.1,
    "simulated time",
    "the run was shorter",
    within="start",
)
def _seconds(run: Observed) -> Count:
    return Count(run.sim.time)


@_row(
    "ego_seconds",
    "short",
    "s",
    0.1,
    "time with the ego in the world",
    "the ego was there for a shorter time",
    within="seconds",
)
def _ego_seconds(run: Observed) -> Count | None:
    return Count(run.ego_seconds) if run.ego is not None else None


@_row(
    "ego_share",
    "short",
    "share",
    0.1,
    "share of the run with the ego in the world",
    "the ego was there for a smaller share of the run",
    within="ego_seconds",
)
def _ego_share(run: Observed) -> Count | None:
    return Count(run.ego_seconds / run.sim.time) if run.ego and run.sim.time else None


@_row(
    "road_seconds",
    "off-road",
    "s",
    0.1,
    "time with the ego on a road, where the scenario has roads",
    "the ego was on the road for a shorter time",
    within="ego_seconds",
)
def _road_seconds(run: Observed) -> Count | None:
    if run.ego is None or run.scenario.network is None:
        return None
    off, since = 0.0, None
    for entry in run.sim.log:
        if entry.subject == run.ego.name and entry.kind == "offRoad":
            since = entry.time
        elif entry.subject == run.ego.name and entry.kind == "onRoad" and since is not None:
            off, since = off + entry.time - since, None
    if since is not None:
        off += run.sim.time - since
    return Count(max(run.ego_seconds - off, 0.0))


@_row(
    "command_seconds",
    "not-driven",
    "s",
    0.1,
    "time with the system under test in command of the ego, in one domain or both",
    "the system under test that was asked for drove the ego for a shorter time: the scenario "
    "did not hand it over, took it back, or held its pedals",
    within="ego_seconds",
)
def _command_seconds(run: Observed) -> Count | None:
    return _commanded(run, "any")


@_row(
    "command_share",
    "not-driven",
    "share",
    0.1,
    "share of the ego's time with the system under test in command",
    "it was in command for a smaller share of that time",
    within="command_seconds",
)
def _command_share(run: Observed) -> Count | None:
    seconds = _commanded(run, "any")
    if seconds is None or not run.ego_seconds:
        return None
    return seconds._replace(value=min(seconds.value / run.ego_seconds, 1.0))


@_row(
    "longitudinal_seconds",
    "not-driven",
    "s",
    0.0,
    "time with its speed in that command; pedals that the scenario holds do not count",
    "likewise",
    within="command_seconds",
)
def _longitudinal_seconds(run: Observed) -> Count | None:
    return _commanded(run, "longitudinal")


@_row(
    "lateral_seconds",
    "not-driven",
    "s",
    0.0,
    "time with its steering in that command; a system that does not steer has none",
    "likewise",
    within="command_seconds",
)
def _lateral_seconds(run: Observed) -> Count | None:
    return _commanded(run, "lateral")


def _commanded(run: Observed, domain: str) -> Count | None:
    """Time (s) in command of a domain; None without a system under test and an ego to drive."""
    if run.ego is None or run.system == "none":
        return None
    driver = run.ego.controls.driver
    steps = driver.commanded[domain] if isinstance(driver, EgoDriver) else 0
    seconds = steps * run.sim.dt
    return Count(seconds, None, (_not_driven(run, run.ego, seconds),))


def not_driven(run: Observed) -> Iterator[str]:
    """A sentence on a system under test that was not in command for some of the time."""
    found = _commanded(run, "any")
    if found is not None and run.ego_seconds - found.value > 1.5 * run.sim.dt:
        yield from found.texts


def _not_driven(run: Observed, ego: Entity, seconds: float) -> str:
    because = [
        f"{entry.text} at {entry.time:.2f} s"
        for entry in run.sim.log
        if entry.subject == ego.name
        and (
            (entry.kind == "controller" and entry.text.startswith("deactivated"))
            or (entry.kind == "override" and not entry.text.endswith("released"))
        )
    ]
    if not because and ego.name in run.scenario.activated:
        because = [_handed_over(run, ego, seconds)]
    reason = f" ({'; '.join(because[:2])})" if because else ""
    idle = max(run.ego_seconds - seconds, 0.0)
    return (
        f"{run.system} did not drive {ego.name} for {idle:.2f} s of {run.ego_seconds:.2f} s{reason}"
    )


def _handed_over(run: Observed, ego: Entity, seconds: float) -> str:
    """Return the time at which an action of the scenario has handed the ego over, in words."""
    entries = (entry for entry in run.sim.log if entry.subject == ego.name)
    handed = next(
        (
            entry
            for entry in entries
            if entry.kind == "controller" and entry.text.startswith("activated")
        ),
        None,
    )
    if handed is None:
        return "the scenario hands over by an action, which did not start"
    if not seconds:
        return f"it is {handed.text} at {handed.time:.2f} s, which it does not control"
    return f"until {handed.time:.2f} s, when an action of the scenario hands over"


@_row(
    "presence",
    "removed",
    "share",
    1,
    "participants that stayed until the end, or until the ego no longer approached them",
    "the ego was removed before the end; or a participant was removed or put elsewhere within "
    "5 s before the ego would have touched it at their velocities, or the ego was put elsewhere",
)
def _presence(run: Observed) -> Count | None:
    if run.ego is None or run.ego.name not in run.recording.tracks:
        return None
    found = interrupted(run.scenario, run.recording, run.ego, run.sim.time)
    known = [name for name in run.recording.tracks if name in run.scenario.entities]
    return _share(len(known) - len(found), len(known), found.values())


_LARGEST_RESERVE = 1000.0
"""Largest value of `reserve`: a contact that hardly any braking avoids gives a number without end
"""


@_row(
    "reserve",
    "open-end",
    "times",
    1,
    "9.81 m/s² as a multiple of the deceleration that avoids the next contact of the ego after "
    "the end, at the velocities then",
    "it ended so shortly before a contact of the ego that no brake avoids it",
)
def _reserve(run: Observed) -> Count | None:
    contact = contact_at_end(run.recording, run.ego, run.sim.time)
    if contact.after == math.inf or run.ego is None:
        return None
    text = (
        f"the run ended at {run.sim.time:.2f} s, {contact.after:.2f} s before "
        f"{run.ego.name} would touch"
    )
    return Count(
        min(contact.reserve, _LARGEST_RESERVE),
        None,
        (f"{text} {contact.other} at {contact.speed:.2f} m/s",),
    )


@_row(
    "criteria",
    "not-judged",
    "share",
    1,
    "criteria of the scenario that were judged",
    "a criterion has an unknown name, or lacks its value, its participant, its roads, or time",
)
def _criteria(run: Observed) -> Count | None:
    if not run.criteria:
        return None
    open_ones = [result for result in run.criteria if result.passed is None]
    texts = [f"not judged: {result}" for result in open_ones]
    return _share(len(run.criteria) - len(open_ones), len(run.criteria), texts)


@_row(
    "limits",
    "undefined-limit",
    "share",
    0.001,
    "least share of the ego's time in which the measure of a limit (`--fail-if`) was defined",
    "the measure of a limit never had a value, as `min_ttc` without a vehicle ahead",
)
def _limits(run: Observed) -> Count | None:
    return None  # counted with the limits, by `limits_evidence`
