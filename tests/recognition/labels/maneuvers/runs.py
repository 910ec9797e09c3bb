"""Runs of the library's logical scenarios as recordings to be cut into units."""

from __future__ import annotations

from pathlib import Path

import runner
from generation.space.logical.library import ROADS, SCENARIOS
from recognition.labels.classes import Rules
from recognition.labels.maneuvers.estimation import LaneCoordinates, lane_motion
from recognition.labels.maneuvers.parameters import PARAMETERS, declared_name
from recognition.labels.scene import prepare
from recognition.scenes import site_at

STEP = 0.05


def recorded(
    name: str, road: str, actor: str, values: tuple[float, ...], folder: Path, **others: float
) -> LaneCoordinates:
    """What a run without a system under test records, where the actor's changes of speed are
    lines: those that are fitted to recordings.

    Args:
        values: the seven parameters of the actor, in their order.
        others: further parameters.
    """
    given = {
        declared_name(actor, role): str(value)
        for role, value in zip(PARAMETERS, values, strict=True)
    }
    given |= {key: str(value) for key, value in others.items()}
    text = (SCENARIOS / f"{name}.xosc").read_text()
    for old, new in (
        (
            'SpeedActionDynamics dynamicsShape="sinusoidal"',
            'SpeedActionDynamics dynamicsShape="linear"',
        ),
        ('path="catalogs', f'path="{SCENARIOS}/catalogs'),
        ("../../xodr/library", str(ROADS)),
    ):
        assert old in text
        text = text.replace(old, new)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.xosc"
    path.write_text(text)
    done = runner.run(path, parameters=given, sut=None, world="kinematic", timestep=STEP)
    assert done.verdict.passed, done.verdict.reasons
    return lane_motion(
        prepare(done.recording.locate(), site_at(ROADS / f"{road}.xodr", folder=folder), Rules())
    )
