"""Questions to the index of a catalogue: conditions, order, near-duplicates,
similar scenarios, copies.
"""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from schemas.common.errors import InvalidFile, UsageError
from tests.commands import Command
from tests.xosc.conftest import Writer
from xosc.exports.draft import Folder
from xosc.listing import questions, tables
from xosc.listing.tables import copy_rows

ROWS = [
    {
        "file": "a/1.xosc",
        "class": "cut in",
        "site": "US-101",
        "ego_speed": 25.0,
        "gap": 20.0,
        "min_ttc": 1.5,
        "partial": False,
    },
    {
        "file": "a/2.xosc",
        "class": "cut in",
        "site": "US-101",
        "ego_speed": 25.2,
        "gap": 20.5,
        "min_ttc": 1.9,
        "partial": False,
    },
    {
        "file": "b/3.xosc",
        "class": "cut out",
        "site": "it's",
        "ego_speed": 25.0,
        "gap": 20.0,
        "min_ttc": None,
        "partial": True,
    },
    {
        "file": "a/4.xosc",
        "class": "cut in",
        "site": "US-101",
        "ego_speed": 40.0,
        "gap": None,
        "min_ttc": 0.5,
        "partial": None,
    },
]
TABLE = pa.Table.from_pylist([{**row, "road": "roads/straight.xodr"} for row in ROWS])


