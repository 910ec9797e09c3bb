"""DrivenDistanceTest: the participant drives far enough."""

from __future__ import annotations

from runner.criteria.criterion import Drive, Finding

CRITERION = {
    "name": "DrivenDistanceTest",
    "unit": "m",
    "summary": "it drives further than `distance_success` (m)",
    "parameters": {"distance_success": None},
    "on_roads": False,
}


def evaluate(drive: Drive, distance_success: float) -> Finding:
    """Measure the way of the reference point."""
    distance = float(drive.steps.sum())
    far = distance > distance_success
    return Finding(far, distance, f"drove {distance:.1f} m, {'more' if far else 'not more'} than {distance_success:g} m")
