"""Writing INTERACTION recordings, in their first layout; see `recognition.datasets.formats.interaction` for the format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from recognition.recorder.fleet import Vehicle
from recognition.recorder.formats.tables import write_csv
from recognition.recorder.motion import VehicleMotion

RATE = 10
"""Frames a second."""


def write(folder: Path, number: int, vehicles: Sequence[Vehicle], motion: VehicleMotion) -> Path:
    """Write a recording into its site's folder; the track file's path.

    Args:
        number: of the recording, from 0.
        vehicles: by departure.
        motion: what is in view, frames from 0.
    """
    index, chosen = np.unique(motion.vehicle, return_inverse=True)
    seen = [vehicles[one] for one in index.tolist()]
    heading = np.arctan2(np.sin(motion.h), np.cos(motion.h))
    columns = {
        "track_id": chosen + 1, "frame_id": motion.frame + 1, "timestamp_ms": (motion.frame + 1) * 1000 // RATE,
        "agent_type": np.array([one.kind.agent for one in seen])[chosen],
        **{name: np.round(getattr(motion, name), 3) + 0.0 for name in ("x", "y", "vx", "vy")},
        "psi_rad": np.round(heading, 3) + 0.0,
        **{side: np.array([getattr(one, side) for one in seen])[chosen] for side in ("length", "width")},
    }  # fmt: skip
    path = folder / f"vehicle_tracks_{number:03d}.csv"
    write_csv(path, columns)
    return path
