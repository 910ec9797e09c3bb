"""How much of the classes the map alone tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels.classes import Label
from recognition.trfe.inputs.tokens import FEATURES, Tokens
from recognition.trfe.training.windows import Windows
from schemas.common.errors import UsageError
from studies.recognition.places import places

COUNT = 40


def written(folder: Path, recordings: int = 5) -> Path:
    """Windows of two classes of roundabouts, which the lanes to the left tell,
    and of ramps, which the speed tells.
    """
    labels = np.repeat(
        [
            Label.ROUNDABOUT_ENTERING,
            Label.ROUNDABOUT_EXITING,
            Label.RAMP_ENTERING,
            Label.RAMP_EXITING,
        ],
        COUNT,
    )
    inputs = np.random.default_rng(0).normal(size=(len(labels), *Tokens().shape)).astype(np.float16)
    inputs[:, 0, :, FEATURES.index("lanes_to_left")] = (labels == Label.ROUNDABOUT_ENTERING)[
        :, None
    ]
    inputs[:, 0, :, FEATURES.index("speed")] = (labels == Label.RAMP_ENTERING)[:, None]
    names = np.array([f"site {number % recordings}" for number in range(len(labels))])
    Windows(
        inputs, labels.astype(np.int64), names, names, np.arange(len(labels), dtype=float)
    ).save(folder)
    return folder


def test_what_the_map_tells_and_what_motion_tells_are_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.recognition.places._TREES", 10)
    places(written(tmp_path / "windows"), tmp_path / "out")
    rows = [
        line.strip("| ").split(" | ")
        for line in (tmp_path / "out" / "places.md").read_text().splitlines()[2:]
    ]
    told = {
        name: (int(count), float(chance), float(lane), float(motion))
        for name, count, chance, lane, motion in rows
    }
    assert list(told) == ["all", "at ramps", "at roundabouts"]
    for place, better in (("at ramps", 3), ("at roundabouts", 2)):
        assert told[place][:2] == (80, 0.5)
        assert told[place][better] > 0.9 and told[place][5 - better] < 0.7, told


def test_too_few_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the windows are of fewer than 5 recordings"):
        places(written(tmp_path / "windows", 4), tmp_path / "out")
