"""Road networks that are broken are never green, with or without an XSD of their
version at hand.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from schemas import check
from schemas.checks import road_elements
from schemas.common.errors import InvalidFile
from schemas.common.xml import parse
from schemas.versions.registry import OPENDRIVE, schema_for
from tests.runner.files import ROADS
from xodr import load

STRAIGHT = (ROADS / "straight.xodr").read_text()
LANE = re.search(r'<lane id="-1".*?</lane>', STRAIGHT, re.DOTALL)
assert LANE is not None


def write(folder: Path, minor: int, old: str, new: str) -> Path:
    """The straight road in another version, with a change of what a pattern matches first."""
    text = re.sub(r'revMinor="\d"', f'revMinor="{minor}"', STRAIGHT)
    assert re.search(old, text, re.DOTALL)
    path = folder / "road.xodr"
    path.write_text(re.sub(old, lambda _: new, text, count=1, flags=re.DOTALL))
    return path


FAULTS = {
    "heading": (r'hdg="[^"]*"', 'hdg="abc"', "hdg='abc': a number is expected"),
    "infinite length": (r'length="[^"]*"', 'length="INF"', "length='INF': a number is expected"),
    "lane that is none": (r'<lane id="-1"', '<lane id="one"', "id='one': an integer is expected"),
    "lane type": (r'type="driving"', 'type="flying"', "type='flying': one of none, driving"),
    "no plan view": (r"<planView>.*?</planView>", "", "the element planView is missing"),
    "unknown element": (
        r"<planView>",
        "<evil/><planView>",
        "the element evil is not expected here",
    ),
    "misplaced element": (
        r"<planView>",
        '<laneSection s="0"/><planView>',
        "the element laneSection is not expected here",
    ),
    "no start": (r'<geometry s="[^"]*"', "<geometry", "the attribute 's' is missing"),
}


@pytest.mark.parametrize("minor", [4, 5, 6])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_an_error_without_an_xsd(fault: str, minor: int, tmp_path: Path) -> None:
    old, new, message = FAULTS[fault]
    problems = check(write(tmp_path, minor, old, new))
    assert any(message in problem.message for problem in problems if problem.level == "error")


@pytest.mark.parametrize("minor", [7, 8, 9])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_an_error_by_the_xsd(fault: str, minor: int, tmp_path: Path) -> None:
    old, new, _ = FAULTS[fault]
    before = {
        problem.message
        for problem in check(write(tmp_path, minor, "<planView>", "<planView>"))
        if problem.level == "error"
    }
    problems = check(write(tmp_path, minor, old, new))
    assert {problem.message for problem in problems if problem.level == "error"} - before


@pytest.mark.parametrize("content", ["<evil/>", '<header revMajor="1" revMinor="4"/><evil/>'])
def test_a_file_of_other_elements_is_no_road_network(content: str, tmp_path: Path) -> None:
    path = tmp_path / "evil.xodr"
    path.write_text(f"<OpenDRIVE>{content}</OpenDRIVE>")
    assert any(problem.level == "error" for problem in check(path))


@pytest.mark.parametrize("minor", [4, 5, 6, 8])
def test_sound_roads_of_all_versions_are_accepted(minor: int, tmp_path: Path) -> None:
    assert not any(
        problem.level == "error"
        for problem in check(write(tmp_path, minor, "<planView>", "<planView>"))
    )


@pytest.mark.parametrize("minor", [4, 7])
def test_lanes_of_one_id_are_an_error_in_checks_and_runs(minor: int, tmp_path: Path) -> None:
    assert LANE is not None
    path = write(tmp_path, minor, re.escape(LANE[0]), LANE[0] * 3)
    assert any(
        "lane ids on the side right are -1, -1, -1" in each.message
        for each in check(path)
        if each.level == "error"
    )
    with pytest.raises(InvalidFile, match="the lane id -1 is there twice in one lane section"):
        load(path)


def test_what_the_xsd_rejects_of_these_faults_the_table_rejects_too(tmp_path: Path) -> None:
    schema = schema_for(OPENDRIVE, (1, 7))
    assert schema is not None
    for old, new, message in FAULTS.values():
        path = write(tmp_path, 7, old, new)
        assert any(problem.level == "error" for problem in check(path)), message
        assert any(message in found for _, found in road_elements.violations(parse(path).getroot()))


UNKNOWN = {
    "a misspelt lane": (
        r'<lane id="-1"(.*?)</lane>',
        '<lanne id="-1"></lanne>',
        "'lanne'",
        "did you mean 'lane'?",
        "ignored",
    ),
    "many": (
        r"<planView>",
        "<evil/>" * 5000 + "<planView>",
        "'evil'",
        "(and 4999 more)",
        "ignored",
    ),
    "beside signals": (
        r"<planView>",
        "<signals><singal/></signals><planView>",
        "'singal'",
        "did you mean 'signal'?",
        "",
    ),
}


@pytest.mark.parametrize("fault", UNKNOWN)
def test_unknown_elements_are_one_remark_of_a_run(fault: str, tmp_path: Path) -> None:
    old, new, name, told, cause = UNKNOWN[fault]
    path = write(tmp_path, 6, old, new)
    (remark,) = [
        each for each in load(path).remarks if "in no version of the standard" in each.message
    ]
    assert name in remark.message and told in remark.message and remark.cause == cause
    with pytest.raises(InvalidFile, match="in no version of the standard"):
        load(path, strict=True)


def test_signals_of_one_id_are_a_remark_and_the_first_is_meant(tmp_path: Path) -> None:
    signals = "".join(f'<signal id="1" s="{s}" t="-4" name="{s}"/>' for s in (5, 6, 7))
    network = load(write(tmp_path, 6, r"<planView>", f"<signals>{signals}</signals><planView>"))
    (remark,) = network.remarks
    assert (
        "the id '1' is that of another signal, too (and 1 more" in remark.message
        and network.signals["1"].name == "5"
    )
