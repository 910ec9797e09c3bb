"""What loading adds to documents where something is missing, and how it tells
what is no repair's.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas import check
from schemas.common.errors import InvalidFile
from xosc.document import load, to_bytes

HEADER = (
    '<FileHeader revMajor="1" revMinor="{minor}" date="2026-01-01T00:00:00" '
    'description="" author=""/>'
)
STORYBOARD = (
    "<Storyboard>{init}{story}<StopTrigger/></Storyboard>",
    '<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1"><Actors '
    'selectTriggeringEntities="false"/>'
    '<Maneuver name="m"><Event name="e" priority="parallel"><Action '
    'name="x"><GlobalAction><ParameterAction parameterRef="p">'
    "<SetAction "
    'value="1"/></ParameterAction></GlobalAction></Action><StartTrigger/></Event></Maneuver></ManeuverGroup>'
    "<StartTrigger/></Act></Story>",
)


@pytest.fixture
def write(tmp_path: Path):
    def written(*elements: str, minor: int = 3) -> Path:
        path = tmp_path / "scenario.xosc"
        lines = ["<OpenSCENARIO>", HEADER.format(minor=minor), *elements, "</OpenSCENARIO>"]
        path.write_text("\n".join(lines), encoding="utf-8")
        return path

    return written


def storyboard(init: str = "<Init><Actions/></Init>", story: str = STORYBOARD[1]) -> str:
    return STORYBOARD[0].format(init=init, story=story)


WHOLE = ("<CatalogLocations/>", "<RoadNetwork/>", "<Entities/>", storyboard())


def said(path: Path) -> list[str]:
    return [f"{remark.line}: {remark.message}" for remark in load(path).remarks]


def test_a_whole_document_has_no_remark(write) -> None:
    assert said(write(*WHOLE)) == []


def test_an_object_without_mass_and_category_has_some_that_change_nothing(write) -> None:
    box = (
        '<BoundingBox><Center x="0" y="0" z="0"/><Dimensions width="1" length="1" '
        'height="1"/></BoundingBox>'
    )
    thing = (
        '<Entities><ScenarioObject name="o"><MiscObject '
        f'name="m">{box}<Properties/></MiscObject></ScenarioObject></Entities>'
    )
    path = write(*WHOLE[:2], thing, WHOLE[3])
    assert said(path) == [
        "5: the attribute 'mass' is missing; '0' is assumed",
        "5: the attribute 'miscObjectCategory' is missing; 'none' is assumed",
    ]
    path.write_bytes(to_bytes(load(path)))
    assert [problem for problem in check(path) if "valid_schema" in problem.rule] == []


@pytest.mark.parametrize(
    ("elements", "remark"),
    [
        (
            WHOLE[1:],
            "1: OpenSCENARIO: the element CatalogLocations is missing; there are no catalogues",
        ),
        (
            (WHOLE[0], *WHOLE[2:]),
            "1: OpenSCENARIO: the element RoadNetwork is missing; there are no roads",
        ),
        (
            (*WHOLE[:3], storyboard("")),
            "6: Storyboard: the element Init is missing; nothing is done at the beginning",
        ),
        (
            (*WHOLE[:3], storyboard("<Init/>")),
            "6: Init: the element Actions is missing; nothing is done at the beginning",
        ),
    ],
)
def test_what_is_missing_is_added_so_that_the_document_is_valid(
    write, elements: tuple[str, ...], remark: str
) -> None:
    path = write(*elements)
    assert said(path) == [remark]
    path.write_bytes(to_bytes(load(path)))
    assert [problem for problem in check(path) if "valid_schema" in problem.rule] == []
    assert load(path, strict=True).remarks == ()


@pytest.mark.parametrize(
    ("story", "missing"),
    [
        (
            STORYBOARD[1].replace("<StartTrigger/></Act>", "</Act>"),
            "Act 'a': the element StartTrigger is missing",
        ),
        (
            STORYBOARD[1].replace("<StartTrigger/></Event>", "</Event>"),
            "Event 'e': the element StartTrigger is missing",
        ),
    ],
)
def test_triggers_may_be_missing_since_later_versions_only(write, story: str, missing: str) -> None:
    elements = (*WHOLE[:3], storyboard("<Init/>", story))
    assert any(missing in each for each in said(write(*elements, minor=0)))
    assert not any(missing in each for each in said(write(*elements, minor=3)))


def test_faults_of_one_kind_are_one_remark_on_the_first_of_them(write) -> None:
    story = STORYBOARD[1].replace('name="s"', 'name="s" x="1"')
    init = '<Init><Actions/></Init>\n<Story name="t" x="1">'
    path = write(*WHOLE[:3], storyboard(init + story.partition(">")[2], story))
    assert said(path) == [
        (
            "7: the attribute 'x' is in no version of the standard; it is left out, NOT executed "
            "(and 1 more)"
        )
    ]


def test_what_is_no_repairs_is_told_and_stays(write) -> None:
    path = write('<CatalogLocations><Catalogue path="."/></CatalogLocations>', *WHOLE[1:])
    (remark,) = said(path)
    unknown = (
        "3: the element Catalogue is in no version of the standard here; it is NOT "
        "executed; did you mean "
    )
    assert remark.startswith(unknown)
    assert load(path).node.find("CatalogLocations", "Catalogue") is not None
    with pytest.raises(InvalidFile, match="valid_schema"):
        load(path, strict=True)


def test_the_values_of_other_versions_are_told_and_stay(write) -> None:
    story = STORYBOARD[1].replace('priority="parallel"', 'priority="override"')
    path = write(*WHOLE[:3], storyboard("<Init/>", story), minor=0)
    _, remark = said(path)
    assert "'override' is not a valid value" in remark and load(path).version == (1, 0)
    event = next(load(path).node.iter("Event"))
    assert event.get("priority") == "override"


@pytest.mark.parametrize("minor", [0, 1, 2])
def test_a_missing_child_says_nothing_of_the_version(write, minor: int) -> None:
    """Without a StopTrigger, which later versions do not need, a file was read as one of those."""
    whole = storyboard().replace("<StopTrigger/>", "")
    assert load(write(*WHOLE[:3], whole, minor=minor)).version == (1, minor)


def test_an_element_that_the_declared_version_lacks_speaks_for_the_nearest_that_has_it(
    write,
) -> None:
    path = write("<ParameterDeclarations/><VariableDeclarations/>", *WHOLE, minor=0)
    assert load(path).version == (1, 2)
    assert said(path)[0].startswith(
        "2: the header has the revision 1.0, the content is that of version 1.2: 1.0 has no V"
    )


def test_other_evidence_holds_whatever_else_is_missing(write) -> None:
    whole = storyboard("<Init/>").replace("<StopTrigger/>", "")
    path = write("<ParameterDeclarations/><VariableDeclarations/>", *WHOLE[:3], whole, minor=0)
    assert load(path).version == (1, 2)
