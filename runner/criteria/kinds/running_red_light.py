"""RunningRedLightTest: the participant does not cross a stop line while its light is red."""

from __future__ import annotations

from bisect import bisect_right
from operator import itemgetter

from runner.criteria.criterion import Drive, Finding
from runner.criteria.stop_lines import Crossing, crossings
from runner.worlds.sumo_lights import RED, RED_YELLOW, link_state
from xodr.model import Signal

CRITERION = {
    "name": "RunningRedLightTest",
    "unit": "red lights",
    "summary": "it crosses no stop line of a traffic light that is red",
    "parameters": {},
    "on_roads": True,
}

_FOR_WALKERS = "1000002"
"""OpenDRIVE's type of lights for pedestrians."""


def evaluate(drive: Drive) -> Finding:
    """Look up the state of each light in the moment in which the reference point passes its line."""
    found = crossings(drive, _is_light)
    states = [_state(drive, crossing) for crossing in found]
    red = [c for c, state in zip(found, states, strict=True) if state is not None and link_state(state) in (RED, RED_YELLOW)]
    if red:
        return Finding(False, float(len({c.row for c in red})), f"ran the red light {red[0].signal.id} at {red[0].time:.2f} s")
    dark = [c for c, state in zip(found, states, strict=True) if state is None]
    if dark:
        reason = f"passed the light {dark[0].signal.id} at {dark[0].time:.2f} s, to which the scenario gives no state"
        return Finding(None, None, reason)
    return Finding(True, 0.0, f"traffic lights passed: {len(found)}, none of them red" if found else "came past no traffic light")


def _is_light(signal: Signal) -> bool:
    return signal.dynamic and signal.type != _FOR_WALKERS


def _state(drive: Drive, crossing: Crossing) -> str | None:
    """The state of a crossing's light at that time; None where it has none."""
    history = drive.lights.get(crossing.signal.id, [])
    index = bisect_right(history, crossing.time, key=itemgetter(0)) - 1
    return history[index][1] if index >= 0 else None
