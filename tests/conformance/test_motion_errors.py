"""What longitudinal, lateral and synchronisation actions refuse, by name and line."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported
from tests.conformance.support import SCENARIOS

FAULTS: list[tuple[str, str, str, type[ToolchainError], str]] = [
    (
        "SpeedAction",
        'value="$Value" followingMode',
        'value="-1" followingMode',
        InvalidFile,
        "must not be negative",
    ),
    ("SpeedAction", 'value="$Target"', 'value="INF"', InvalidFile, "finite"),
    ("SpeedAction", 'entityRef="Car" value', 'entityRef="Nobody" value', InvalidFile, "Nobody"),
    ("SpeedProfileAction", 'time="4" speed="4"', 'time="-4" speed="4"', InvalidFile, "time=-4"),
    (
        "SpeedProfileAction",
        'maxDecelerationRate="2"',
        'maxDecelerationRate="-2"',
        InvalidFile,
        "DynamicConstraints",
    ),
    (
        "LongitudinalDistanceAction",
        'distance="20"',
        'distance="20" timeGap="1"',
        InvalidFile,
        "exactly one",
    ),
    ("LongitudinalDistanceAction", 'distance="20"', "", InvalidFile, "exactly one"),
    (
        "LongitudinalDistanceAction",
        'timeGap="2"',
        'timeGap="-2"',
        InvalidFile,
        "must not be negative",
    ),
    (
        "LongitudinalDistanceAction",
        '"$System"/>',
        '"world"/>',
        Unsupported,
        "coordinateSystem='world'",
    ),
    (
        "LaneOffsetAction",
        'maxLateralAcc="$MaxLateralAcc"',
        'maxLateralAcc="-1"',
        InvalidFile,
        "maxLateralAcc",
    ),
    (
        "LateralDistanceAction",
        ' distance="1"',
        ' distance="-1"',
        InvalidFile,
        "must not be negative",
    ),
    ("LateralDistanceAction", '"$System"/>', '"world"/>', Unsupported, "coordinateSystem='world'"),
    ("SynchronizeAction", 'distance="$Steady"', 'distance="-1"', InvalidFile, "steady state"),
    (
        "SynchronizeAction",
        'targetTolerance="0.1"',
        'targetTolerance="-1"',
        InvalidFile,
        "tolerances",
    ),
    ("SynchronizeAction", 'laneId="-1" s="400"', 'laneId="-7" s="400"', InvalidFile, "no lane -7"),
]


@pytest.mark.parametrize(("element", "right", "wrong", "kind", "words"), FAULTS)
def test_a_fault_is_named_with_its_line(
    tmp_path: Path, element: str, right: str, wrong: str, kind: type[ToolchainError], words: str
) -> None:
    text = (SCENARIOS / f"{element}.xosc").read_text(encoding="utf-8")
    assert right in text
    path = tmp_path / "fault.xosc"
    path.write_text(
        text.replace(right, wrong).replace("../roads", str(SCENARIOS.parent / "roads")),
        encoding="utf-8",
    )
    with pytest.raises(kind, match=rf"fault\.xosc:\d+: .*{words}"):
        runner.run(path, sut=None, world="kinematic", timestep=0.05, max_time=3.0)


@pytest.mark.parametrize(
    ("element", "reference"),
    [
        ("LongitudinalDistanceAction", "Lead"),
        ("LateralDistanceAction", "Reference"),
        ("LaneOffsetAction", "Car"),
    ],
)
def test_a_reference_without_a_position_is_named(
    tmp_path: Path, element: str, reference: str
) -> None:
    text = (SCENARIOS / f"{element}.xosc").read_text(encoding="utf-8")
    begin = text.index(f'<Private entityRef="{reference}">')
    end = text.index("</Private>", begin) + len("</Private>")
    path = tmp_path / "fault.xosc"
    path.write_text(
        (text[:begin] + text[end:]).replace("../roads", str(SCENARIOS.parent / "roads")),
        encoding="utf-8",
    )
    with pytest.raises(InvalidFile, match=f"{reference} has no position yet"):
        runner.run(path, sut=None, world="kinematic", timestep=0.05, max_time=3.0)
