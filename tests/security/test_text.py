"""Names of files and in files are text to what shows them: no terminal, CI
service, spreadsheet or viewer obeys them.
"""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from pathlib import Path

import pytest
from lxml import etree

from schemas.common.terminal.text import cell, csv_text, markdown, of_service, one_line, sarif_text
from tests.commands import Command
from tests.recognition.recordings.test_corruption import EXAMPLES
from tests.runner.files import scenario
from xosc.listing import LIBRARY

NASTY = "::error file=x::forged\x1b[2J\n::set-output name=a::b\n##[error]c ##vso[task.complete]"
"""What a file is called, and entities in it"""
FORMULA = "=HYPERLINK(1)"
_OBEYED = re.compile(r"^\s*::|##\w*\[|[^\n -~–…✓\u00a0-\u00ff\ufffd]", re.MULTILINE)
_ATTRIBUTE = NASTY.replace("\n", "&#10;").replace("\x1b", "\u202e")


def nasty_scenario(folder: Path) -> Path:
    """A scenario that can be run, whose name, entities, parameters and description are nasty."""
    path = scenario(folder, "plain", stop=0.2)
    text = (
        path.read_text(encoding="utf-8")
        .replace('"Lead"', f'"{_ATTRIBUTE}"')
        .replace('"Ego"', f'"{FORMULA}"')
    )
    path.unlink()
    nasty = folder / f"{NASTY}.xosc"
    nasty.write_text(
        re.sub(r'description="[^"]*"', f'description="{_ATTRIBUTE}"', text), encoding="utf-8"
    )
    return nasty


def broken_scenario(folder: Path) -> Path:
    """One that every command refuses, with a message about nasty names."""
    path = nasty_scenario(folder)
    path.write_text(
        path.read_text(encoding="utf-8").replace(' s="', f' s="{_ATTRIBUTE}" was="'),
        encoding="utf-8",
    )
    return path


def assert_obeyed_by_nobody(answer: tuple[int, str, str]) -> None:
    for text in answer[1:]:
        found = _OBEYED.search(text)
        assert found is None, text[max(0, found.start() - 80) : found.end() + 20]


CALLS: dict[str, tuple[str, ...]] = {
    "run": ("xosc-run", "--world", "kinematic", "--ego", FORMULA, "--verbose"),
    "dry run": ("xosc-run", "--dry-run"),
    **{
        f"check {each}": ("xosc-check", "--format", each, "--verbose")
        for each in ("text", "json", "junit", "xqar", "sarif")
    },
    **{
        f"list {each}": ("xosc-list", "--format", each, "--verbose")
        for each in ("text", "json", "csv")
    },
    **{
        f"export {each}": ("xosc-export", "--to", each, "--out", "{out}")
        for each in ("1.1", "carla", "openlabel", "parquet")
    },
    "generate": ("xosc-generate", "--out", "{out}", "--budget", "2"),
    "label": ("xosc-recognize", "label"),
    "recognise": ("xosc-recognize", "--labels", "rules", "--out", "{out}"),
    "train": ("xosc-recognize", "train", "--out", "{out}"),
    "replay": ("xosc-replay",),
    "loop": ("xosc-loop", "--labels", "rules", "--out", "{out}"),
}


