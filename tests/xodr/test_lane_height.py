"""Lane heights: what stands on a raised lane stands above the road (OpenDRIVE 11.7.3)."""

from __future__ import annotations

from pathlib import Path

import pytest

import xodr
from xodr.graph.network import RoadNetwork

KERB = '<height sOffset="0" inner="0.1" outer="0.2"/><height sOffset="50" inner="0.1" outer="0.2"/>'


def road(folder: Path, heights: str, superelevation: float = 0.0) -> RoadNetwork:
    tilt = (
        f'<superelevation s="0" a="{superelevation}" b="0" c="0" d="0"/>' if superelevation else ""
    )
    path = folder / "kerb.xodr"
    path.write_text(
        f"""<OpenDRIVE><header revMajor="1" revMinor="7"/><road id="1" length="100" junction="-1"><planView>
        <geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lateralProfile>{tilt}</lateralProfile>
        <lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right>
        <lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        <lane id="-2" type="sidewalk" level="false"><width sOffset="0" a="2" b="0" c="0" d="0"/>{heights}</lane>
        </right></laneSection></lanes></road></OpenDRIVE>""",
        encoding="utf-8",
    )
    return xodr.load(path)


@pytest.mark.parametrize(
    ("t", "z"),
    [(-1.75, 0.0), (-3.5, 0.0), (-4.0, 0.125), (-4.5, 0.15), (-5.5, 0.2), (-6.0, 0.0), (1.0, 0.0)],
)
def test_the_height_lies_between_inner_and_outer(t: float, z: float, tmp_path: Path) -> None:
    assert road(tmp_path, KERB).point("1", 20.0, t) is not None
    assert road(tmp_path, KERB).road("1").pose(20.0, t).z == pytest.approx(z)


def test_the_height_changes_evenly_between_records(tmp_path: Path) -> None:
    heights = (
        '<height sOffset="20" inner="0" outer="0"/><height sOffset="30" inner="0.2" outer="0.2"/>'
    )
    found = road(tmp_path, heights).road("1")
    assert [found.pose(s, -4.5).z for s in (10.0, 20.0, 25.0, 30.0, 90.0)] == pytest.approx(
        [0.0, 0.0, 0.1, 0.2, 0.2]
    )


def test_the_height_is_above_a_tilted_road(tmp_path: Path) -> None:
    plain, raised = (
        road(tmp_path, heights, superelevation=0.05).road("1").pose(20.0, -4.5).z
        for heights in ("", KERB)
    )
    assert raised - plain == pytest.approx(0.15, abs=1e-3)


def test_a_raised_lane_is_found_from_its_place_in_the_world(tmp_path: Path) -> None:
    network = road(tmp_path, KERB)
    pose = network.pose(network.lane_point("1", -2, 20.0))
    assert pose.z == pytest.approx(0.15)
    assert network.locate(pose.x, pose.y, pose.z).lane_id == -2
