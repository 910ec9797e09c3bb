"""Assessments: criteria of protocols, points that add up to the protocol's,
tables as HTML and CSV.
"""

from __future__ import annotations

import csv
import hashlib
from pathlib import Path

import pytest

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.folder import load_run, write_run
from runner.judging.assessment.profiles import profile, profiles
from runner.judging.assessment.protocol import (
    AssessedRun,
    AssessmentProfile,
    CutIn,
    FirstContact,
    SpeedBands,
    SpeedReduction,
)
from runner.judging.settings import RunSettings
from runner.view.assessment import write_assessment
from schemas.common.errors import UsageError
from tests.commands import Command
from tests.runner.chromium import Browser
from tests.runner.files import car, distribution, place, scenario

SPEED = "Ego_speed_kph"
SETTINGS = RunSettings(sut=None, world="kinematic")


def drive(speed: float, own: float | None, relative: float = 0.0) -> AssessedRun:
    contact = None if own is None else FirstContact("Target", 3.0, relative, own)
    return AssessedRun({SPEED: speed}, contact, Path(), load_run)


@pytest.mark.parametrize(
    ("own", "colour", "score"),
    [
        (4.9, "green", 1.0),
        (5.0, "yellow", 0.75),
        (15.0, "orange", 0.5),
        (30.0, "brown", 0.25),
        (40.0, "red", 0.0),
    ],
)
def test_a_band_of_impact_speeds_has_a_colour_and_a_share_of_the_points(
    own: float, colour: str, score: float
) -> None:
    test = next(each for each in profile("euro-ncap-2023").tests if each.name == "CCRs")
    assert test.criterion.judge(drive(50.0, own))[::2] == (score, colour)


def test_bands_that_are_not_public_give_no_points_but_for_an_avoided_contact() -> None:
    criterion = SpeedBands({}, SPEED, relative=True)
    assert criterion.judge(drive(30.0, None)).result == "met"
    found = criterion.judge(drive(30.0, 10.0, 2.0))
    assert (found.score, found.result) == (None, "not assessed")
    assert "30 km/h are published as a figure only" in found.reason


@pytest.mark.parametrize(
    ("own", "result"),
    [(30.0, "met"), (30.1, "partly met"), (40.0, "partly met"), (40.1, "not met")],
)
def test_a_reduction_of_speed_counts_in_steps(own: float, result: str) -> None:
    assert (
        SpeedReduction(((20.0, 1.0), (10.0, 0.5)), SPEED).judge(drive(50.0, own)).result == result
    )


@pytest.mark.parametrize("name", sorted(profiles()))
def test_points_of_a_grid_add_up_to_those_of_its_test(name: str) -> None:
    found: AssessmentProfile = profile(name)
    for test in found.tests:
        points: list[tuple[float, ...]] = [()]
        for weights in test.grid.values():
            points = [(*point, value) for point in points for value in weights]
        assert sum(test.share(point) for point in points if test.grid) == pytest.approx(
            test.points if test.grid else 0.0
        )
    assert len({test.name for test in found.tests}) == len(found.tests)


def test_the_parts_of_euro_ncap_2023_are_its_nine_points_and_lane_support() -> None:
    found = profile("euro-ncap-2023")
    parts = {part.name: part.points for part in found.absent}
    assert (
        sum(test.points for test in found.tests) + sum(parts.values())
        == 9.0 + parts["Lane support systems"]
    )


def test_the_parts_of_euro_ncap_2026_are_the_hundred_points_of_crash_avoidance() -> None:
    found = profile("euro-ncap-2026")
    assert sum(part.points for part in (*found.tests, *found.absent)) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("speed", "relative", "colour", "score"),
    [
        (20.0, 0.1, "red", 0.0),
        (30.0, 9.9, "brown", 0.25),
        (30.0, 10.0, "red", 0.0),
        (40.0, 10.0, "brown", 0.25),
        (50.0, 9.9, "yellow", 0.75),
        (130.0, 29.9, "brown", 0.25),
        (130.0, 30.0, "red", 0.0),
    ],
)
def test_colours_of_2026_are_by_the_relative_speed_at_contact(
    speed: float, relative: float, colour: str, score: float
) -> None:
    test = next(each for each in profile("euro-ncap-2026").tests if each.name == "CCRs")
    assert test.criterion.judge(drive(speed, 50.0, relative))[::2] == (score, colour)
    assert "no test at 35 km/h" in test.criterion.judge(drive(35.0, 10.0, 10.0)).reason


def test_a_run_is_a_test_point_only_at_the_speed_of_the_target_that_belongs_to_it() -> None:
    test = next(each for each in profile("euro-ncap-2026").tests if each.name == "CCRm")
    runs = [
        AssessedRun(
            {SPEED: 100.0, "Overlap": 75.0, "GVT_init_speed_kph": target}, None, Path(), load_run
        )
        for target in (20.0, 40.0)
    ]
    assert [test.point(run) for run in runs] == [None, (100.0, 75.0)]


