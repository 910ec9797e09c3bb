"""Tables whose columns a TOML file declares: units, frames, reference points,
and what is wrong with them.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from recognition import recordings as datasets
from recognition.recordings.source import REAR_AXLE, Source
from schemas.common.errors import InvalidFile

PLAIN = '[columns]\ntrack = "who"\ntime = "t"\nx = "x"\ny = "y"\n'
FULL = PLAIN + 'heading = "yaw"\nspeed = "v"\nlength = "l"\nwidth = "w"\ncategory = "kind"\n'
TURN = math.radians(30.0)


def table(
    folder: Path, declared: str, *, scale: float = 1.0, time: float = 1.0, **frame: float
) -> Source:
    """A truck and a car that drive at 10 and 12 m/s in a direction of 30
    degrees, written with factors.
    """
    lines = ["who,t,x,y,yaw,v,l,w,kind"]
    for who, speed, kind, length in (("a", 10.0, "T", 8.0), ("b", 12.0, "C", 4.0)):
        for k in range(40):
            way = speed * 0.1 * k + frame.get("ahead", 0.0) * length
            x, y = way * math.cos(TURN), way * math.sin(TURN) + (20.0 if who == "b" else 0.0)
            yaw = frame.get("zero", 0.0) + frame.get("turns", 1.0) * math.degrees(TURN)
            values = (
                scale * x,
                frame.get("side", 1.0) * scale * y,
                yaw,
                speed * frame.get("fast", 1.0),
            )
            numbers = ",".join(f"{value:.6f}" for value in values)
            lines.append(
                f"{who},{time * 0.1 * k:.6g},{numbers},{scale * length},{scale * 2.0},{kind}"
            )
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    (folder / "columns.toml").write_text(declared)
    (source,) = datasets.open(folder).sources
    return source


KINDS = '[categories]\nT = "truck"\nC = "car"\n'


@pytest.mark.parametrize(
    ("declared", "made"),
    [
        ('[units]\nheading = "deg"\n', {}),
        ('[units]\nheading = "deg"\ntime = "ms"\n', {"time": 1000.0}),
        ('step = 0.1\n[units]\nheading = "deg"\ntime = "frames"\n', {"time": 10.0}),
        (
            '[units]\nheading = "deg"\nposition = "ft"\nsize = "ft"\nspeed = "km/h"\n',
            {"scale": 1.0 / 0.3048, "fast": 3.6},
        ),
        (
            '[units]\nheading = "deg"\n[frame]\ny = "right"\nheading_turns = "right"\n',
            {"side": -1.0, "turns": -1.0},
        ),
        (
            '[units]\nheading = "deg"\n[frame]\nheading_from = "y"\nheading_turns = "right"\n',
            {"zero": 90.0, "turns": -1.0},
        ),
        ('[units]\nheading = "deg"\n[frame]\nreference = "front"\n', {"ahead": 0.5}),
        ('[units]\nheading = "deg"\n[frame]\nreference = "rear axle"\n', {"ahead": -REAR_AXLE}),
    ],
)  # fmt: skip
def test_units_frames_and_reference_points_are_as_declared(
    declared: str, made: dict[str, float], tmp_path: Path
) -> None:
    head, _, rest = declared.partition("[")
    source = table(tmp_path, head + FULL + "[" + rest + KINDS, **made)
    recording = source.load()
    truck = recording.tracks["a"]
    assert (truck.category, truck.box.length) == ("truck", pytest.approx(8.0))
    columns = truck.columns
    assert np.allclose(columns["h"], TURN, atol=0.01)
    assert np.allclose(columns["speed"], 10.0, atol=0.2)
    centre = columns["x"][0] + truck.box.x * math.cos(TURN)
    assert centre == pytest.approx(0.0, abs=0.1) and recording.timestep == pytest.approx(0.1)


def test_headings_and_speeds_follow_from_places(tmp_path: Path) -> None:
    recording = table(tmp_path, PLAIN).load()
    assert np.allclose(recording.tracks["b"].columns["h"], TURN, atol=0.01)
    assert np.allclose(recording.tracks["b"].columns["speed"], 12.0, atol=0.2)


@pytest.mark.parametrize(
    ("declared", "made", "message"),
    [
        ('[units]\nheading = "deg"\n', {"time": 5.0}, "places move at 0.2"),
        ('[units]\nheading = "rad"\n', {}, "headings have another zero or unit"),
        ('[units]\nheading = "deg"\n[frame]\ny = "right"\n', {}, "headings have another zero"),
        ('[units]\nheading = "deg"\nspeed = "km/h"\n', {}, "places move at 3.6"),
        ('[units]\nheading = "deg"\n', {"zero": 35.0}, "move 35° off their headings in the median"),
    ],
)
def test_the_intake_names_wrong_declarations(
    declared: str, made: dict[str, float], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match=message):
        table(tmp_path, FULL + declared + KINDS, **made).load()


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ("[columns]\n", r"\[columns\] lacks track, time, x, y"),
        (PLAIN + 'widht = "w"\n', "'widht' is no column; known are track"),
        (PLAIN + '[units]\ntime = "h"\n', "'h' is no unit of time; known are s, ms"),
        (PLAIN + '[frame]\ny = "up"\n', "'up' is no value of y; known are left, right"),
        (PLAIN + '[units]\ntime = "frames"\n', "time in frames needs a step"),
        ("step = 0.2\n" + PLAIN, "step = 0.2 s, but t of the table is 0.1 s apart"),
        (PLAIN + "[frame]\ny = 3\n", r"\[frame\] is a table of texts"),
        ("x = [\n", "no TOML"),
        (PLAIN + 'category = "kind"\n', "does not have 'T'"),
        ('[columns]\ntrack = "who"\ntime = "t"\nx = "x"\ny = "north"\n', "no column north"),
    ],
)
def test_declarations_that_do_not_fit_are_refused_by_name(
    declared: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match=message):
        table(tmp_path, declared).load()


def test_a_declaration_may_lie_elsewhere(tmp_path: Path) -> None:
    table(tmp_path, PLAIN)
    elsewhere = tmp_path / "mine.toml"
    (tmp_path / "columns.toml").rename(elsewhere)
    with pytest.raises(InvalidFile, match="no recording of a known format"):
        _ = datasets.open(tmp_path / "log.csv").sources
    (source,) = datasets.open(tmp_path, columns=elsewhere).sources
    assert source.format == "table" and len(source.load().tracks) == 2
