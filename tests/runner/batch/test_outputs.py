"""Result files: Parquet, CSV as esmini writes it, event log, JSON, JUnit."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from lxml import etree

import runner
from runner.batch.jobs import Job, Outcome
from runner.batch.outputs import report, tables
from runner.engine.participants.declaration import BoundingBox
from runner.judging.result import RunResult, Verdict
from runner.recording import COLUMNS, LogEntry, Recording, Track
from tests.runner.files import car, place, scenario, speed_action, story

ODD = 'Tom, "Dick" & <Harry>'
ESCAPED = "Tom, &quot;Dick&quot; &amp; &lt;Harry&gt;"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> runner.RunResult:
    """Ego in a curve of constant curvature, and an oddly named car that drives against the
    reference line and brakes.
    """
    brake = speed_action(0, 'dynamicsShape="linear" dynamicsDimension="rate" value="5"')
    path = scenario(
        tmp_path_factory.mktemp("outputs"),
        road="curve",
        entities=[car("Ego"), car(ESCAPED)],
        init=place("Ego", 20, 10) + place(ESCAPED, 150, 10, lane=1),
        stories=story(ESCAPED, [(0.5, brake)]),
        stop=1.0,
    )
    return runner.run(path, world="kinematic", timestep=0.1, sut="none")


# Parquet ------------------------------------------------------------------------------------


def test_parquet_has_every_participant_at_every_step(
    result: runner.RunResult, tmp_path: Path
) -> None:
    tables.write_parquet(result, tmp_path / "t.parquet")
    table = pq.read_table(tmp_path / "t.parquet")
    assert table.column_names == ["time", "entity", *COLUMNS[1:]]
    kinds = {"entity": pa.string(), "road_id": pa.string(), "lane_id": pa.int64()}
    assert all(field.type == kinds.get(field.name, pa.float64()) for field in table.schema)
    assert table["entity"].to_pylist() == ["Ego", ODD] * 11
    assert np.allclose(table["time"].to_numpy(), np.repeat(np.arange(11) * 0.1, 2))
    assert set(table["road_id"].to_pylist()) == {"1"}
    ego = table.filter(pa.compute.equal(table["entity"], "Ego")).to_pydict()
    assert ego["s"][-1] - ego["s"][0] == pytest.approx(10.0, abs=0.5)
    assert ego["lane_id"] == [-1] * 11
    assert ego["lane_offset"] == pytest.approx([0.0] * 11)


def test_road_coordinates_are_looked_up_where_the_run_did_not_need_them(
    result: runner.RunResult,
) -> None:
    known = result.recording.tracks["Ego"]
    first = {name: values[:1].tolist()[0] for name, values in known.columns.items()}
    free = track(
        "Ego", first | {"road_id": None, "lane_id": 0, "s": 0.0, "t": 0.0, "lane_offset": 0.0}
    )
    (located,) = Recording([free], 0.1, result.recording.network).table().to_pylist()
    assert (located["road_id"], located["lane_id"]) == ("1", -1)
    assert located["s"] == pytest.approx(20.0, abs=1e-6)
    (nowhere,) = Recording([track("Ego", {"road_id": None})], 0.1, None).table().to_pylist()
    assert nowhere["road_id"] is None


def track(name: str, *rows: dict[str, object]) -> Track:
    """A track of rows in which everything is 0 that is not given."""
    kinds = {"road_id": "object", "lane_id": "int64"}
    columns = {
        key: np.array([row.get(key, 0) for row in rows], kinds.get(key, "float64"))
        for key in COLUMNS
    }
    return Track(name, "vehicle", "car", BoundingBox(0, 0, 0, 4, 2, 1), lambda: columns)


def test_a_recording_without_anybody_is_an_empty_table() -> None:
    table = Recording([], 0.1, None).table()
    assert table.num_rows == 0
    assert table.column_names == ["time", "entity", *COLUMNS[1:]]


# CSV ----------------------------------------------------------------------------------------


def read_csv(path: Path) -> list[dict[str, str]]:
    lines = path.read_text(encoding="utf-8").splitlines()[6:]
    return list(csv.DictReader(lines, skipinitialspace=True))


def test_csv_reads_as_esmini_writes_it(result: runner.RunResult, tmp_path: Path) -> None:
    tables.write_csv(result, tmp_path / "t.csv")
    preamble = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()[:6]
    assert preamble[4:] == ["Scenario File Name: scenario.xosc", "Number of Vehicles: 2"]
    rows = read_csv(tmp_path / "t.csv")
    assert [row["Index [-]"] for row in rows] == [str(n) for n in range(11)]
    assert [row["TimeStamp [s]"] for row in rows] == [f"{n / 10:.6f}" for n in range(11)]
    assert {row["#1 Entity_Name [-]"] for row in rows} == {"Ego"}
    assert {row["#2 Entity_Name [-]"] for row in rows} == {ODD}
    middle, table = rows[5], result.trajectories.to_pylist()
    ego, other = table[10], table[11]
    for number, state in ((1, ego), (2, other)):
        for column, name in (
            ("World_Position_X [m]", "x"),
            ("World_Position_Y [m]", "y"),
            ("Current_Speed [m/s]", "speed"),
            ("Distance_Travelled_Along_Road_Segment [m]", "s"),
            ("Lateral_Distance_Lanem [m]", "t"),
            ("lane_offset[m]", "lane_offset"),
        ):
            assert float(middle[f"#{number} {column}"]) == pytest.approx(state[name], abs=1e-6)
    assert [
        middle[f"#1 bb_{name} [m]"] for name in ("x", "y", "z", "length", "width", "height")
    ] == [
        "1.500",
        "0.000",
        "0.750",
        "5.000",
        "2.000",
        "1.500",
    ]


def test_csv_has_motion_by_differences_and_angles_to_road_and_driving_direction(
    result: runner.RunResult, tmp_path: Path
) -> None:
    tables.write_csv(result, tmp_path / "t.csv")
    row = read_csv(tmp_path / "t.csv")[5]
    speed = math.hypot(float(row["#1 Vel_X [m/s]"]), float(row["#1 Vel_Y [m/s]"]))
    assert speed == pytest.approx(10.0, abs=0.01)
    assert float(row["#1 Road_Curvature [1/m]"]) == pytest.approx(0.01)
    radius = 100.0 + 1.75  # right of a curve to the left
    assert float(row["#1 Heading_Angle_Rate [rad/s]"]) == pytest.approx(10.0 / radius, rel=1e-3)
    assert math.hypot(
        float(row["#1 Acc_X [m/s2]"]), float(row["#1 Acc_Y [m/s2]"])
    ) == pytest.approx(100.0 / radius, rel=1e-2)
    assert float(row["#1 Relative_Heading_Angle [rad]"]) == pytest.approx(0.0, abs=1e-6)
    assert float(row["#2 Relative_Heading_Angle [rad]"]) == pytest.approx(math.pi, abs=1e-6)
    for number in (1, 2):
        assert float(
            row[f"#{number} Relative_Heading_Angle_Drive_Direction [rad]"]
        ) == pytest.approx(0.0, abs=1e-6)


def test_csv_lines_follow_who_is_there(tmp_path: Path) -> None:
    a = track("a", *({"time": time, "road_id": None} for time in (0.0, 1.0, 2.0)))
    recording = Recording([a, track("b", {"time": 1.0, "road_id": None})], 1.0, None)
    settings = {"timestep": 1.0}
    result = RunResult(
        Path("x.xosc"), {}, "completed", 2.0, Verdict(), (), None, "none", settings, [], recording
    )
    tables.write_csv(result, tmp_path / "t.csv")
    rows = read_csv(tmp_path / "t.csv")
    assert [row["#2 Entity_Name [-]"] for row in rows] == ["", "b", ""]


# event log ----------------------------------------------------------------------------------


def test_events_say_why(result: runner.RunResult, tmp_path: Path) -> None:
    report.write_events(result.events, tmp_path / "e.jsonl")
    events = [json.loads(line) for line in (tmp_path / "e.jsonl").read_text().splitlines()]
    assert all(set(event) == {"time", "kind", "subject", "text"} for event in events)
    times = [event["time"] for event in events]
    assert times == sorted(times)
    (start,) = [
        e
        for e in events
        if e["kind"] == "startTransition" and e["subject"].endswith("maneuver::event0")
    ]
    assert start["subject"] == "story::act::group::maneuver::event0"
    assert start["time"] == pytest.approx(0.5)
    assert "time" in start["text"]
    assert "0.5" in start["text"]


# JSON ---------------------------------------------------------------------------------------


def test_result_json_has_verdict_settings_and_criticality(
    result: runner.RunResult, tmp_path: Path
) -> None:
    report.write_json(report.summary(result), tmp_path / "r.json")
    values = json.loads((tmp_path / "r.json").read_text())
    assert (values["scenario"], values["status"], values["verdict"], values["reasons"]) == (
        "scenario.xosc",
        "completed",
        "passed",
        [],
    )
    assert Path(values["files"]["scenario"]).is_file()
    assert Path(values["files"]["road"]).samefile(result.recording.network.path)  # type: ignore[union-attr]
    assert values["settings"] == {
        "timestep": 0.1,
        "seed": 0,
        "world": "kinematic",
        "max_time": 300.0,
    }
    assert list(values["entities"]) == ["Ego", ODD]
    assert values["criticality"]["min_distance"]["other"] == ODD
    assert 0.0 <= values["criticality"]["rss_risk_ad_rss"] <= 1.0


@pytest.mark.parametrize(
    ("entities", "init", "ego", "expected"),
    [
        ([car("Ego")], place("Ego", 10, 10), None, None),
        ([car("A"), car("B")], place("A", 10, 10) + place("B", 50, 10), None, "no ego"),
        ([car("Ego"), car("B")], place("B", 50, 10), None, "no ego"),
        ([car("A"), car("B")], place("A", 10, 10) + place("B", 50, 10), "B", "A"),
    ],
)
def test_every_run_has_its_criticality(
    tmp_path: Path, entities: list[str], init: str, ego: str | None, expected: str | None
) -> None:
    path = scenario(tmp_path, entities=entities, init=init, stories=" ", stop=0.3)
    result = runner.run(path, world="kinematic", ego=ego)
    values = report.summary(result)["criticality"]
    if expected == "no ego":
        assert values is None
    elif expected is None:
        assert values["min_distance"] is None
    else:
        assert values["min_distance"]["other"] == expected


def test_json_has_no_numbers_that_json_does_not_know(tmp_path: Path) -> None:
    values = {
        "a": math.inf,
        "b": [math.nan, {"c": -math.inf}],
        "d": 1.5,
        "e": "NaN",
        "f": (1, math.nan),
    }
    report.write_json(values, tmp_path / "v.json")
    report.write_events([LogEntry(math.nan, "k", "s", "t")], tmp_path / "e.jsonl")
    for name in ("v.json", "e.jsonl"):
        json.loads((tmp_path / name).read_text(), parse_constant=lambda text: pytest.fail(text))
    assert json.loads((tmp_path / "v.json").read_text()) == {
        "a": None,
        "b": [None, {"c": None}],
        "d": 1.5,
        "e": "NaN",
        "f": [1, None],
    }


# JUnit --------------------------------------------------------------------------------------


def outcome(
    name: str, state: str, source: str = "a.xosc", message: str = "", end: float | None = 1.25
) -> Outcome:
    code = {"passed": 0, "failed": 1, "error": 3}[state]
    return Outcome(Job(name, Path(source), Path(source)), state, code, message, "completed", end)


def test_junit_tells_failures_from_errors(tmp_path: Path) -> None:
    outcomes = [
        outcome("a~000000", "passed"),
        outcome("a~000001", "failed", message="collision with <B> & \x00 co"),
        outcome("b", "error", "folder/b.xosc", "b.xosc:3: broken", None),
    ]
    report.write_junit(outcomes, tmp_path / "j.xml")
    root = etree.parse(tmp_path / "j.xml").getroot()
    assert (root.tag, root.get("name")) == ("testsuites", "xosc-run")
    suites = [dict(suite.attrib) for suite in root]
    assert suites == [
        {"name": "a.xosc", "tests": "2", "failures": "1", "errors": "0", "skipped": "0"},
        {"name": "folder/b.xosc", "tests": "1", "failures": "0", "errors": "1", "skipped": "0"},
    ]
    cases = [dict(case.attrib) for case in root.iter("testcase")]
    assert cases[0] == {"classname": "a", "name": "a~000000", "time": "1.250"}
    assert root.xpath("//failure/@message") == ["collision with <B> & \ufffd co"]
    assert root.xpath("//error/@message") == ["b.xosc:3: broken"]
    states = root.xpath("//testcase/properties/property[@name='state']/@value")
    assert states == ["passed", "failed", "error"]
