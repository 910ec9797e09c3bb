"""Criteria of comfort."""

from __future__ import annotations

from runner.judging.criteria.criterion import CriterionFinding, Drive, criterion


@criterion(
    "AcmeComfortTest",  # scenarios and --fail-if name it; the name ends in Test
    unit="m/s²",
    summary="it never brakes harder than `max_deceleration` (m/s²)",
    parameters={"max_deceleration": 3.0},  # None for a value that has to be given
)
def comfort(drive: Drive, max_deceleration: float) -> CriterionFinding:
    """Find the hardest braking, from columns of the participant's motion."""
    braking = -drive.columns["acceleration"]
    row = int(braking.argmax())
    hardest = max(0.0, float(braking[row]))
    reason = f"braked with {hardest:.2f} m/s² at {drive.columns['time'][row]:.2f} s"
    allowed = f"{reason} ({max_deceleration:g} m/s² are allowed)"
    return CriterionFinding(hardest <= max_deceleration, hardest, allowed)
