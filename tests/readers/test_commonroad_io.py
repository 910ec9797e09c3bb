"""CommonRoad scenarios as commonroad-io reads them: valid, and everyone where they were."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import runner
import xodr
import xosc
from runner.exchange.exports import commonroad
from runner.exchange.exports.moments import box_centre
from tests.readers.conftest import Read
from tests.runner.files import ROADS, car, place, scenario
from xodr.lookup.lanelets import lanelets
from xosc.exports.draft import Folder

LIBRARY = Path(xosc.__file__).parent / "library"

READ = """
import json, sys
from pathlib import Path
import commonroad
import numpy as np
from commonroad.scenario.scenario import ScenarioID
from commonroad.scenario.state import CustomState
from commonroad.common.file_reader import CommonRoadFileReader
from lxml import etree
xsd = etree.XMLSchema(etree.parse(str(Path(commonroad.__file__).parent / "common/xml_definition_files/XML_commonRoad_XSD.xsd")))
valid = xsd.validate(etree.parse(sys.argv[1]))
scenario, problems = CommonRoadFileReader(sys.argv[1]).open()
obstacles = [[o.obstacle_type.value, *[[float(v) for v in (*s.position, s.orientation, s.velocity)]
             for s in [o.initial_state, *o.prediction.trajectory.state_list]]] for o in scenario.dynamic_obstacles]
(problem,) = problems.planning_problem_dict.values()
start = [float(v) for v in (*problem.initial_state.position, problem.initial_state.orientation, problem.initial_state.velocity)]
lanelets = {l.lanelet_id: [sorted(l.successor), l.adj_left, l.adj_left_same_direction] for l in scenario.lanelet_network.lanelets}
places = [o.initial_state.position for o in scenario.dynamic_obstacles]
on = [len(found) for found in scenario.lanelet_network.find_lanelet_by_position(places)]
errors = [str(e) for e in xsd.error_log][:3]
way = json.loads(sys.argv[2])
driven = [CustomState(time_step=n, position=np.array(row[:2]), orientation=row[2], velocity=row[3]) for n, row in enumerate(way)]
reached = [bool(problem.goal.is_reached(state)) for state in driven]
name = ScenarioID.from_benchmark_id(str(scenario.scenario_id), "2020a")
print(json.dumps({"valid": valid, "errors": errors, "dt": scenario.dt, "obstacles": obstacles, "start": start,
                  "lanelets": lanelets, "on": on, "reached": reached, "id": str(name)}))
"""


def states(result: runner.RunResult, name: str) -> np.ndarray:
    """Centre x, y, heading and speed of a participant."""
    track = result.recording.tracks[name]
    heading = np.arctan2(np.sin(track.columns["h"]), np.cos(track.columns["h"]))
    return np.column_stack([box_centre(track)[:, :2], heading, track.columns["speed"]])


@pytest.mark.slow
def test_everyone_is_where_they_were(read: Read, tmp_path: Path) -> None:
    two = place("Ego", 20, 10) + place("Other", 150, 12, lane=1)
    path = scenario(tmp_path, road="curve", entities=[car("Ego"), car("Other")], init=two)
    result = runner.run(path, world="kinematic", timestep=0.1, sut="none")
    commonroad.export(result, "curve", Folder(tmp_path))
    got = read(READ, tmp_path / "curve.xml", json.dumps(states(result, "Ego").tolist()))
    assert got["valid"], got["errors"]
    (kind, *ways) = got["obstacles"][0]
    assert (kind, got["dt"]) == ("car", 0.1)
    assert np.allclose(ways, states(result, "Other"), atol=1e-5)
    assert np.allclose(got["start"], states(result, "Ego")[0], atol=1e-5)
    assert got["on"] == [1]
    assert got["reached"][-1] and not got["reached"][0], "the ego's own way solves the problem"
    assert got["id"] == "ZAM_Curve-1_1_T-1"
    beside = [lanelet.beside[0] for lanelet in lanelets(xodr.load(ROADS / "curve.xodr")).values()]
    assert [left and same for _, left, same in got["lanelets"].values()] == [
        left and left[1] for left in beside
    ]


@pytest.mark.parametrize(
    "name", ["lane_change_left_four_way_intersection", "cut_in_sharp_curve", "merging_highway"]
)
def test_the_library_is_valid_and_on_its_lanelets(name: str, read: Read, tmp_path: Path) -> None:
    result = runner.run(
        LIBRARY / f"{name}.xosc", world="kinematic", timestep=0.1, sut="none", max_time=1.0
    )
    commonroad.export(result, name, Folder(tmp_path))
    got = read(READ, tmp_path / f"{name}.xml", json.dumps(states(result, result.ego).tolist()))
    assert got["valid"], got["errors"]
    assert np.allclose(got["start"], states(result, result.ego)[0], atol=1e-5)
    assert got["on"] and all(got["on"])
