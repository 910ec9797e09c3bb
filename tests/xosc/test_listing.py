"""The listing of scenarios, and the command `xosc-list`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile, UsageError
from schemas.common.terminal.files import LIBRARY
from tests.commands import Command
from tests.xosc.conftest import Writer
from xosc.listing import ListedParameter, listing, to_csv, to_json, xosc_list
from xosc.writing.tags import Tag, properties

PARAMETERS = """
<ParameterDeclaration name="Ego_Speed_mps" parameterType="double" value="20">
  <ConstraintGroup>
    <ValueConstraint rule="greaterOrEqual" value="5"/><ValueConstraint rule="lessOrEqual" value="40"/>
  </ConstraintGroup>
</ParameterDeclaration>
<ParameterDeclaration name="Model" parameterType="string" value="car">
  <ConstraintGroup><ValueConstraint rule="equalTo" value="car"/></ConstraintGroup>
  <ConstraintGroup><ValueConstraint rule="equalTo" value="van"/></ConstraintGroup>
</ParameterDeclaration>
<ParameterDeclaration name="Gap_m" parameterType="double" value="${$Ego_Speed_mps / 2}"/>
"""
VARIATION = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-05-31T12:00:00" description="two" author="test"/>
  <ParameterValueDistribution>
    <ScenarioFile filepath="../scenario.xosc"/>
    <Deterministic><DeterministicSingleParameterDistribution parameterName="Ego_Speed_mps">
      <DistributionSet><Element value="10"/><Element value="12"/></DistributionSet>
    </DeterministicSingleParameterDistribution></Deterministic>
  </ParameterValueDistribution>
</OpenSCENARIO>
"""


def tagged(path: Path, *tags: Tag) -> Path:
    held = "".join(
        f'<Property name="{name}" value="{value}"/>' for name, value in properties(tags).items()
    )
    text = path.read_text().replace(
        'author="test"/>', f'author="test"><Properties>{held}</Properties></FileHeader>', 1
    )
    path.write_text(text)
    return path


@pytest.fixture
def folder(scenario: Writer, catalog: Writer, tmp_path: Path) -> Path:
    """A tagged scenario with variations in a folder of their own, one without
    anything, and a catalogue.
    """
    road = '<LogicFile filepath="../roads/straight.xodr"/>'
    tagged(
        scenario(parameters=PARAMETERS, road=road), Tag("Class", "cut in"), Tag("HumanPedestrian")
    )
    tagged(scenario("other.xosc"), Tag("Class", "cut out"))
    catalog("catalogs/cars.xosc", '<Vehicle name="car"/><Vehicle name="van"/>', name="cars")
    (tmp_path / "variations").mkdir()
    (tmp_path / "variations" / "two.xosc").write_text(VARIATION)
    return tmp_path


def test_a_scenario_is_listed_with_all_that_files_say_about_it(folder: Path) -> None:
    other, found = listing([str(folder)]).scenarios
    assert (found.name, found.label, found.description, found.road) == (
        "scenario",
        "cut in",
        "test",
        "straight",
    )
    assert [(each.name, each.value, each.allowed) for each in found.parameters] == [
        ("Ego_Speed_mps", "20", "[5, 40]"),
        ("Model", "car", "car | van"),
        ("Gap_m", "${$Ego_Speed_mps / 2}", ""),
    ]
    assert [(each.path.name, each.size) for each in found.variations] == [("two.xosc", 2)]
    assert (other.name, other.road, other.parameters, other.variations) == ("other", "", (), [])


def test_a_road_that_a_parameter_names_is_told_by_its_default(scenario: Writer) -> None:
    declared = (
        '<ParameterDeclaration name="Road" parameterType="string" value="./roads/curve.xodr"/>'
    )
    (found,) = listing(
        [str(scenario(parameters=declared, road='<LogicFile filepath="$Road"/>'))]
    ).scenarios
    assert found.road == "curve"
    path = scenario("unknown.xosc", road='<LogicFile filepath="$Nothing"/>')
    with pytest.raises(InvalidFile, match=r"unknown\.xosc:\d+: LogicFile: filepath: .*Nothing"):
        listing([str(path)])


def test_the_scenario_of_variations_is_listed_wherever_it_is(folder: Path) -> None:
    (found,) = listing([str(folder / "variations")]).scenarios
    assert found.name == "scenario"


def test_catalogues_are_listed_with_their_entries(folder: Path) -> None:
    (found,) = listing([str(folder)]).catalogues
    assert (found.name, found.kind, found.entries) == ("cars", "Vehicle", ("car", "van"))


def test_scenarios_are_chosen_by_class_and_tags(folder: Path) -> None:
    found = listing([str(folder)])
    assert [each.name for each in found.chosen("cut in", [])] == ["scenario"]
    assert [each.name for each in found.chosen(None, [Tag("HumanPedestrian")])] == ["scenario"]
    assert found.chosen("cut out", [Tag("HumanPedestrian")]) == []
    with pytest.raises(UsageError, match="no scenario has Class 'cut'; did you mean 'cut in'"):
        found.chosen("cut", [])
    with pytest.raises(
        UsageError, match="no scenario has a tag 'Human'; there are: Class, HumanPedestrian"
    ):
        found.chosen(None, [Tag("Human")])