def chosen(text: str) -> list[str]:
    found = TABLE.filter(questions.condition(text, TABLE.schema).expression)
    return [name.removesuffix(".xosc")[2:] for name in found["file"].to_pylist()]


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("class = 'cut in' and min_ttc < 2 and ego_speed between 22 and 33", "12"),
        ("min_ttc < 1 or min_ttc > 1.6", "24"),
        ("NOT partial AND (gap >= 20.5 OR ego_speed == 25)", "12"),
        ("partial", "3"),
        ("gap is null or site = 'it''s'", "34"),
        ("min_ttc is not null and class in ('cut out', \"cut in\")", "124"),
        ("not gap < 20.2", "2"),  # an absent value is neither below nor above
        ("site not like 'US%'", "3"),
        ("ego_speed > gap and ego_speed <> 25.2", "13"),
        ("ego_speed not between -1e1 and 30", "4"),
        ("ego_speed between 25.1 and 50", "24"),
        ("ego_speed > 90.36 km/h", "24"),
        ("ego_speed between 1mph and 25.1 m/s", "13"),
    ],
)
def test_conditions_choose_rows(text: str, rows: str) -> None:
    assert "".join(chosen(text)) == rows


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("clas = 'x'", r"position 1 \(clas\): there is no such column; did you mean 'class'\?"),
        ("gap < 3 and class = 3", r"position 21 \(3\): class is a text, this is a number"),
        ("gap < 3 gap", r"position 9 \(gap\): 'and', 'or' or the end is expected"),
        ("gap <", r"position 6 \(the end\): a column, a number or a text in quotes is expected"),
        ("gap", r"position 4 \(the end\): a comparison is expected: =, "),
        ("(gap < 3", r"position 9 \(the end\): '\)' is expected"),
        ("partial < true", r"position 9 \(<\): partial is true or false and has no order"),
        ("class = 'cut", "position 9 .*no closing quote"),
        ("gap < 3; drop", "position 8 .*no part of a condition"),
        ("__import__('os') = 1", "position 1 .*no such column"),
        ("(" * 50 + "partial" + ")" * 50, "more than 40 brackets"),
        ("partial or " * 400 + "partial", "at most 4000 characters"),
    ],
)
def test_bad_conditions_are_refused_with_the_position(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        chosen(text)


def test_rows_are_ordered_with_absent_values_last() -> None:
    order = questions.ordered(TABLE, ["-gap", "min_ttc"])["file"].to_pylist()
    assert order == ["a/2.xosc", "a/1.xosc", "b/3.xosc", "a/4.xosc"]
    with pytest.raises(
        UsageError, match="--sort: there is no column 'speed'; did you mean 'ego_speed'"
    ):
        questions.ordered(TABLE, ["speed"])


def test_near_duplicates_are_named_beside_the_row_that_stands_for_them() -> None:
    found = questions.distinct(TABLE)
    assert dict(zip(found["file"].to_pylist(), found["duplicates"].to_pylist(), strict=True)) == {
        "a/1.xosc": "a/2.xosc", "b/3.xosc": "", "a/4.xosc": "",
    }  # fmt: skip


def test_distances_are_in_units_of_the_scales() -> None:
    found = questions.distance(TABLE, ROWS[0])
    assert found[0] == 0.0
    assert found[1] == pytest.approx(
        ((0.2 / 2.0) ** 2 + (0.5 / 5.0) ** 2) ** 0.5 / 3**0.5
    )  # speed, gap, class
    assert found[2] > 1.0 and found[3] > 1.0


@pytest.fixture
def catalogue(scenario: Writer, catalog: Writer, tmp_path: Path) -> Path:
    """A catalogue of four scenarios that use one vehicle catalogue and one road."""
    locations = '<VehicleCatalog><Directory path="catalogs/vehicles"/></VehicleCatalog>'
    for row in ROWS:
        (tmp_path / "made" / str(row["file"])).parent.mkdir(parents=True, exist_ok=True)
        scenario(
            f"made/{row['file']}",
            locations=locations,
            road='<LogicFile filepath="../roads/straight.xodr"/>',
        )
    for folder in "ab":
        catalog(
            f"made/{folder}/catalogs/vehicles/VehicleCatalog.xosc",
            '<Vehicle name="car"/>',
            name="VehicleCatalog",
        )
    made = tmp_path / "made"
    (made / "roads").mkdir()
    (made / "roads" / "straight.xodr").write_text("<OpenDRIVE/>")
    pq.write_table(TABLE, made / "index.parquet")
    (made / "index.json").write_text(json.dumps({"sorted_by": "rules", "scenarios": ROWS}))
    return made


def test_copies_hold_all_that_the_scenarios_need_and_can_be_asked_again(
    command: Command, catalogue: Path, tmp_path: Path
) -> None:
    out = tmp_path / "copy"
    done = command(
        "xosc-list", catalogue, "--where", "gap < 20.2", "--sort", "-class", "--copy-to", out
    )
    assert (done.code, done.err) == (0, f"8 files copied to {out}\n")
    assert [line.split()[0] for line in done.out.splitlines()] == [
        "file",
        "b/3.xosc",
        "a/1.xosc",
        "2",
    ]
    assert sorted(path.relative_to(out).as_posix() for path in out.rglob("*.*")) == [
        "a/1.xosc", "a/catalogs/vehicles/VehicleCatalog.xosc", "b/3.xosc",
        "b/catalogs/vehicles/VehicleCatalog.xosc", "index.csv", "index.json", "index.parquet",
        "roads/straight.xodr",
    ]  # fmt: skip
    again = command("xosc-list", out, "--where", "class = 'cut in'", "--format", "json")
    assert [row["file"] for row in json.loads(again.out)] == ["a/1.xosc"]
    refused = command("xosc-list", catalogue, "--where", "partial", "--copy-to", out)
    assert (
        refused.code == 2
        and "index.parquet: another file is in the way; --overwrite replaces it" in refused.err
    )
    assert (
        command("xosc-list", catalogue, "--where", "partial", "--copy-to", out, "--overwrite").code
        == 0
    )
    again = command("xosc-list", out, "--format", "json", "--sort", "file")
    assert [row["file"] for row in json.loads(again.out)] == ["b/3.xosc"]
    assert command("xosc-list", catalogue, "--overwrite").code == 2


def test_similar_scenarios_come_first(command: Command, catalogue: Path) -> None:
    done = command(
        "xosc-list", catalogue, "--like", catalogue / "a" / "1.xosc", "--where", "distance < 1.5"
    )
    assert [line.split()[0] for line in done.out.splitlines()] == ["file", "a/2.xosc", "1"]
    untagged = command("xosc-list", catalogue, "--like", catalogue / "catalog.xosc")
    assert untagged.code == 3 and "no such file" in untagged.err


@pytest.mark.parametrize(("name", "content"), [("index.parquet", b"PAR1"), ("index.parquet", b"")])
def test_unreadable_indexes_are_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidFile, match="not readable as Parquet"):
        tables.read_index(tmp_path)


def test_files_outside_of_the_catalogue_are_not_copied(catalogue: Path, tmp_path: Path) -> None:
    index = tables.Index(catalogue, pa.Table.from_pylist([{**ROWS[0], "road": "../secret.txt"}]))
    (tmp_path / "secret.txt").write_text("secret")
    with pytest.raises(InvalidFile, match="outside of the catalogue"):
        copy_rows(index, index.table, Folder(tmp_path / "out"))
    assert not (tmp_path / "out" / "secret.txt").exists()


def test_questions_need_an_index_and_one_catalogue(command: Command, tmp_path: Path) -> None:
    lacking = command("xosc-list", tmp_path, "--distinct")
    assert lacking.code == 2 and "index.parquet" in lacking.err
    assert command("xosc-list", "--where", "gap < 3").code == 2


def test_an_index_without_classes_answers_too(command: Command, tmp_path: Path) -> None:
    pq.write_table(pa.table({"file": ["a.xosc"]}), tmp_path / "index.parquet")
    assert command("xosc-list", tmp_path, "--where", "file = 'a.xosc'") == (
        0,
        "file\na.xosc\n1 scenario\n",
        "",
    )
