"""Layers of lanes: the road's temporary lanes, from 100 m to 180 m, are narrower
and moved 1 m to the right.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import runner
import xodr
import xosc
from runner import RunResult
from schemas import check
from schemas.common.errors import InvalidFile
from tests.conformance.support import at, track
from tests.conformance.support import run as run_scenario
from xosc.rules.positions import LANE_UID

LIBRARY, ROADS = (Path(package.__file__).parent / "library" for package in (xosc, xodr))
FIRST, SECOND = -1.75, -5.25
"""t of the centres of the permanent lanes -1 and -2, m."""
TEMPORARY_FIRST, TEMPORARY_SECOND = -2.25, -4.75


def run(element: str, **options: Any) -> RunResult:
    return run_scenario(element, world="kinematic", **options)


@pytest.mark.parametrize(
    ("entity", "begin", "t"),
    [
        ("Default", 140.0, TEMPORARY_FIRST),
        ("Permanent", 120.0, SECOND),
        ("Temporary", 160.0, TEMPORARY_SECOND),
        ("Fallback", 20.0, FIRST),
    ],
)
def test_a_lane_position_is_on_the_layer_that_it_names_and_followed_there(
    entity: str, begin: float, t: float
) -> None:
    columns = track(run("LaneLayerType"), entity)
    for time in (0.0, 0.5, 0.9):
        assert at(columns, time, "x") == pytest.approx(begin + 10.0 * time, abs=1e-6)
        assert at(columns, time, "y") == pytest.approx(t, abs=1e-6)


def test_a_preferred_layer_is_kept_to_where_roads_have_two() -> None:
    result = run("PreferredLaneLayerAction")
    early, usual = track(result, "Early"), track(result, "Usual")
    for time in (1.0, 3.0, 5.0):
        assert at(early, time, "y") == pytest.approx(FIRST, abs=1e-6)
    assert at(usual, 2.0, "y") == pytest.approx(SECOND, abs=1e-6)
    assert at(usual, 6.0, "y") == pytest.approx(TEMPORARY_SECOND, abs=1e-3)


def test_a_preference_leaves_an_entity_on_the_lane_that_it_follows() -> None:
    late = track(run("PreferredLaneLayerAction"), "Late")
    assert at(late, 5.0, "y") == pytest.approx(TEMPORARY_FIRST, abs=1e-6)


def test_a_preference_decides_on_positions_unless_they_name_a_layer() -> None:
    result = run("PreferredLaneLayerAction")
    assert at(track(result, "Placed"), 0.0, "y") == pytest.approx(SECOND)
    assert at(track(result, "Named"), 0.0, "y") == pytest.approx(TEMPORARY_SECOND)
    other = run("PreferredLaneLayerAction", parameters={"Layer": "temporary"})
    assert at(track(other, "Placed"), 0.0, "y") == pytest.approx(TEMPORARY_SECOND)


@pytest.mark.parametrize(
    ("layer", "ends"),
    [
        ("permanent", {"Named": SECOND, "Kept": TEMPORARY_SECOND, "Preferring": SECOND}),
        (
            "temporary",
            {"Named": TEMPORARY_SECOND, "Kept": TEMPORARY_SECOND, "Preferring": TEMPORARY_SECOND},
        ),
    ],
)
def test_an_absolute_target_lane_is_of_the_named_or_preferred_or_present_layer(
    layer: str, ends: dict[str, float]
) -> None:
    result = run("AbsoluteTargetLane", parameters={"Layer": layer})
    for entity, t in ends.items():
        columns = track(result, entity)
        assert at(columns, 1.0, "y") == pytest.approx(TEMPORARY_FIRST)
        assert at(columns, 3.2, "y") == pytest.approx(t, abs=1e-6)


@pytest.mark.parametrize(("layer", "t"), [("permanent", SECOND), ("temporary", TEMPORARY_SECOND)])
def test_a_relative_target_lane_is_counted_on_the_named_layer_or_that_of_the_reference(
    layer: str, t: float
) -> None:
    result = run("RelativeTargetLane", parameters={"Layer": layer})
    assert at(track(result, "Named"), 3.2, "y") == pytest.approx(t, abs=1e-6)
    assert at(track(result, "Kept"), 3.2, "y") == pytest.approx(TEMPORARY_SECOND, abs=1e-6)


def test_a_layer_that_there_is_not_is_refused() -> None:
    with pytest.raises(InvalidFile, match="layer='painted' is not one of"):
        run("AbsoluteTargetLane", parameters={"Layer": "painted"})


def test_a_lane_that_only_the_permanent_layer_has_is_taken_with_a_remark(tmp_path: Path) -> None:
    """The closed lane of the library's road works: named by its layer it is
    valid, without a layer it breaks a rule.
    """
    text = (
        (LIBRARY / "lane_closure_highway.xosc")
        .read_text("utf-8")
        .replace("../../xodr/library", ROADS.as_posix())
    )
    text = text.replace('path="catalogs', f'path="{LIBRARY.as_posix()}/catalogs')
    named, unnamed = tmp_path / "named.xosc", tmp_path / "unnamed.xosc"
    named.write_text(text, "utf-8")
    unnamed.write_text(text.replace('s="1000" layer="permanent"', 's="1000"'), "utf-8")
    assert [problem.rule for problem in check(named)] == []
    assert [problem.rule for problem in check(unnamed)] == [LANE_UID]
    first, second = (runner.run(path, sut="none", world="kinematic") for path in (named, unnamed))
    assert [
        "the lane of the permanent layer is assumed" in each
        for each in second.remarks
        if each not in first.remarks
    ] == [True]
    assert second.trajectories.equals(first.trajectories)
    assert at(track(first, "Merging"), 17.0, "y") == pytest.approx(-3.25 / 2, abs=1e-6)
