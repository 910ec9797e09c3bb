"""Families of sites: no two alike, the same each time; sensors miss and blur as they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.recorder import record
from recognition.recorder.simulation import EXACT, Sensor, VehicleMotion
from recognition.recorder.sites import KINDS, family
from recognition.recordings import open as open_data_set
from schemas import check


def test_every_site_of_a_family_has_a_map_of_its_own() -> None:
    sites = family(3, 2 * len(KINDS))
    maps = [site.road_map().to_xml() for site in sites.values()]
    assert len(set(maps)) == len(maps) == 2 * len(KINDS)


def test_a_seed_gives_the_same_sites_whatever_their_number() -> None:
    few, many = family(3, 4), family(3, 12)
    for name, site in few.items():
        assert site.road_map().to_xml() == many[name].road_map().to_xml()
        assert (site.flows, site.sensor, site.fleet) == (
            many[name].flows,
            many[name].sensor,
            many[name].fleet,
        )


def test_seeds_have_no_map_in_common() -> None:
    one, other = (
        {site.road_map().to_xml() for site in family(seed, 20).values()} for seed in (3, 4)
    )
    assert not one & other


@pytest.mark.parametrize("kind", KINDS)
def test_maps_of_all_kinds_are_valid(kind: str, tmp_path: Path) -> None:
    sites = [
        site for name, site in family(5, 2 * len(KINDS)).items() if name.startswith(f"{kind}_05")
    ]
    for site in sites:
        path = site.road_map().write(tmp_path / f"{site.name}.xodr")
        assert not [problem for problem in check(path) if problem.severity == "error"]


@pytest.mark.slow
def test_a_family_is_recorded_with_one_recording_of_each_site(tmp_path: Path) -> None:
    record(tmp_path, scale=0.3, seed=9, families=2)
    sources = open_data_set(tmp_path).sources
    assert sorted(source.path.parent.name for source in sources) == [
        "crossing_09_001",
        "motorway_09_000",
    ]
    assert all(source.load().tracks for source in sources)


def moving(vehicles: int = 200, rows: int = 20) -> VehicleMotion:
    vehicle, frame = np.repeat(np.arange(vehicles), rows), np.tile(np.arange(rows), vehicles)
    zeros = np.zeros(len(vehicle))
    return VehicleMotion(
        vehicle, frame, frame * 1.0, zeros, zeros, zeros + 10.0, zeros, zeros, zeros
    )


def test_an_exact_sensor_sees_everything_as_it_is() -> None:
    assert EXACT.sees(moving(), np.random.default_rng(0)) is not None
    for seen, true in zip(EXACT.sees(moving(), np.random.default_rng(0)), moving(), strict=True):
        assert np.array_equal(seen, true)


def test_sensors_miss_vehicles_and_cut_tracks() -> None:
    seen = Sensor(dropped=0.3, cut=0.5).sees(moving(), np.random.default_rng(0))
    vehicles, rows = np.unique(seen.vehicle, return_counts=True)
    assert 100 < len(vehicles) < 180
    assert rows.min() >= 4
    assert 0.3 < np.mean(rows < 20) < 0.7
    for one in vehicles:
        assert (np.diff(seen.frame[seen.vehicle == one]) == 1).all()


def test_noise_is_as_great_as_said() -> None:
    seen = Sensor(noise=0.2).sees(moving(), np.random.default_rng(0))
    assert seen.y.std() == pytest.approx(0.2, rel=0.1)
    assert (seen.x - moving().x).std() == pytest.approx(0.2, rel=0.1)


def test_distortion_is_as_great_as_said_and_varies_slowly_from_place_to_place() -> None:
    true = moving(400, 60)
    seen = Sensor(distortion=0.5).sees(true, np.random.default_rng(1))
    assert seen.y.std() == pytest.approx(0.5, rel=0.3)
    for one in (0, 1):
        rows = seen.vehicle == one
        assert np.abs(np.diff(seen.y[rows])).max() < 0.35
        along = np.gradient(seen.y[rows], true.x[rows])
        assert seen.vy[rows] == pytest.approx(10.0 * along, abs=0.2)
        assert np.tan(seen.h[rows]) == pytest.approx(seen.vy[rows] / seen.vx[rows], abs=1e-6)
    offsets = seen.y.reshape(400, 60)
    assert 0.05 < offsets.mean(axis=0).std() < 0.5
    assert offsets.std(axis=0).mean() == pytest.approx(0.5 / np.sqrt(2.0), rel=0.2)
