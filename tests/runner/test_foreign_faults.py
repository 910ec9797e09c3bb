"""Faults of foreign inputs that were seen: each is told in one line, and none passes unsaid."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from runner.batch.journal import finished
from schemas.common.storage import Records
from tests.commands import Command
from tests.runner.files import scenario

HOW = ("--world", "kinematic", "--sut", "none", "--quiet")


def edited(folder: Path, old: str, new: str) -> Path:
    path = scenario(folder)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize("size", ["0", "1e-300"])
def test_boxes_without_extent_are_no_internal_error(
    size: str, tmp_path: Path, command: Command
) -> None:
    box = f'<Dimensions width="{size}" length="{size}" height="{size}"/>'
    path = edited(tmp_path, '<Dimensions width="2" length="5" height="1.5"/>', box)
    assert "internal error" not in "".join(map(str, command("xosc-run", path, *HOW)))


@pytest.mark.parametrize(("old", "new"), [('"3"', '"9"'), ('revMajor="1"', 'revMajor="2"')])
def test_a_later_version_is_inconclusive_and_refused_by_strict(
    old: str, new: str, tmp_path: Path, command: Command
) -> None:
    path = edited(tmp_path, old, new)
    answer = command("xosc-run", path, *HOW)
    assert answer.code == 6
    assert "the header has the revision" in answer.out
    assert command("xosc-run", path, *HOW, "--strict").code == 3


def test_an_action_that_no_version_has_is_invalid_and_suggests_one(
    tmp_path: Path, command: Command
) -> None:
    path = edited(tmp_path, "TeleportAction>", "TeleportActon>")
    answer = command("xosc-run", path, *HOW)
    assert answer.code == 3
    assert "did you mean TeleportAction?" in answer.err


def test_an_unknown_type_of_a_schema_is_a_finding(tmp_path: Path, command: Command) -> None:
    xsi = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:type="absent"'
    answer = command("xosc-check", edited(tmp_path, "<Entities>", f"<Entities {xsi}>"))
    assert answer.code == 1
    assert "'absent' of the xsi:type attribute does not resolve" in answer.out
    assert "internal error" not in answer.out + answer.err


def test_many_unknown_attributes_take_a_time_that_grows_with_their_number(
    tmp_path: Path, command: Command
) -> None:
    many = " ".join(f'a{number}="1"' for number in range(10_000))
    path = edited(tmp_path, "<Storyboard>", f"<Storyboard {many}>")
    begun = time.process_time()
    answer = command("xosc-run", path, *HOW)
    assert time.process_time() - begun < 4.0
    assert answer.code == 6
    assert "10000 attributes are in no version of the standard, as 'a0', 'a1', 'a2'" in answer.out


@pytest.mark.parametrize("given", ["sensor_range=-1", "brake=0", "brake=-3"])
def test_parameters_of_cas_out_of_range_are_wrong_usage(
    given: str, tmp_path: Path, command: Command
) -> None:
    how = ("--world", "kinematic", "--sut", f"cas:{given}")
    answer = command("xosc-run", scenario(tmp_path), *how)
    assert answer.code == 2
    assert given.partition("=")[0] in answer.err


def test_reports_make_their_folder(tmp_path: Path, command: Command) -> None:
    report = tmp_path / "reports" / "x.sarif"
    how = ("--format", "sarif", "--output", report)
    assert command("xosc-check", scenario(tmp_path), *how).code == 0
    assert report.is_file()


@pytest.mark.parametrize("name", ["another", "../outside", "/outside", "..", "a/b", "a\\b"])
def test_a_forged_name_in_a_journal_names_no_folder(
    name: str, tmp_path: Path, command: Command
) -> None:
    out = tmp_path / "out"
    assert command("xosc-run", scenario(tmp_path), *HOW, "--out", out).code in (0, 1, 6)
    journal = Records(out / "runs.jsonl")
    (record,) = journal.read().records
    journal.path.unlink()
    journal.add([record | {"job": record["job"] | {"name": name}}])  # its digest is right
    assert list(finished(out).outcomes) == ([name] if name == "another" else [])
