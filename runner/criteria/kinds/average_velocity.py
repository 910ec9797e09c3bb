"""AverageVelocityTest: the participant is fast enough on average."""

from __future__ import annotations

from runner.criteria.criterion import Drive, Finding

CRITERION = {
    "name": "AverageVelocityTest",
    "unit": "m/s",
    "summary": "the way divided by the time of the run is more than `velocity` (m/s)",
    "parameters": {"velocity": None},
    "on_roads": False,
}


def evaluate(drive: Drive, velocity: float) -> Finding:
    """Divide the way of the reference point by the simulation time."""
    time = float(drive.columns["time"][-1])
    if time <= 0.0:
        return Finding(None, None, "the run has no duration")
    average = float(drive.steps.sum()) / time
    fast = average > velocity
    return Finding(fast, average, f"drove {average:.2f} m/s on average, {'more' if fast else 'not more'} than {velocity:g} m/s")
