"""SUMO files: valid by SUMO's own schemas, read by sumolib, driven by SUMO."""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sumolib
from lxml import etree

import runner
from runner.exchange.exports import sumo
from schemas.common.errors import Unsupported
from tests.runner.files import car, place, scenario, story
from xodr.formats.sumo_net import sumo_home
from xosc.exports.draft import Folder

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"


def exported(path: Path, folder: Path, timestep: float = 0.1) -> tuple[runner.RunResult, list[str]]:
    result = runner.run(path, world="kinematic", timestep=timestep, sut="none")
    return result, sumo.export(result, "run", Folder(folder))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return scenario(
        tmp_path / "case",
        road="curve",
        entities=[car("Ego"), car("Other car &amp; more")],
        init=place("Ego", 20, 30) + place("Other car &amp; more", 150, 12, lane=1),
    )


def test_the_fcd_file_tells_where_everyone_was(path: Path, tmp_path: Path) -> None:
    result, remarks = exported(path, tmp_path / "out")
    assert remarks == []
    steps = list(sumolib.xml.parse(str(tmp_path / "out" / "run.fcd.xml"), "timestep"))
    for (name, track), id_ in zip(
        result.recording.tracks.items(), ("Ego", "Other_car___more"), strict=True
    ):
        for row, step in enumerate(steps):
            (vehicle,) = (each for each in step.vehicle if each.id == id_)
            columns, h = track.columns, math.radians(90.0 - float(vehicle.angle))
            assert float(step.time) == pytest.approx(columns["time"][row])
            assert math.cos(h - columns["h"][row]) == pytest.approx(1.0)
            x, y = float(vehicle.x) - 4.0 * math.cos(h), float(vehicle.y) - 4.0 * math.sin(h)
            assert (x, y) == pytest.approx((columns["x"][row], columns["y"][row]), abs=1e-4), name


def test_lanes_and_positions_on_them_are_those_of_the_network(path: Path, tmp_path: Path) -> None:
    exported(path, tmp_path / "out")
    net = sumolib.net.readNet(str(tmp_path / "out" / "curve.net.xml"))
    for step in sumolib.xml.parse(str(tmp_path / "out" / "run.fcd.xml"), "timestep"):
        for vehicle in step.vehicle:
            lane = net.getLane(vehicle.lane)
            shape = lane.getShape()
            stretch = (
                sumolib.geomhelper.polyLength(shape) / lane.getLength()
            )  # the lanes of an edge have one length in SUMO
            there = sumolib.geomhelper.positionAtShapeOffset(shape, float(vehicle.pos) * stretch)
            assert np.hypot(there[0] - float(vehicle.x), there[1] - float(vehicle.y)) < 0.5


@pytest.mark.parametrize(
    "name", ["cut_in_four_way_intersection", "intersection_pedestrian_crossing", "merging_highway"]
)
def test_sumo_loads_and_drives_the_routes(name: str, tmp_path: Path) -> None:
    result, remarks = exported(LIBRARY / f"{name}.xosc", tmp_path)
    command = [
        sumolib.checkBinary("sumo", str(sumo_home() / "bin")),
        "-c",
        "run.sumocfg",
        "--tripinfo-output",
        "trips.xml",
    ]
    command += ["--tripinfo-output.write-unfinished", "--no-step-log", "--end", "1"]
    environment = {**os.environ, "SUMO_HOME": str(sumo_home())}
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert (answer.returncode, answer.stderr) == (0, "")
    driven = {each.id for each in sumolib.xml.parse(str(tmp_path / "trips.xml"), "tripinfo")}
    walking = {
        name for name, track in result.recording.tracks.items() if track.kind == "pedestrian"
    }
    assert driven == result.recording.tracks.keys() - walking
    assert len(remarks) == len(walking)


@pytest.mark.parametrize(
    ("file", "schema"), [("run.fcd.xml", "fcd_file"), ("run.rou.xml", "routes_file")]
)
def test_files_are_valid_by_sumos_own_schemas(file: str, schema: str, tmp_path: Path) -> None:
    exported(LIBRARY / "intersection_pedestrian_crossing.xosc", tmp_path)
    xsd = etree.XMLSchema(etree.parse(sumo_home() / "data" / "xsd" / f"{schema}.xsd"))
    assert xsd.validate(etree.parse(tmp_path / file)), xsd.error_log


def test_a_scenario_without_roads_is_refused(tmp_path: Path) -> None:
    path = scenario(
        tmp_path, entities=[car("Ego")], init=place("Ego", 20, 10), stories=story("Ego", [])
    )
    text = path.read_text().replace('<LogicFile filepath="straight.xodr"/>', "")
    text = text.replace(
        '<LanePosition roadId="1" laneId="-1" s="20"/>',
        '<WorldPosition x="0" y="0" z="0" h="0" p="0" r="0"/>',
    )
    path.write_text(text)
    with pytest.raises(Unsupported, match="this scenario has none"):
        exported(path, tmp_path / "out")