@pytest.mark.parametrize(
    ("limits", "allowed"),
    [
        ([("greaterThan", "0")], "> 0"),
        ([("greaterOrEqual", "0"), ("lessThan", "5"), ("notEqualTo", "3")], "≥ 0 and < 5 and ≠ 3"),
        ([("equalTo", "car")], "car"),
        ([("equalTo", "car"), ("equalTo", "van")], "= car and = van"),
    ],
)
def test_limits_are_told_in_short(limits: list[tuple[str, str]], allowed: str) -> None:
    assert ListedParameter("name", "double", "1", (tuple(limits),)).allowed == allowed


def test_json_and_csv_hold_the_same(folder: Path) -> None:
    found = listing([str(folder)])
    told = json.loads(to_json(found))
    rows = list(csv.DictReader(to_csv(found).splitlines()))
    assert (
        [each["name"] for each in told["scenarios"]]
        == [row["name"] for row in rows]
        == ["other", "scenario"]
    )
    second = told["scenarios"][1]
    assert second["tags"] == {"Class": "cut in", "HumanPedestrian": True}
    assert second["parameters"][0]["limits"] == [
        [{"rule": "greaterOrEqual", "value": "5"}, {"rule": "lessOrEqual", "value": "40"}]
    ]
    assert second["variations"][0]["parameter_sets"] == 2
    assert (
        rows[1]["parameters"]
        == "Ego_Speed_mps = 20 in [5, 40]; Model = car in car | van; Gap_m = ${$Ego_Speed_mps / 2}"
    )
    assert told["catalogues"][0]["entries"] == ["car", "van"]


def test_the_command_lists_the_shipped_library_by_default(command: Command, tmp_path: Path) -> None:
    done = command("xosc-list", "--class", "roundabout entering", "--verbose")
    assert (done.code, done.err) == (0, "")
    head, first, *details = done.out.splitlines()
    assert head.split()[:4] == ["NAME", "CLASS", "ROAD", "PARAMETERS"]
    assert first.startswith("roundabout_entering  roundabout entering  roundabout ")
    assert any("Circulating_Speed_mps = 7.0 in [4.0, 10.0]" in line for line in details)
    assert command("xosc-list", "--format", "json", "--output", tmp_path / "list.json").out == ""
    everything = json.loads((tmp_path / "list.json").read_text())
    assert len(everything["scenarios"]) == len(listing([str(LIBRARY)]).scenarios)
    assert {each["kind"] for each in everything["catalogues"]} == {
        "Controller", "Environment", "Maneuver", "Pedestrian", "Route", "Vehicle",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["missing.xosc"], 3, "xosc-list: missing.xosc: no such file\n"),
        (["--tag", "Ego=Bob"], 2, "xosc-list: no scenario has Ego 'Bob'; there are: Ego\n"),
        (
            ["--output", "/dev/null/list"],
            2,
            "xosc-list: /dev/null/list: the list can't be written: Not a directory\n",
        ),
    ],
)
def test_errors_are_one_line(
    command: Command, arguments: list[str], code: int, message: str
) -> None:
    done = command("xosc-list", *arguments)
    assert (done.code, done.out, done.err) == (code, "", message)


def test_a_bad_file_is_named_and_the_others_are_listed(command: Command, folder: Path) -> None:
    (folder / "bad.xosc").write_text("<other/>")
    lost = folder / "lost.xosc"
    lost.write_text(VARIATION.replace("../scenario.xosc", "nowhere.xosc"))
    named = [f"xosc-list: {folder}/bad.xosc:1: ", f"xosc-list: {lost}:4: "]
    for arguments in ([], ["--format", "json"], ["--format", "csv"]):
        answer = command("xosc-list", folder, *arguments)
        assert answer.code == 3 and "scenario" in answer.out
        assert [
            any(line.startswith(name) for line in answer.err.splitlines()) for name in named
        ] == [True, True]
        assert len(answer.err.splitlines()) == 2


def test_what_is_no_openscenario_is_refused(tmp_path: Path) -> None:
    (tmp_path / "note.xosc").write_text("<note/>")
    with pytest.raises(InvalidFile, match=r"note\.xosc"):
        listing([str(tmp_path)])


def test_a_terminal_shows_the_beginning_of_a_long_list_and_how_to_narrow_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    content = "".join(f"{number}\n" for number in range(1000))
    assert xosc_list._cut(content, None) == content  # as the tests' output is no terminal
    monkeypatch.setattr(xosc_list.sys.stdout, "isatty", lambda: True, raising=False)
    shown = xosc_list._cut(content, None).splitlines()
    assert shown[:200] == content.splitlines()[:200]
    assert shown[200:] == [
        "... 800 of 1,000 lines are left out: --where or --class narrows them, --output FILE or a "
        "pipe has all"
    ]
    assert xosc_list._cut(content, tmp_path / "list.txt") == content
