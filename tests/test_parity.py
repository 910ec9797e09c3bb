"""A sample of public scenarios moves as in the reference player; docs/parity.md
says where and why others do not.
"""

from __future__ import annotations

import csv
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

import runner
import xosc

METRES, SECONDS = 0.25, 0.25
"""Tolerances of places, and of the end of the run"""

SAMPLE = [
    ("alks", "alks_scenario_4_4_1_cut_in_no_collision_template.xosc", ""),
    ("alks", "alks_scenario_4_5_1_cut_out_fully_blocking_template.xosc", ""),
    ("alks_variation", "alks_scenario_4_5_1_cut_out_fully_blocking_variation.xosc", "8639"),
    ("ncap_2023", "NCAP_AEB_C2C_CCFtap_2023.xosc", ""),
    ("ncap_2023_variation", "NCAP_AEB_C2C_CCRb_Variation_2023.xosc", "3"),
    ("ncap_2023", "NCAP_AEB_VRU_CPTA_2023.xosc", ""),
    ("esmini", "cut-in_interactive.xosc", ""),
    ("esmini", "follow_reference.xosc", ""),
    ("esmini", "keep_lateral_distance.xosc", ""),
    ("esmini", "ltap-od.xosc", ""),
    ("esmini", "speed-profile.xosc", ""),
    ("esmini", "trailer_connect.xosc", ""),
]


@pytest.mark.parametrize(
    ("group", "name", "permutation"), SAMPLE, ids=lambda value: value.removesuffix(".xosc")
)
def test_everyone_is_where_the_reference_has_them(
    corpora: Path, reference: Path, group: str, name: str, permutation: str
) -> None:
    row = reference_run(reference / f"{group}.runs.csv", name, permutation)
    path, parameters = corpora / row["file"], dict[str, str]()
    if permutation:
        path, parameters = next(
            islice(xosc.variations(path, enforce_constraints=False), int(permutation), None)
        )
    end = float(row["end_time"])
    result = runner.run(
        path, parameters=parameters, timestep=0.01, sut=None, world="kinematic", max_time=end + 1.0
    )
    expected = pq.read_table(
        reference / f"{group}.parquet", filters=[("run", "==", int(row["run"]))]
    )
    assert abs(result.end_time - end) <= SECONDS
    entities = pc.unique(expected["entity"]).to_pylist()
    assert set(entities) == set(result.recording.tracks)
    for entity in entities:
        there = expected.filter(pc.equal(expected["entity"], entity))
        times, track = there["time"].to_numpy(), result.recording.tracks[entity].columns
        both = times <= min(end, result.end_time)
        x, y = (
            np.interp(times, track["time"], track[axis]) - there[axis].to_numpy()
            for axis in ("x", "y")
        )
        assert np.hypot(x, y)[both].max() <= METRES, (
            f"{entity} at {times[np.hypot(x, y).argmax()]:.1f} s"
        )


def reference_run(runs: Path, name: str, permutation: str) -> dict[str, str]:
    """The line of a reference run that the scenario itself ended."""
    with runs.open(newline="") as lines:
        return next(
            row
            for row in csv.DictReader(lines)
            if Path(row["file"]).name == name
            and row["permutation"] == permutation
            and row["end"] == "end"
        )
