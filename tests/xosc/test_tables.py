"""Batches, runs, searches and any table are asked like catalogues, several of one kind together."""

from __future__ import annotations

import json
from datetime import datetime
from decimal import Decimal
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from schemas.common.errors import InvalidFile, UsageError
from tests.commands import Command
from xosc.listing.tables import read_all, read_index

TEXTS = pa.map_(pa.string(), pa.string())


def batch(folder: Path, *runs: tuple[str, str, float | None, dict[str, str]]) -> Path:
    """A folder with the table of a batch; of each run name, state, least TTC (s) and parameters."""
    folder.mkdir()
    rows = [
        {
            "name": name,
            "file": "a.xosc",
            "state": state,
            "end_time": 9.0,
            "min_ttc": ttc,
            "remarks": ["one", "two"],
            "parameters": list(parameters.items()),
        }
        for name, state, ttc, parameters in runs
    ]
    types = {"parameters": TEXTS, "min_ttc": pa.float64(), "remarks": pa.list_(pa.string())}
    schema = pa.schema(
        [
            (name, types.get(name, pa.float64() if name == "end_time" else pa.string()))
            for name in rows[0]
        ]
    )
    pq.write_table(pa.Table.from_pylist(rows, schema), folder / "runs.parquet")
    for name, *_ in runs:
        (folder / name).mkdir()
        (folder / name / "result.json").write_text("{}")
    return folder


