"""Trailers: coupled, towed along the tractrix of the hitch, and left behind."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import runner
from schemas.common.errors import InvalidFile
from tests.conformance.support import SCENARIOS, at, changed, run, track

HITCH, COUPLER = -1.0, 3.0


def gap(car: dict[str, np.ndarray], trailer: dict[str, np.ndarray], since: float) -> float:
    """Greatest distance between hitch and coupler from a time on, m."""
    use = car["time"] >= since
    dx = car["x"] + HITCH * np.cos(car["h"]) - trailer["x"] - COUPLER * np.cos(trailer["h"])
    dy = car["y"] + HITCH * np.sin(car["h"]) - trailer["y"] - COUPLER * np.sin(trailer["h"])
    return float(np.hypot(dx, dy)[use].max())


@pytest.mark.parametrize("speed", [10.0, -2.0])
@pytest.mark.parametrize("road", ["straight", "curve"])
def test_a_connected_trailer_stays_on_the_hitch(road: str, speed: float) -> None:
    result = run(
        "ConnectTrailerAction",
        parameters={"Road": f"../roads/{road}.xodr", "Speed": speed},
        world="kinematic",
    )
    car, trailer = track(result, "Car"), track(result, "Trailer")
    assert gap(car, trailer, 1.02) < 1e-9
    assert at(trailer, 5.0, "speed") == pytest.approx(speed)


def test_connecting_moves_the_trailer_to_the_hitch_along_the_line_between_them() -> None:
    result = run("ConnectTrailerAction", world="kinematic")
    trailer = track(result, "Trailer")
    assert (at(trailer, 0.9, "x"), at(trailer, 0.9, "y")) == pytest.approx((190.0, -0.25))
    h = math.atan2(-1.75 - -0.25, 199.0 - 190.0)
    assert at(trailer, 1.5, "h") == pytest.approx(h)
    assert at(trailer, 1.5, "x") == pytest.approx(199.0 - COUPLER * math.cos(h))


def test_a_towed_trailer_lines_up_on_the_straight_and_cuts_the_corner_in_a_curve() -> None:
    straight = track(run("ConnectTrailerAction", world="kinematic"), "Trailer")
    # tractrix: the angle's half tangent decays with exp(−distance / coupler length)
    h = math.atan2(-1.5, 9.0)
    driven = 10.0 * (3.0 - 2.0)
    assert at(straight, 3.0, "h") == pytest.approx(
        2 * math.atan(math.tan(h / 2) * math.exp(-driven / COUPLER)), abs=2e-4
    )
    curve = run(
        "ConnectTrailerAction", parameters={"Road": "../roads/curve.xodr"}, world="kinematic"
    )
    car, trailer = track(curve, "Car"), track(curve, "Trailer")
    # steady state on a circle: axle radius² = hitch radius² − coupler², hitch radius² = car radius²
    # + hitch² centre of the road's left arc of curvature 0.01 is at (0, 100);
    # the lane is outside the reference line
    radius = 100.0 + 1.75
    end = [
        math.hypot(float(columns["x"][-1]), float(columns["y"][-1]) - 100.0)
        for columns in (car, trailer)
    ]
    assert end[0] == pytest.approx(radius, abs=1e-6)
    assert end[1] == pytest.approx(math.sqrt(radius**2 + HITCH**2 - COUPLER**2), abs=2e-3)


def test_an_inline_trailer_is_an_entity_of_its_own_placed_behind_its_tractor_and_stands_once_disconnected() -> (
    None
):
    result = run("DisconnectTrailerAction", world="kinematic")
    car, trailer = track(result, "Car"), track(result, "Trailer")
    assert (trailer["x"][0], trailer["y"][0]) == pytest.approx((200.0 + HITCH - COUPLER, -1.75))
    assert at(trailer, 1.5, "speed") == pytest.approx(10.0)
    assert at(trailer, 3.9, "speed") == 0.0
    assert at(trailer, 3.9, "x") == pytest.approx(216.0, abs=0.11)
    assert at(car, 3.9, "x") == pytest.approx(239.0)


TRAJECTORY = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="Path" closed="false"><Shape><Polyline>
<Vertex time="0"><Position><WorldPosition x="300" y="-1.75" h="0"/></Position></Vertex>
<Vertex time="8"><Position><WorldPosition x="380" y="-1.75" h="0"/></Position></Vertex></Polyline></Shape></Trajectory>
</TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"""


