"""Severity of contacts: worked out by hand, by published curves, and as columns,
terminal lines and pages show it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import runner
from runner.batch.outputs.report import impact
from runner.judging.measures.criticality import criticality
from runner.judging.measures.kinds.severity import (
    change_of_velocity,
    occupant_risk,
    pedestrian_risk,
)
from runner.view.report import report
from tests.commands import Command
from tests.runner.judging.test_criticality import motion

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"


def severity(ego_speed: float, other_speed: float, **who: object) -> dict[str, float | None]:
    """Severity measures of an ego that runs into another participant 50 m ahead."""
    other = replace(motion("Other", 50.0, other_speed), **who)  # type: ignore[arg-type]
    found = criticality(replace(motion("Ego", 0.0, ego_speed), mass=1500.0), [other]).summary
    return {
        name: found[name] and found[name]["value"]
        for name in ("impact_speed", "delta_v", "fatality_risk")
    }


def test_velocity_changes_by_the_shares_of_the_masses() -> None:
    assert severity(20.0, 5.0, mass=1500.0)["impact_speed"] == pytest.approx(15.0)
    assert severity(20.0, 5.0, mass=1500.0)["delta_v"] == pytest.approx(7.5)
    assert severity(20.0, 5.0, mass=13500.0)["delta_v"] == pytest.approx(13.5)
    assert severity(20.0, 5.0, mass=0.0, category="truck")["delta_v"] == pytest.approx(
        15.0 * 12 / 13.5
    )
    assert severity(20.0, 0.0, kind="miscellaneous")["delta_v"] == pytest.approx(20.0)
    assert change_of_velocity(10.0, math.inf, 1000.0) == 0.0


def test_the_curves_are_the_published_ones() -> None:
    mph = 0.44704
    assert occupant_risk(71.0 * mph) == pytest.approx(1.0)
    assert occupant_risk(35.5 * mph) == pytest.approx(1 / 16)
    assert occupant_risk(100.0) == 1.0
    assert pedestrian_risk(50.0 / 3.6) == pytest.approx(0.083, abs=1e-3)  # 8 % at 50 km/h
    assert pedestrian_risk(6.9 / 0.09 / 3.6) == pytest.approx(0.5)


def test_the_risk_is_that_of_the_participant_with_the_greater_one() -> None:
    light = severity(30.0, 0.0, mass=500.0)
    assert light["fatality_risk"] == pytest.approx(
        occupant_risk(30.0 * 0.75)
    )  # the lighter one changes its velocity more
    walker = severity(14.0, 0.0, kind="pedestrian", category="pedestrian")
    assert walker["fatality_risk"] == pytest.approx(pedestrian_risk(14.0))
    rider = severity(14.0, 0.0, category="bicycle")
    assert rider["fatality_risk"] == walker["fatality_risk"]


def test_a_run_without_contact_has_none() -> None:
    assert set(severity(10.0, 10.0).values()) == {None}


def test_the_point_is_on_the_side_that_is_touched() -> None:
    ego = motion("Ego", 0.0, 20.0)
    ahead = criticality(ego, [motion("Lead", 20.0, 10.0, y=1.0)]).impact
    assert ahead is not None and ahead.side == "front"
    assert ahead.point == pytest.approx(
        (2.5, 0.5), abs=0.6
    )  # half of the box's 5 m; the boxes overlap on the left half
    right = criticality(ego, [motion("Right", 0.5, 20.0, y=-4.0, sideways=1.0)]).impact
    assert right is not None and right.side == "right"
    assert right.point == pytest.approx((0.25, -1.0), abs=0.1)


def test_limits_take_it() -> None:
    result = runner.run(
        LIBRARY / "highway_lead_brake.xosc",
        world="kinematic",
        fail_if=("fatality_risk>0.01", "delta_v>1"),
    )
    assert any("delta_v is" in text for text in result.verdict.reasons)


def test_contacts_are_columns_lines_and_rows_of_the_page(tmp_path: Path, command: Command) -> None:
    out = tmp_path / "batch"
    answer = command(
        "xosc-run",
        "--sut",
        "none",
        "--world",
        "kinematic",
        LIBRARY / "simple_cut_in_variation.xosc",
        "--out",
        out,
    )
    lines = answer.out.splitlines()
    first = next(
        number for number, line in enumerate(lines) if line.startswith("worst 5 of 7 contacts")
    )
    speeds = [float(line.split()[0]) for line in lines[first + 1 : first + 6]]
    assert speeds == sorted(speeds, reverse=True)
    assert "the ego hit CutIn with its front" in lines[first + 1]
    rows = {row["name"]: row for row in pq.read_table(out / "runs.parquet").to_pylist()}
    hit = max(rows.values(), key=lambda row: row["impact_speed"] or 0.0)
    assert (hit["impact_side"], hit["ego_strikes"]) == ("front", True)
    assert hit["impact_speed"] == pytest.approx(speeds[0], abs=0.05)
    shown = {run["name"]: run for run in report(out)["runs"]}
    assert shown[hit["name"]]["impact"].startswith("the ego hit CutIn with its front, 2.")
    passed = next(run for run in shown.values() if run["state"] == "passed")
    assert passed["impact"] is None and passed["measures"]["impact_speed"] is None


def test_a_batch_of_an_earlier_version_has_no_severity(tmp_path: Path, command: Command) -> None:
    out = tmp_path / "batch"
    command(
        "xosc-run",
        "--sut",
        "none",
        "--world",
        "kinematic",
        LIBRARY / "simple_cut_in.xosc",
        "--out",
        out,
    )
    path = out / "runs.parquet"
    table = pq.read_table(path)
    new = [
        name
        for name in table.column_names
        if name.startswith(("impact", "delta_v", "fatality", "ego_strikes"))
    ]
    assert len(new) > 9
    pq.write_table(table.drop_columns(new), path)
    (row,) = report(out)["runs"]
    assert row["state"] == "failed" and row["measures"]["impact_speed"] is None


def test_a_run_that_passes_has_no_contact() -> None:
    assert impact(runner.run(LIBRARY / "simple_cut_in.xosc", world="kinematic", sut="adas")) is None
