"""Maps that we write as commonroad-io and ASAM's checker of OpenDRIVE read them."""

from __future__ import annotations

from pathlib import Path

import pytest

import xodr
from tests.readers.conftest import Read
from xodr.formats.maps import files as maps

LIBRARY = Path(xodr.__file__).parent / "library"
NAMES = ["roundabout", "highway_off_ramp", "sharp_curve", "t_junction_two_lanes"]

LANELETS = """
import json, pathlib, sys
import commonroad.common
from lxml import etree
from commonroad.common.file_reader import CommonRoadFileReader
scenario, problems = CommonRoadFileReader(sys.argv[1]).open()
schema = pathlib.Path(commonroad.common.__file__).parent / "xml_definition_files" / "XML_commonRoad_XSD.xsd"
judge = etree.XMLSchema(etree.parse(schema))
judge.validate(etree.parse(sys.argv[1]))
faults = [fault.message for fault in judge.error_log]
found = scenario.lanelet_network.lanelets
print(json.dumps({"length": sum(float(one.distance[-1]) for one in found), "links": sum(len(one.successor) for one in found),
                  "lanelets": len(found), "problems": len(problems.planning_problem_dict), "faults": faults}))
"""
ISSUES = """
import json, sys
from qc_baselib import Configuration, Result
from qc_opendrive import constants
from qc_opendrive.main import run_checks
config, result = Configuration(), Result()
config.set_config_param("InputFile", sys.argv[1])
result.register_checker_bundle(name=constants.BUNDLE_NAME, description="", version="1", summary="")
result.set_result_version(version="1")
run_checks(config, result)
checks = result.get_checker_ids(constants.BUNDLE_NAME)
print(json.dumps([len(checks), [issue.description for check in checks for issue in result.get_issues(constants.BUNDLE_NAME, check)]]))
"""


@pytest.mark.parametrize("name", NAMES)
def test_commonroad_io_reads_all_lanes_and_links_of_files_that_its_schema_accepts(
    name: str, read: Read, tmp_path: Path
) -> None:
    made = maps.convert(LIBRARY / f"{name}.xodr", tmp_path / f"{name}.xml")
    found = read(LANELETS, made.path)
    lanes = made.source.lanes.values()
    assert found["lanelets"] == len(lanes)
    assert (found["problems"], found["faults"]) == (1, [])
    assert found["links"] == sum(len(lane.successors) for lane in lanes)
    assert found["length"] == pytest.approx(sum(lane.length for lane in lanes), rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_asams_checker_has_nothing_against_roads_made_of_lanelets(
    name: str, read: Read, tmp_path: Path
) -> None:
    there = maps.convert(LIBRARY / f"{name}.xodr", tmp_path / f"{name}.osm")
    back = maps.convert(there.path, tmp_path / f"{name}.xodr")
    checks, issues = read(ISSUES, back.path)
    # It counts coefficients that differ by less than 1e-8 as equal, however long the piece is.
    assert checks > 10 and [each for each in issues if not each.startswith("Redundant")] == []
    assert len(issues) < 10