def test_each_public_file_is_of_a_test(corpora: Path) -> None:
    import re

    ncap = "ncap_2023", "*_2023.xosc"
    for name, folder, files in (
        ("euro-ncap-2023", *ncap),
        ("euro-ncap-2026", *ncap),
        ("r157", "alks", "alks_*.xosc"),
    ):
        stems = [path.stem for path in (corpora / folder).rglob(files)]
        assert len(stems) > 25
        assert [
            stem
            for stem in stems
            if not any(re.search(test.files, stem) for test in profile(name).tests)
        ] == []


def test_a_contact_after_a_late_cut_in_is_no_failure(tmp_path: Path) -> None:
    for gap, result in ((31.0, "not assessed"), (90.0, "not met")):
        run = runner.run(
            "xosc/library/r157_cut_in.xosc", SETTINGS, parameters={"CutIn_Gap_m": str(gap)}
        )
        folder = tmp_path / f"{gap:g}"
        write_run(run, folder)
        assert run.criticality is not None and run.criticality.impact is not None
        contact = FirstContact(
            run.criticality.impact.other, run.criticality.impact.time, 50.0, 90.0
        )
        found = CutIn().judge(AssessedRun({}, contact, folder, load_run))
        assert (found.result, "limit 1.50 s" in found.reason) == (result, True), found


@pytest.fixture(scope="module")
def assessed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of four CCRs tests, of which those at 50 km/h collide, and
    of a scenario of no test.
    """
    folder = tmp_path_factory.mktemp("assessed")
    values = {SPEED: 50.0, "Overlap": 100.0, "Gap": 30.0}
    init = place("Ego", 100, "${$Ego_speed_kph / 3.6}") + place(
        "Lead", "${100 + 90 - $Ego_speed_kph}", 0
    )
    scenario(
        folder,
        "NCAP_AEB_C2C_CCR_x",
        entities=[car("Ego"), car("Lead")],
        init=init,
        stop=4.0,
        parameters=values,
    )
    scenario(folder, "own")
    paths = [
        distribution(
            folder,
            "NCAP_AEB_C2C_CCRs_y",
            {SPEED: (25, 50, 25), "Overlap": (75, 100, 25)},
            "NCAP_AEB_C2C_CCR_x",
        )
    ]
    list(run_batch(jobs_of([*paths, folder / "own.xosc"], {}, True), SETTINGS, out=folder / "out"))
    write_assessment(folder / "out", "euro-ncap-2023", SETTINGS)
    return folder / "out"


def test_the_table_has_each_run_with_its_points_and_the_digest_of_its_file(assessed: Path) -> None:
    rows = list(csv.DictReader((assessed / "assessment.csv").read_text().splitlines()))
    found = [
        (row["test"], row["test speed (km/h)"], row["overlap (%)"], row["result"], row["colour"])
        for row in rows
    ]
    assert found == [
        ("CCRs", "25", "75", "met", "green"),
        ("CCRs", "25", "100", "met", "green"),
        ("CCRs", "50", "75", "not met", "red"),
        ("CCRs", "50", "100", "not met", "red"),
        ("", "", "", "not assessed", ""),
    ]
    assert float(rows[1]["points"]) == pytest.approx(2.0 / 14.0 * 2.0 / 6.0, abs=1e-4)
    assert float(rows[2]["ego impact speed (km/h)"]) == pytest.approx(50.0)
    assert rows[0]["sha256"] == hashlib.sha256(Path(rows[0]["file"]).read_bytes()).hexdigest()
    assert "of no test of the protocol" in rows[4]["reason"]


def test_the_same_batch_gives_the_same_bytes(assessed: Path) -> None:
    before = [(assessed / name).read_bytes() for name in ("assessment.html", "assessment.csv")]
    write_assessment(assessed, "euro-ncap-2023", SETTINGS)
    assert before == [
        (assessed / name).read_bytes() for name in ("assessment.html", "assessment.csv")
    ]


@pytest.mark.slow
def test_the_page_tells_points_with_what_is_open_and_its_files(
    assessed: Path, tmp_path: Path
) -> None:
    with Browser(tmp_path) as page:
        page.open(assessed / "assessment.html")
        assert page.errors == [] and page.unnamed() == []
        assert page.text(".verdict").startswith("0.071 to 0.964 of 1 points; ")
        digests = page.run("[...document.querySelectorAll('code')].map(code => code.textContent)")
        assert (
            hashlib.sha256((assessed.parent / "straight.xodr").read_bytes()).hexdigest() in digests
        )
        page.run(
            "(s => { s.value = 'not met'; s.dispatchEvent(new Event('change')); "
            "})(document.querySelectorAll('select')[1])"
        )
        assert page.run("document.querySelectorAll('.runs tbody tr').length") == 2


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--assess", "euro-ncap-2032", "--out", "out"], "did you mean 'euro-ncap-202"),
        (["--assess", "r157"], "it needs --out DIR"),
        (["--assess", "r157", "--out", "out", "--dry-run"], "no --dry-run"),
    ],
)
def test_an_assessment_that_cannot_be_made_is_refused_before_anything_runs(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    scenario(tmp_path)
    answer = command("xosc-run", "scenario.xosc", *more)
    assert (answer.code, answer.out) == (2, "") and told in answer.err
    assert not (tmp_path / "out").exists()


def test_an_unknown_protocol_names_all() -> None:
    with pytest.raises(UsageError, match="protocols: euro-ncap-2023, euro-ncap-2026, r157"):
        profile("iihs")