@pytest.mark.parametrize("teleported", [False, True])
def test_a_trajectory_puts_a_tractor_on_its_start_with_its_trailer_behind(
    teleported: bool, tmp_path: Path
) -> None:
    text = (SCENARIOS / "DisconnectTrailerAction.xosc").read_text(encoding="utf-8")
    begin, end = (
        text.index("<TeleportAction>"),
        text.index("</TeleportAction>") + len("</TeleportAction>"),
    )
    placed = (
        f"{text[begin:end]}</PrivateAction><PrivateAction>{TRAJECTORY}"
        if teleported
        else TRAJECTORY
    )
    path = changed(SCENARIOS / "DisconnectTrailerAction.xosc", tmp_path, (text[begin:end], placed))
    trailer = track(run(str(path.with_suffix("")), world="kinematic"), "Trailer")
    assert at(trailer, 0.0, "x") == pytest.approx(300.0 + HITCH - COUPLER)
    assert at(trailer, 1.0, "x") == pytest.approx(310.0 + HITCH - COUPLER, abs=0.01)
    assert np.abs(np.diff(trailer["x"])).max() < 0.11


def test_a_vehicle_without_the_element_around_it_is_a_trailer_with_a_remark(tmp_path: Path) -> None:
    shutil.copytree(SCENARIOS.parent / "roads", tmp_path / "roads")
    text = (SCENARIOS / "DisconnectTrailerAction.xosc").read_text(encoding="utf-8")
    begin, end = text.index('<Trailer name="Trailer">'), text.index("</Trailer>")
    bare = (
        text[:begin]
        + text[begin + len('<Trailer name="Trailer">') : end]
        + text[end + len("</Trailer>") :]
    )
    path = tmp_path / "scenarios" / "bare.xosc"
    path.parent.mkdir()
    path.write_text(
        bare.replace('<Vehicle name="trailer"', '<Vehicle name="Trailer"'), encoding="utf-8"
    )
    result = runner.run(path, sut=None, world="kinematic", timestep=0.01)
    assert track(result, "Trailer")["x"][0] == pytest.approx(200.0 + HITCH - COUPLER)
    line = bare[:begin].count("\n") + 2
    (remark,) = [each for each in result.remarks if "valid_schema" in each]
    assert remark.startswith(f"{path}:{line}: 'Vehicle': This element is not expected")
    with pytest.raises(InvalidFile, match="valid_schema"):
        runner.run(path, sut=None, world="kinematic", strict=True)


@pytest.mark.parametrize("released", [False, True])
def test_a_second_trailer_is_refused_before_the_run_where_the_first_is_never_disconnected(
    tmp_path: Path, released: bool
) -> None:
    shutil.copytree(SCENARIOS.parent / "roads", tmp_path / "roads")
    text = (SCENARIOS / "DisconnectTrailerAction.xosc").read_text(encoding="utf-8")
    begin, end = (
        text.index('<Trailer name="Trailer">') + len('<Trailer name="Trailer">'),
        text.index("</Trailer>"),
    )
    second = f'<ScenarioObject name="Second">{text[begin:end]}</ScenarioObject></Entities>'
    action = (
        '<TrailerAction><ConnectTrailerAction trailerRef="Second"/></TrailerAction></PrivateAction>'
    )
    text = text.replace("</Entities>", second)
    if released:
        text = text.replace(
            "</Event>", f'<Action name="more"><PrivateAction>{action}</Action></Event>', 1
        )
    else:
        text = text.replace(
            "<DisconnectTrailerAction/>", '<ConnectTrailerAction trailerRef="Second"/>'
        )
    path = tmp_path / "scenarios" / "second.xosc"
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    if released:
        runner.prepare(path)
    else:
        with pytest.raises(InvalidFile, match="'Car' tows 'Trailer' already"):
            runner.prepare(path)