@pytest.fixture
def batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two batches, `a` and `b`, in the working folder."""
    monkeypatch.chdir(tmp_path)
    batch(tmp_path / "a", ("x", "failed", 0.5, {"Gap": "8"}), ("y", "passed", 2.0, {"Gap": "12"}))
    batch(
        tmp_path / "b",
        ("x", "failed", 0.1, {"Gap": "5", "Kind": "van"}),
        ("z", "error", None, {"Gap": "9"}),
    )
    return tmp_path


def test_runs_are_chosen_ordered_and_joined(batches: Path, command: Command) -> None:
    answer = command(
        "xosc-list", "a", "b", "--where", "min_ttc < 1 and state = 'failed'", "--sort", "min_ttc"
    )
    assert answer == (
        0,
        "batch  name  state   end_time  min_ttc\n"
        "b      x     failed  9         0.1\n"
        "a      x     failed  9         0.5\n"
        "2 runs\n",
        "",
    )


def test_a_batch_without_a_question_is_listed(batches: Path, command: Command) -> None:
    assert command("xosc-list", "a").out.splitlines()[-1] == "2 runs"


def test_parameters_are_columns_of_numbers(batches: Path, command: Command) -> None:
    found = command(
        "xosc-list",
        "a",
        "b",
        "--where",
        "Gap > 8.5",
        "--columns",
        "name, Gap,Kind",
        "--format",
        "csv",
    )
    assert found.out == "name,Gap,Kind\ny,12.0,\nz,9.0,\n"
    assert (
        command("xosc-list", "b", "--where", "Kind is null", "--columns", "name").out
        == "name\nz\n1 run\n"
    )


def test_a_parameter_called_as_a_column_has_one_of_its_own(
    tmp_path: Path, command: Command
) -> None:
    batch(tmp_path / "c", ("x", "failed", 0.5, {"state": "3", "Gap": "8"}))
    (row,) = json.loads(command("xosc-list", tmp_path / "c", "--format", "json").out)
    assert (row["state"], row["parameters_state"], row["Gap"]) == ("failed", 3.0, 8.0)


def test_a_run_is_a_row_of_its_batch(batches: Path, command: Command) -> None:
    rows = json.loads(command("xosc-list", "a/y", "--format", "json").out)
    assert [(row["name"], row["Gap"], row["remarks"]) for row in rows] == [("y", 12.0, "one; two")]


def test_answers_are_tables_again(batches: Path, command: Command) -> None:
    written = command("xosc-list", "a", "b", "--format", "parquet", "--output", "both.parquet")
    assert written == (0, "", "")
    asked = command(
        "xosc-list", "both.parquet", "--where", "batch = 'b'", "--columns", "batch,name"
    )
    assert asked.out == "batch  name\nb      x\nb      z\n2 rows\n"


def test_parameters_of_two_kinds_are_texts(tmp_path: Path) -> None:
    one = batch(tmp_path / "one", ("x", "passed", 1.0, {"Gap": "8"}))
    other = batch(tmp_path / "other", ("x", "passed", 1.0, {"Gap": "wide"}))
    assert read_all([str(one), str(other)]).table["Gap"].to_pylist() == ["8", "wide"]


def test_a_search_is_asked_too(tmp_path: Path, command: Command) -> None:
    rows = {
        "part": ["sought", "drawn"],
        "Gap": [1.0, 2.0],
        "status": ["completed"] * 2,
        "collision": [True, False],
    }
    pq.write_table(pa.table(rows), tmp_path / "episodes.parquet")
    assert command("xosc-list", tmp_path, "--where", "collision").out.splitlines()[1:] == [
        "sought  completed  True",
        "1 episode",
    ]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("a", "--where", "min_tcc < 1"), ("position 1 (min_tcc): there is no such column; "
                                          "did you mean 'min_ttc'?")),
        (("a", "--where", "state = 'x'; drop table runs"), ("position 12 (; drop table): this is "
                                                           "no part of a condition")),
        (("a", "--where", "name in (select name from runs)"), ("position 10 (select): "
                                                              "there is no such column")),
        (("a", "--where", "read_text('/etc/passwd') = 'x'"), ("position 1 (read_text): "
                                                             "there is no such column")),
        (("a", "--where", "state"), "a comparison is expected"),
        (("a", "--sort", "ttc"), "--sort: there is no column 'ttc'; did you mean 'min_ttc'?"),
        (("a", "--columns", "nme"), "--columns: there is no column 'nme'; did you mean 'name'?"),
        (("a", "--distinct"), "--distinct is for catalogues, these are runs"),
        (("a", "--copy-to", "copy"), "--copy-to is for catalogues, these are runs"),
        (("a", "--format", "parquet"), "is written to a file: --output FILE"),
        (("--format", "parquet"), "is for rows of catalogues, batches and searches"),
        (("a", "."), "there is none"),
        (("--where", "a = 1"), "name their folders"),
    ],
)  # fmt: skip
def test_wrong_questions(
    arguments: tuple[str, ...], complaint: str, batches: Path, command: Command
) -> None:
    answer = command("xosc-list", *arguments, *(["--sort", "name"] if "." in arguments else []))
    assert (answer.code, answer.out) == (2, "")
    assert complaint in answer.err


def test_other_kinds_and_damaged_tables_are_refused(batches: Path, tmp_path: Path) -> None:
    pq.write_table(pa.table({"file": ["a.xosc"]}), tmp_path / "index.parquet")
    with pytest.raises(UsageError, match="these are scenarios, and those of a are runs"):
        read_all(["a", str(tmp_path)])
    (batches / "a" / "runs.parquet").write_bytes(b"PAR1")
    with pytest.raises(InvalidFile, match="not readable as Parquet"):
        read_index("a")


def test_json_has_null_where_a_number_is_not_finite(tmp_path: Path, command: Command) -> None:
    table = pa.table({"name": ["a"], "state": ["passed"], "ttc": [float("inf")], "x": [1.5]})
    pq.write_table(table, tmp_path / "other.parquet")
    answer = command("xosc-list", tmp_path / "other.parquet", "--format", "json")
    assert "Infinity" not in answer.out
    assert json.loads(answer.out) == [{"name": "a", "state": "passed", "ttc": None, "x": 1.5}]


def test_columns_of_other_programs_are_asked_as_texts_and_numbers(
    tmp_path: Path, command: Command
) -> None:
    table = pa.table(
        {
            "name": pa.array(["a", "b"], pa.large_string()),
            "kind": pa.array(["car", "van"]).dictionary_encode(),
            "tags": pa.array([["one", "two"], []], pa.large_list(pa.string())),
            "price": pa.array([Decimal("1.5"), Decimal("2.5")]),
            "made": pa.array([datetime(2020, 1, 2), datetime(2021, 1, 2)]),
            "seal": pa.array([b"\xff", b"b"]),
            "place": pa.array([{"x": 1}, {"x": 2}]),
        }
    )
    pq.write_table(table, tmp_path / "other.parquet")
    for where in (
        "name = 'a'", "kind in ('car')", "tags = 'one; two'", "price < 2", "made like '2020-01-02%'",
        "place like '%1%'", "seal like '%xff%'",
    ):  # fmt: skip
        answer = command(
            "xosc-list", tmp_path / "other.parquet", "--where", where, "--format", "json"
        )
        assert [row["name"] for row in json.loads(answer.out)] == ["a"], where
    answer = command("xosc-list", tmp_path / "other.parquet", "--where", "made > 5")
    assert (answer.code, "made is a text, this is a number" in answer.err) == (2, True)