@pytest.mark.parametrize("write", [nasty_scenario, broken_scenario])
@pytest.mark.parametrize("call", CALLS)
def test_no_command_prints_what_is_obeyed(
    call: str, write: object, command: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    path = write(folder)  # type: ignore[operator]
    name, *options = CALLS[call]
    given = folder if call in ("recognise", "train", "label", "loop") else path
    arguments = [each.replace("{out}", str(tmp_path / "out")) for each in options]
    first, rest = (arguments[:1], arguments[1:]) if call in ("label", "train") else ([], arguments)
    assert_obeyed_by_nobody(command(name, *first, given, *rest))


def test_an_option_that_a_file_is_called_like_is_no_command(command: Command) -> None:
    answer = command("xosc-check", "--x\n::error::forged")
    assert answer.code == 2
    assert_obeyed_by_nobody(answer)


def test_results_of_runs_are_obeyed_by_nobody(command: Command, tmp_path: Path) -> None:
    path = nasty_scenario(tmp_path)
    options = (
        "--world",
        "kinematic",
        "--ego",
        FORMULA,
        "--junit",
        tmp_path / "runs.xml",
        "--out",
        tmp_path / "out",
        "--replay",
    )
    answer = command("xosc-run", path, *options)
    assert answer.code in (0, 1, 6), answer.err
    assert etree.parse(tmp_path / "runs.xml").find(".//testcase") is not None
    table = next((tmp_path / "out").glob("*/trajectories.csv")).read_text(encoding="utf-8")
    assert f"'{FORMULA}" in table and f", {FORMULA}" not in table
    assert not any(line.lstrip().startswith("::") for line in table.splitlines())
    assert_obeyed_by_nobody(
        command("xosc-replay", next((tmp_path / "out").glob("*/result.json")).parent)
    )
    label = command("xosc-recognize", "label", tmp_path / "out", "--labels", "rules")
    assert_obeyed_by_nobody(label)


def test_names_inside_recordings_are_obeyed_by_nobody(command: Command, tmp_path: Path) -> None:
    for name, example in EXAMPLES.items():
        folder = tmp_path / "recordings" / name
        folder.mkdir(parents=True)
        example.write(folder)
        for file in [each for each in folder.rglob("*") if each.suffix in (".csv", ".xml")]:
            file.write_bytes(file.read_bytes().replace(b"1", b"##[error]", 3))
            shutil.copy(file, folder / f"{NASTY}{file.suffix}")
    answer = command(
        "xosc-recognize", tmp_path / "recordings", "--labels", "rules", "--out", tmp_path / "out"
    )
    assert answer.code in (3, 4)
    assert_obeyed_by_nobody(answer)


def test_cells_are_no_formulas_and_numbers_stay_numbers(command: Command, tmp_path: Path) -> None:
    assert [cell(each) for each in ("=1", "+a", "-a", "@a", "\ta", "\ra", " =1", "＝1")] == [
        *("'=1", "'+a", "'-a", "'@a", "' a", "' a", "' =1", "'＝1")
    ]
    assert [cell(each) for each in ("-1", "+1.5e3", "-inf", "a-b", "", 5, -1.5, None)] == [
        *("-1", "+1.5e3", "-inf", "a-b", "", 5, -1.5, None)
    ]
    assert csv_text([["a", None, -1.0], ['"', "x,y", "z\nw"]]) == 'a,,-1.0\n"""","x,y",z w\n'
    (tmp_path / f"{FORMULA}.xosc").write_bytes((LIBRARY / "simple_cut_in.xosc").read_bytes())
    answer = command("xosc-list", tmp_path, "--format", "csv")
    assert next(csv.DictReader(io.StringIO(answer.out)))["name"] == f"'{FORMULA}"


def test_one_line_is_idempotent_and_keeps_what_is_harmless() -> None:
    assert one_line("a: b::c #1 ##x [y] é 中") == "a: b::c #1 ##x [y] é 中"
    assert one_line("  ::error::x\n##[a]") == "  \\::error::x #\\#[a]"
    assert one_line(one_line(NASTY)) == one_line(NASTY)


def test_reports_say_the_same_where_their_hashes_are_references() -> None:
    text = json.dumps({"a": NASTY})
    assert json.loads(of_service(text)) == {"a": NASTY}
    assert "##[" not in of_service(text) and "##vso[" not in of_service(text)
    assert etree.fromstring(of_service("<a>##[x]</a>")).text == "##[x]"


def test_links_and_markup() -> None:
    assert sarif_text("a[1] b") == "a[1] b"
    assert sarif_text("[click](http://x)") == r"\[click\](http://x)"
    assert markdown("a|b [x](y) <b>\n#") == r"a\|b \[x\](y) \<b\> #"
