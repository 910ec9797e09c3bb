"""Parquet tables and OpenLABEL files of runs, read back by other packages."""

from __future__ import annotations

import json
from pathlib import Path

import duckdb
import numpy as np
import pyarrow.parquet as pq
import pytest

import runner
from runner.exchange.exports import openlabel, parquet
from runner.exchange.exports.moments import box_centre
from tests.runner.files import car, place, scenario
from xosc.exports.draft import Folder
from xosc.writing.tags import ASAM, Tag, tags_of, to_bytes

TAGS = [Tag("RoadUserCar", None, ASAM), Tag("scenarioClass", "cut in"), Tag("metric", 1.5)]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> runner.RunResult:
    """Two cars, tagged by an OpenLABEL file beside the scenario."""
    folder = tmp_path_factory.mktemp("tables")
    path = scenario(
        folder,
        road="curve",
        entities=[car("Ego"), car("Ö")],
        init=place("Ego", 20, 10) + place("Ö", 150, 9, lane=1),
    )
    path.with_name("scenario.openlabel.json").write_bytes(to_bytes(TAGS, path.name, "tests"))
    return runner.run(path, world="kinematic", timestep=0.1, sut="none")


def test_duckdb_reads_trajectories_measures_and_tags(
    result: runner.RunResult, tmp_path: Path
) -> None:
    assert parquet.export(result, "run", Folder(tmp_path)) == []
    rows = duckdb.sql(
        f"select time, x, speed from '{tmp_path}/run.parquet' where entity = 'Ö' order by time"
    ).fetchall()
    track = result.recording.tracks["Ö"].columns
    assert np.array_equal(
        np.array(rows), np.column_stack([track["time"], track["x"], track["speed"]])
    )
    assert duckdb.sql(f"select count(*) from '{tmp_path}/run.criticality.parquet'").fetchall() == [
        (len(rows),)
    ]
    tags = duckdb.sql(f"select type, value, ontology from '{tmp_path}/run.tags.parquet'").fetchall()
    assert {
        (tag.type, None if tag.value is None else str(tag.value), tag.ontology) for tag in TAGS
    } == set(tags)


def test_a_run_gives_the_same_bytes_again(result: runner.RunResult, tmp_path: Path) -> None:
    for target in (parquet, openlabel):
        for name in ("a", "b"):
            target.export(result, "run", Folder(tmp_path / name))
    names = [path.name for path in sorted((tmp_path / "a").iterdir())]
    assert len(names) == 7
    assert all(
        (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
        for name in names
    )


def test_labels_have_everyones_box_in_every_frame(result: runner.RunResult, tmp_path: Path) -> None:
    openlabel.export(result, "run", Folder(tmp_path))
    content = json.loads((tmp_path / "run.openlabel.json").read_text(encoding="utf-8"))["openlabel"]
    for uid, (name, track) in zip(content["objects"], result.recording.tracks.items(), strict=True):
        last = len(track.columns["time"]) - 1
        assert content["objects"][uid]["name"] == name
        assert content["objects"][uid]["frame_intervals"] == [{"frame_start": 0, "frame_end": last}]
        for row, frame in enumerate(content["frames"].values()):
            (box,) = frame["objects"][uid]["object_data"]["cuboid"]
            assert np.allclose(box["val"][:3], box_centre(track)[row], atol=1e-6)
            assert np.cos(box["val"][5] - track.columns["h"][row]) == pytest.approx(1.0)
            assert box["val"][6:] == [5.0, 2.0, 1.5]


def test_tags_go_round(result: runner.RunResult, tmp_path: Path) -> None:
    openlabel.export(result, "scenario", Folder(tmp_path))
    assert sorted(tags_of(tmp_path / "scenario.xosc")) == sorted(TAGS)


def test_without_a_file_the_headers_properties_are_the_tags(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    tagged = (
        '<Properties><Property name="openlabel.cutIn" value="true"/><Property '
        'name="openlabel.class" value="a b"/>'
    )
    path.write_text(
        path.read_text().replace(
            'description="test"/>', f'description="test">{tagged}</Properties></FileHeader>'
        )
    )
    assert tags_of(path) == [Tag("class", "a b"), Tag("cutIn")]


def test_parquet_keeps_the_columns_of_results(result: runner.RunResult, tmp_path: Path) -> None:
    parquet.export(result, "run", Folder(tmp_path))
    assert pq.read_table(tmp_path / "run.parquet").equals(result.trajectories)
