"""Intake: recordings that are impossible are refused with a reason that would
mend them; possible ones pass.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recognition.recordings as datasets
from recognition.recordings.intake import REFUSED, REPAIRED
from recognition.recordings.source import participant
from schemas.common.errors import InvalidFile
from tests.commands import Command
from tests.recognition.traffic import ind_rows, interaction_rows, write_csv, write_ind
from xodr import builders

Row = dict[str, Any]


def traffic(count: int = 6, n: int = 60) -> list[Row]:
    """Cars 25 m apart on one lane, at 10 m/s, with a brake in the middle."""
    rows = []
    for number in range(count):
        rows += interaction_rows(number, 25.0 * number, -1.9, 10.0, 0.0, 0.0, n=n)
    return rows


def source_of(
    folder: Path, rows: list[Row], name: str = "vehicle_tracks_000.csv"
) -> datasets.Source:
    (source,) = datasets.open(write_csv(folder / "site" / name, rows)).sources
    return source


def verdict(folder: Path, rows: list[Row]) -> tuple[str, list[str], float]:
    source = source_of(folder, rows)
    source.examine()
    assert source.report is not None
    return (
        source.report.verdict,
        [check.reason for check in source.report.checks],
        source.report.quality,
    )


def test_possible_traffic_is_fit(tmp_path: Path) -> None:
    assert verdict(tmp_path, traffic()) == ("fit", [], 1.0)


@pytest.mark.parametrize(
    ("step", "true"), [(50, 0.1), (200, 0.1), (20, 0.1), (40, 0.1), (100, 0.04), (100, 0.2)]
)
def test_a_wrong_step_is_refused_in_both_directions_and_the_right_one_is_named(
    tmp_path: Path, step: int, true: float
) -> None:
    """Times are written `step` ms apart; the places move as if `true` s passed."""
    rows = [
        row
        | {
            "timestamp_ms": step * int(row["frame_id"]),
            "x": 25.0 * int(row["track_id"]) + 10.0 * true * int(row["frame_id"]),
        }
        for row in traffic()
    ]
    source = source_of(tmp_path, rows)
    with pytest.raises(
        InvalidFile,
        match=r"the places move at .* times the stated speeds: .*a step of "
        rf"{true:g}\d* s would fit",
    ):
        source.load()


@pytest.mark.parametrize("frames", [4, 10])
@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_wrong_step_is_refused_in_recordings_of_less_than_a_second(
    tmp_path: Path, frames: int, times: float
) -> None:
    rows = [
        row | {"x": 25.0 * int(row["track_id"]) + times * int(row["frame_id"])}
        for row in traffic(n=frames)
    ]
    assert verdict(tmp_path / "sound", traffic(n=frames)) == ("fit", [], 1.0)
    with pytest.raises(InvalidFile, match=f"a step of {0.1 * times:g} s would fit"):
        source_of(tmp_path, rows).load()


@pytest.mark.parametrize(("unit", "factor"), [("km/h", 3.6), ("mph", 2.23694)])
def test_speeds_in_other_units_are_named(tmp_path: Path, unit: str, factor: float) -> None:
    found, reasons, _ = verdict(tmp_path, [row | {"vx": 10.0 * factor} for row in traffic()])
    assert found == REFUSED
    assert f"the speeds may be in {unit}, or a step of" in reasons[0]


def test_vehicles_inside_each_other_are_no_scene(tmp_path: Path) -> None:
    rows = [row | {"x": 3.0 * int(row["track_id"]) + float(row["frame_id"])} for row in traffic()]
    found, reasons, _ = verdict(tmp_path, rows)
    assert found == REFUSED
    assert "100.0% of the vehicles are inside another one" in reasons[0]
    assert "each vehicle has a clock of its own, as all begin at once" in reasons[0]


def test_two_that_collide_are_a_scene(tmp_path: Path) -> None:
    crash = interaction_rows(20, 0.0, 30.0, 10.0, 0.0, 0.0) + interaction_rows(
        21, 1.0, 30.0, 10.0, 0.0, 0.0
    )
    found, reasons, quality = verdict(tmp_path, traffic(20) + crash)
    assert found == "fit"
    assert "2 pairs" not in reasons[0] and "inside another one" in reasons[0]
    assert 0.9 < quality < 1.0


def test_a_bicycle_that_is_too_fast_is_left_out(tmp_path: Path) -> None:
    fast = [
        row | {"agent_type": "bicycle"} for row in interaction_rows(9, 0.0, 30.0, 20.0, 0.0, 0.0)
    ]
    source = source_of(tmp_path, traffic() + fast)
    recording = source.load()
    assert source.report is not None and source.report.verdict == REPAIRED
    assert "9" not in recording.tracks and len(recording.tracks) == 6
    assert "too fast for their category, left out: bicycle 9" in " ".join(source.report.remarks)


def test_traffic_at_impossible_speeds_is_refused(tmp_path: Path) -> None:
    """As with a step that is too short, where the speeds are derived from it: cars at 90 m/s."""
    rows = [
        row | {"x": 9.0 * float(row["frame_id"]) + 25.0 * int(row["track_id"]), "vx": 90.0}
        for row in traffic()
    ]
    found, reasons, _ = verdict(tmp_path, rows)
    assert found == REFUSED
    assert "6 of 6 tracks are too fast for their category, as car 0 at 90 m/s" in reasons[0]


def test_sizes_in_feet_are_refused(tmp_path: Path) -> None:
    found, reasons, _ = verdict(
        tmp_path, [row | {"length": 14.8, "width": 5.9} for row in traffic()]
    )
    assert found == REFUSED
    assert any("6 of 6 vehicles have sizes of other ones" in reason for reason in reasons)


def test_headings_with_another_zero_are_refused(tmp_path: Path) -> None:
    rows = [
        row | {"psi_rad": math.pi / 2, "vx": 7.07, "vy": 7.07, "y": float(row["x"])}
        for row in traffic()
    ]
    turned = [row | {"psi_rad": math.pi / 4 + math.pi / 2} for row in rows]
    found, reasons, _ = verdict(tmp_path, turned)
    assert found == REFUSED
    assert any("headings have another zero or unit" in reason for reason in reasons)


def test_missing_frames_lower_the_quality(tmp_path: Path) -> None:
    rows = [row for row in traffic() if int(row["frame_id"]) % 10 not in (3, 4)]
    found, reasons, quality = verdict(tmp_path, rows)
    assert found == "fit"
    assert "are missing inside tracks" in reasons[0]
    assert quality == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("factor", [2, 5])
def test_a_wrong_step_is_named_where_vehicles_brake_and_places_have_noise(
    tmp_path: Path, factor: int
) -> None:
    # Speeds change within what is taken for a second, and row by row the noise is half the way.
    noise, rows = np.random.default_rng(4), []
    for number in range(6):
        frames = np.arange(90)
        speed = 5.0 + 4.0 * np.cos(0.06 * frames + number)
        x = 10.0 + np.cumsum(0.1 * speed) + noise.normal(0.0, 0.1, 90)
        rows += [
            row | {"timestamp_ms": 100 // factor * frame, "x": x[frame], "vx": speed[frame]}
            for frame, row in enumerate(
                interaction_rows(number, 0.0, 8.0 * number, 0.0, 0.0, 0.0, 90)
            )
        ]
    with pytest.raises(InvalidFile, match=r"a step of 0\.(1|09[5-9])\d* s would fit"):
        source_of(tmp_path, rows).load()


def test_an_id_used_twice_is_cut_and_told(tmp_path: Path) -> None:
    rows = [
        row
        | (
            {"x": float(row["x"]) + 300.0}
            if int(row["track_id"]) == 0 and int(row["frame_id"]) > 30
            else {}
        )
        for row in traffic()
    ]
    found, reasons, _ = verdict(tmp_path, rows)
    assert found == REPAIRED
    assert (
        "ids were used twice or places are wrong: tracks are cut where they jump, 1 in number"
        in reasons
    )


def test_exid_takes_sizes_from_the_tracks_where_tables_contradict_each_other(
    tmp_path: Path,
) -> None:
    rows = ind_rows(1, 0.0, 0.0, 5.0, 0.0, latLaneCenterOffset=0.0, laneChange=0)
    path = write_ind(tmp_path, rows)
    path.with_name("00_tracksMeta.csv").write_text(
        path.with_name("00_tracksMeta.csv").read_text().replace(",2.0,", ",1.0,")
    )
    write_csv(path, [row | {"width": 2.5} for row in rows])
    (source,) = datasets.open(path).sources
    recording = source.examine()
    assert {track.box.width for track in recording.tracks.values()} == {2.5}
    assert source.report is not None
    assert any(
        "have another size" in remark and "that of the tracks counts" in remark
        for remark in source.report.remarks
    )


# the command ------------------------------------------------------------------------------------


def test_inspect_prints_a_verdict_with_reasons_and_skipped_files(
    command: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "site"
    write_csv(folder / "vehicle_tracks_000.csv", traffic())
    write_csv(folder / "vehicle_tracks_001.csv", [row | {"vx": 50.0} for row in traffic()])
    builders.straight_highway(lanes=1, length=400.0).write(folder / "site.xodr")
    for name in ("a.bin", "b.bin", "c.dat"):
        (folder / name).write_bytes(b"\0")
    answer = command("xosc-recognize", "inspect", str(folder))
    assert answer.code == 3
    lines = answer.out.splitlines()
    assert lines[0].startswith("fit       1.000  site/000 (INTERACTION)")
    assert lines[1].startswith("refused   0.000  site/001 (INTERACTION)")
    assert "a step of 0.02 s would fit, it is 0.1 s" in lines[2]
    assert "3 files are of no known format: a.bin, b.bin, c.dat (2 .bin, 1 .dat)" in answer.err


def test_inspect_names_file_and_line_of_what_it_cannot_read(
    command: Command, tmp_path: Path
) -> None:
    rows = traffic()
    write_csv(tmp_path / "site" / "vehicle_tracks_000.csv", [rows[0] | {"x": "here"}, *rows[1:]])
    answer = command("xosc-recognize", "inspect", str(tmp_path / "site"))
    assert answer.code == 3
    assert "vehicle_tracks_000.csv:2: column x: 'here' is not a number" in answer.out


def test_inspect_compares_with_the_map(command: Command, tmp_path: Path) -> None:
    folder = tmp_path / "site"
    write_csv(folder / "vehicle_tracks_000.csv", [row | {"y": 40.0} for row in traffic()])
    builders.straight_highway(lanes=1, length=400.0).write(folder / "site.xodr")
    answer = command("xosc-recognize", "inspect", str(folder), "--json")
    assert answer.code == 3
    assert '"verdict": "refused"' in answer.out
    assert "only 0% of the vehicles' places are on a road of site.xodr" in answer.out


def test_a_catalogue_refuses_what_inspect_refuses_and_counts_no_exposure(
    command: Command, tmp_path: Path
) -> None:
    folder, out = tmp_path / "site", tmp_path / "out"
    write_csv(folder / "vehicle_tracks_000.csv", [row | {"vx": 50.0} for row in traffic()])
    builders.straight_highway(lanes=1, length=400.0).write(folder / "site.xodr")
    answer = command(
        "xosc-recognize", str(folder), "--labels", "rules", "--out", str(out), "--quiet"
    )
    assert answer.code == 3
    assert "a step of 0.02 s would fit" in answer.err
    assert (out / "exposure.csv").read_text().count("\n") == 1


def test_numbers_of_a_fit_recording_do_not_depend_on_where_it_is() -> None:
    """The ratio of speeds is taken over a second: a constant shift changes nothing."""
    from recognition.recordings.intake import check_ratio, one_factor

    assert check_ratio(np.full(10, 1.2), 0.1) is None
    assert one_factor(np.array([2.0, 2.02, 1.98, 2.0])) == pytest.approx(2.0)
    assert one_factor(np.array([0.5, 3.0, 2.0, 1.0])) is None


def test_an_unknown_category_is_refused_with_the_most_similar_one() -> None:
    with pytest.raises(InvalidFile, match=r"no category 'cars'; .*car"):
        participant("a", "cars")
