"""The command `xosc-export`: options, what it prints, exit codes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import runner
import runner.exchange.exports
from runner.exchange.exports import TARGETS, find_targets
from runner.exchange.exports.exporting import Exported, export_runs
from runner.judging.settings import RunSettings
from schemas.common import packages
from schemas.common.terminal.files import LIBRARY
from tests.commands import Command
from tests.runner.files import HEADER, distribution, place, scenario, speed_action, story
from xosc.exports import standard
from xosc.exports.draft import Folder

BRAKES = story("Lead", [(0.2, speed_action(5))])

PLAIN = """
TARGETS = {"plain": "end time and verdict as text"}

def export(result, name, folder):
    folder.write(f"{name}.txt", f"{result.end_time:.2f} s, passed: {result.verdict.passed}\\n".encode())
    return []
"""
"""A target of runs, as a file of its own"""

CONTROLLER = (
    "<AssignControllerAction><Controller "
    'name="own"><Properties/></Controller></AssignControllerAction>'
)


@pytest.fixture
def xosc_export(command: Command) -> Command:
    """The command."""
    return partial(command, "xosc-export")


def test_errors_that_stay_in_the_exported_files_are_told(
    xosc_export: Command, tmp_path: Path
) -> None:
    source = scenario(tmp_path / "in", "a", stories=BRAKES)
    text = source.read_text()
    condition = (
        '<Condition name="criteria" delay="0" conditionEdge="rising"><ByValueCondition>'
        '<ParameterCondition parameterRef="" value="1" rule="lessThan"/>'
        "</ByValueCondition></Condition>"
    )
    at = text.rindex("</ConditionGroup>")
    source.write_text(text[:at] + condition * 2 + text[at:])
    answer = xosc_export(source, "--to", "1.2", "--out", tmp_path / "out")
    assert answer.code == 0
    (told,) = [line for line in answer.out.splitlines() if "errors stay" in line]
    assert told.startswith("  a.xosc: 3 errors stay, as xosc-check says: ")
    assert "parameterRef: there is no parameter ''" in told and told.count("parameterRef") == 1


def test_catalogues_named_and_taken_along_are_the_same_file(
    xosc_export: Command, tmp_path: Path
) -> None:
    for target in ("esmini", "1.2"):
        names = [LIBRARY / "catalogs" / "vehicles", LIBRARY / "simple_cut_in.xosc"]
        answer = xosc_export(*names, "--to", target, "--out", tmp_path / target)
        assert answer.code == 0, answer.err


def test_a_folder_is_exported_file_by_file(xosc_export: Command, tmp_path: Path) -> None:
    for name in ("a", "b"):
        scenario(tmp_path / "in", name, stories=BRAKES)
    answer = xosc_export(tmp_path / "in", "--to", "1.1", "--out", tmp_path / "out")
    assert answer.code == 0
    assert answer.out.splitlines() == [
        *(f"{tmp_path}/in/{name}.xosc: exported" for name in "ab"),
        "2 exported, 0 not",
        f"files: {tmp_path}/out",
    ]
    assert sorted(path.name for path in (tmp_path / "out").rglob("*.*")) == [
        "a.xosc",
        "b.xosc",
        "straight.xodr",
    ]


def test_4_something_cannot_be_said_and_the_others_are_exported(
    xosc_export: Command, tmp_path: Path
) -> None:
    random = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
    scenario(tmp_path / "in", "newer", stories=story("Ego", [(0.5, random)]))
    scenario(tmp_path / "in", "sound", stories=BRAKES)
    answer = xosc_export(tmp_path / "in", "--to", "1.0", "--out", tmp_path / "out", "--quiet")
    assert (answer.code, answer.out) == (4, "")
    assert f"{tmp_path}/in/newer.xosc:" in answer.err and "RandomRouteAction" in answer.err
    assert sorted(path.name for path in (tmp_path / "out").glob("*")) == ["roads", "sound.xosc"]


def test_a_file_that_breaks_its_standard_is_told_of_under_quiet_too(
    xosc_export: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    for target in ("1.1", "parquet"):
        assert xosc_export(path, "--to", target, "--out", tmp_path / f"sound {target}", "-q") == (
            0,
            "",
            "",
        )
    path.write_text(path.read_text().replace('conditionEdge="none"', ""))
    for target, named in (("1.1", path), ("parquet", path.stem)):
        answer = xosc_export(path, "--to", target, "--out", tmp_path / f"broken {target}", "-q")
        assert (answer.code, answer.out, answer.err.count("\n")) == (0, "", 1)
        assert answer.err.startswith(
            f"xosc-export: {named}: exported; read though it breaks its standard: {path}:"
        ), answer.err
        assert "the attribute 'conditionEdge' is missing" in answer.err


def test_3_a_file_is_broken_and_named_once_with_the_line(
    xosc_export: Command, tmp_path: Path
) -> None:
    (tmp_path / "broken.xosc").write_text("<OpenSCENARIO>")
    answer = xosc_export(tmp_path / "broken.xosc", "--to", "1.0", "--out", tmp_path / "out")
    assert answer.code == 3
    assert (
        answer.err.startswith(f"xosc-export: not exported: {tmp_path}/broken.xosc:1: ")
        and answer.err.count("broken.xosc") == 1
    )


def test_3_a_run_is_named_beside_the_broken_file(xosc_export: Command, tmp_path: Path) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    path.with_name("straight.xodr").write_text("<OpenDRIVE>")
    answer = xosc_export(path, "--to", "parquet", "--out", tmp_path / "out")
    assert answer.code == 3
    assert (
        answer.err.startswith(f"xosc-export: not exported: {path.stem}: ")
        and "straight.xodr:1: " in answer.err
    )


@pytest.mark.parametrize(
    ("target", "options"),
    [("nothing", []), ("1.0", ["--param", "a=1"]), ("osi", ["--timestep", "9"])],
)
def test_2_the_call_is_wrong(
    target: str, options: list[str], xosc_export: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=BRAKES)
    answer = xosc_export(path, "--to", target, "--out", tmp_path / "out", *options)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.startswith("xosc-export: ") and not (tmp_path / "out").exists()


@pytest.mark.parametrize("target", ["1.1", "carla", "esmini"])
def test_roads_are_found_as_in_runs(
    target: str, xosc_export: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scenario(tmp_path / "in", stories=BRAKES)
    maps = tmp_path / "maps"
    maps.mkdir()
    (path.parent / "straight.xodr").rename(maps / "straight.xodr")
    answer = xosc_export(path, "--to", target, "--out", tmp_path / "none")
    if target == "1.1":  # a version of the standard decides nothing by the road
        assert (answer.code, "it is named as before" in answer.out) == (0, True)
    else:
        assert (answer.code, "--road-path" in answer.err) == (3, True)
    assert (
        xosc_export(
            path, "--to", target, "--out", tmp_path / "named", "--road-path", maps, "--strict"
        ).code
        == 0
    )
    monkeypatch.setenv("XOSC_ROAD_PATH", str(maps))
    assert xosc_export(path, "--to", target, "--out", tmp_path / "set").code == 0
    for out in ("named", "set"):
        assert (tmp_path / out / "roads" / "straight.xodr").read_bytes() == (
            maps / "straight.xodr"
        ).read_bytes()


def test_roads_are_made_as_in_runs(xosc_export: Command, tmp_path: Path) -> None:
    path = scenario(tmp_path / "in", stories=BRAKES)
    (path.parent / "straight.xodr").unlink()
    answer = xosc_export(path, "--to", "esmini", "--out", tmp_path / "out", "--road", "auto")
    assert answer.code == 0 and "straight ones are assumed" in answer.out
    made, options = RunSettings(world="kinematic", sut="none", max_time=2.0), {"timestep": 0.1}
    expected = (
        runner.run(path, replace(made, road="auto"), **options).recording.tracks["Lead"].columns
    )
    got = runner.run(tmp_path / "out" / path.name, made, **options).recording.tracks["Lead"].columns
    assert all((expected[name] == got[name]).all() for name in ("x", "y", "h", "speed"))
    strict = xosc_export(
        path, "--to", "esmini", "--out", tmp_path / "strict", "--road", "auto", "--strict"
    )
    assert (strict.code, "straight ones are assumed" in strict.err) == (3, True)


def test_repairs_are_told_and_strict_exports_refuse_them(
    xosc_export: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path / "in", stories=BRAKES)
    path.write_bytes(
        b"\xef\xbb\xbf" + b"<!DOCTYPE OpenSCENARIO>\n" + path.read_bytes().partition(b"?>\n")[2]
    )
    answer = xosc_export(path, "--to", "1.1", "--out", tmp_path / "out")
    assert answer.code == 0 and "DOCTYPE" in answer.out
    assert xosc_export(path, "--to", "1.1", "--out", tmp_path / "strict", "--strict").code == 3


def test_catalogues_alone_cannot_be_run(xosc_export: Command, tmp_path: Path) -> None:
    (tmp_path / "cars.xosc").write_text(
        f'<OpenSCENARIO>{HEADER}<Catalog name="cars"/></OpenSCENARIO>'
    )
    answer = xosc_export(tmp_path / "cars.xosc", "--to", "sumo", "--out", tmp_path / "out")
    assert answer.code == 3 and answer.err.startswith(
        f"xosc-export: {tmp_path}/cars.xosc: this is a catalog, nothing in it can be run"
    )


def test_an_internal_error_names_its_file_and_the_others_are_exported(
    xosc_export: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in "ab":
        scenario(tmp_path / "in", name, stories=BRAKES)
    sound = standard.export

    def export(source: Path, *arguments: object) -> object:
        return 1 / 0 if source.stem == "a" else sound(source, *arguments)

    monkeypatch.setattr(standard, "export", export)
    answer = xosc_export(tmp_path / "in", "--to", "1.1", "--out", tmp_path / "out")
    assert answer.code == 5 and f"{tmp_path}/in/b.xosc: exported" in answer.out
    assert (
        f"not exported: {tmp_path}/in/a.xosc: internal error: ZeroDivisionError" in answer.err
        and "Traceback" in answer.err
    )


def test_an_actor_that_does_not_exist_is_named_with_its_line(
    xosc_export: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, stories=BRAKES.replace('entityRef="Lead"', 'entityRef="Laed"'))
    answer = xosc_export(path, "--to", "carla", "--out", tmp_path / "out")
    line = path.read_text().split("Laed")[0].count("\n") + 1
    assert answer.code == 3 and not (tmp_path / "out").exists()
    assert (
        f"{path}:{line}: EntityRef: there is no entity 'Laed'; did you mean 'Lead'?" in answer.err
    )


@pytest.mark.parametrize("other", ['<ActivateControllerAction longitudinal="true"/>', CONTROLLER])
def test_of_two_controller_actions_in_one_only_those_of_autopilots_are_left_out(
    other: str, xosc_export: Command, tmp_path: Path
) -> None:
    both = f'<ControllerAction><ActivateControllerAction lateral="true"/>{other}</ControllerAction>'
    path = scenario(
        tmp_path, stories=story("Lead", [(0.2, f"<PrivateAction>{both}</PrivateAction>")])
    )
    answer = xosc_export(path, "--to", "carla", "--out", tmp_path / "out")
    assert answer.code == (0 if other != CONTROLLER else 4), answer.err
    assert "Traceback" not in answer.err and ("'module'" in answer.err) == (other == CONTROLLER)


def test_runs_are_exported_for_every_set_of_parameters(
    xosc_export: Command, tmp_path: Path
) -> None:
    scenario(
        tmp_path,
        init=place("Ego", 100, 5) + place("Lead", "${100 + $Gap}", 5),
        stories=BRAKES,
        stop=0.5,
    )
    sets = distribution(tmp_path, "sets", {"Gap": (20.0, 40.0, 10.0)})
    options = [
        "--world",
        "kinematic",
        "--sut",
        "none",
        "--timestep",
        "0.1",
        "--param",
        "Ego_Speed=6",
    ]
    answer = xosc_export(sets, "--to", "parquet", "--out", tmp_path / "out", *options)
    assert answer.out.splitlines() == [
        *(f"sets~00000{number}: exported" for number in range(3)),
        "3 exported, 0 not",
        f"files: {tmp_path}/out",
    ]
    assert len(list((tmp_path / "out").glob("sets~*.criticality.parquet"))) == 3


@pytest.mark.parametrize("target", ["1.0", "1.2", "carla", "esmini", "openlabel"])
def test_parameter_sets_are_chosen_as_in_runs(
    target: str, xosc_export: Command, command: Command, tmp_path: Path
) -> None:
    scenario(
        tmp_path,
        init=place("Ego", 100, 5) + place("Lead", "${100 + $Gap}", 5),
        stories=BRAKES,
        stop=0.3,
    )
    huge = distribution(tmp_path, "huge", {"Gap": (20.0, 120.0, 0.0001)})
    options = ["--world", "kinematic", "--sut", "none", "--timestep", "0.1"]
    for number, choice in enumerate([("--sample", "3", "--seed", "2"), ("--only", "4,8-9")]):
        out = tmp_path / f"out{number}"
        assert xosc_export(huge, "--to", target, "--out", out, *options, *choice).code == 0
        run = command("xosc-run", huge, *options, *choice)
        names = {line.split()[1] for line in run.out.splitlines() if line.startswith("PASSED")}
        assert len(names) == 3
        assert {path.name.partition(".")[0] for path in out.glob("huge~*")} == names
    assert (
        xosc_export(
            huge, "--to", target, "--out", tmp_path / "no", "--sample", "3", "--only", "1"
        ).code
        == 2
    )


def test_4_more_files_than_are_written_name_the_options_that_choose(
    xosc_export: Command, tmp_path: Path
) -> None:
    scenario(
        tmp_path, init=place("Ego", 100, 5) + place("Lead", "${100 + $Gap}", 5), stories=BRAKES
    )
    many = distribution(tmp_path, "many", {"Gap": (20.0, 40.0, 0.01)})
    answer = xosc_export(many, "--to", "1.0", "--out", tmp_path / "out")
    assert (
        answer.code == 4 and "choose some of them with --sample N or --only NUMBERS" in answer.err
    )


def test_a_chosen_set_keeps_the_number_that_it_has_in_runs(
    xosc_export: Command, tmp_path: Path
) -> None:
    path = scenario(
        tmp_path, init=place("Ego", 100, 5) + place("Lead", "${100 + $Gap}", 5), stories=BRAKES
    )
    constraint = (
        '<ConstraintGroup><ValueConstraint rule="greaterThan" value="25"/></ConstraintGroup>'
    )
    declared = '<ParameterDeclaration name="Gap" parameterType="double" value="50.0"'
    text = path.read_text()
    assert f"{declared}/>" in text
    path.write_text(
        text.replace(f"{declared}/>", f"{declared}>{constraint}</ParameterDeclaration>")
    )
    sets = distribution(tmp_path, "sets", {"Gap": (20.0, 40.0, 10.0)})
    assert xosc_export(sets, "--to", "1.0", "--out", tmp_path / "out").code == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.xosc")) == [
        "sets~000001.xosc",
        "sets~000002.xosc",
    ]
    answer = xosc_export(path, "--to", "1.0", "--out", tmp_path / "alone", "--only", "7")
    assert answer.code == 2 and "there is none among the files" in answer.err


def test_every_target_is_listed(xosc_export: Command) -> None:
    answer = xosc_export("--targets")
    assert [line.split()[0] for line in answer.out.splitlines()] == list(TARGETS)


def test_a_file_in_the_folder_of_exports_is_a_target(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plain.py").write_text(PLAIN)
    monkeypatch.setattr(
        runner.exchange.exports, "__path__", [*runner.exchange.exports.__path__, str(tmp_path)]
    )
    packages.names.cache_clear()
    packages.described.cache_clear()
    targets = find_targets()
    assert targets["plain"] == (
        "plain",
        "runner.exchange.exports.plain",
        True,
        "end time and verdict as text",
    )
    assert targets.keys() - TARGETS.keys() == {"plain"}
    path = scenario(tmp_path, stories=BRAKES, stop=0.5)
    settings = RunSettings(world="kinematic", sut="none")
    assert list(export_runs([path], targets["plain"], Folder(tmp_path / "out"), settings, {})) == [
        Exported("scenario", 0, [])
    ]
    assert (tmp_path / "out" / "scenario.txt").read_text() == "0.50 s, passed: True\n"


@pytest.fixture
def limited(tmp_path: Path) -> Path:
    """A scenario whose gap is to be less than 55 m, and is 50."""
    path = scenario(tmp_path / "in", stories=BRAKES)
    declared = 'name="Gap" parameterType="double" value="50.0"/>'
    text = path.read_text(encoding="utf-8")
    assert declared in text
    group = '<ConstraintGroup><ValueConstraint rule="lessThan" value="55"/></ConstraintGroup>'
    path.write_text(
        text.replace(declared, f"{declared[:-2]}>{group}</ParameterDeclaration>"), encoding="utf-8"
    )
    return path


def test_sets_that_violate_constraints_can_be_written(
    xosc_export: Command, tmp_path: Path, limited: Path
) -> None:
    gaps = distribution(limited.parent, "gaps", {"Gap": (50, 56, 2)})
    for more, written in (("--constraints", 3), ("--no-constraints", 4)):
        assert xosc_export(gaps, "--to", "1.0", "--out", tmp_path / more, more).code == 0
        assert len(list((tmp_path / more).glob("gaps~*"))) == written


@pytest.mark.parametrize(
    "options", [["esmini"], ["carla"], ["carla", "--road", "auto"]], ids=" ".join
)
def test_constraints_can_be_left_aside(
    options: list[str], xosc_export: Command, tmp_path: Path, limited: Path
) -> None:
    limited.write_text(
        limited.read_text(encoding="utf-8").replace('value="50.0"', 'value="60.0"'),
        encoding="utf-8",
    )
    assert xosc_export(limited, "--out", tmp_path / "refused", "--to", *options).code == 3
    answer = xosc_export(limited, "--out", tmp_path / "aside", "--no-constraints", "--to", *options)
    assert answer.code == 0, answer.err


@pytest.mark.parametrize("target", ["sumo", "openlabel"])
def test_6_an_exported_run_did_not_test_what_its_file_describes(
    xosc_export: Command, tmp_path: Path, target: str
) -> None:
    path = scenario(tmp_path, stories=BRAKES, stop=1.0)
    path.write_text(path.read_text().replace("<Act ", "<Actt/><Act ", 1))
    ask = (path, "--to", target, "--world", "kinematic", "--quiet")
    answer = xosc_export(*ask, "--out", tmp_path / "out")
    assert (answer.code, answer.out) == (6, "")
    assert "exported, but inconclusive" in answer.err and "did you mean Act?" in answer.err
    assert (tmp_path / "out").exists()
    answer = xosc_export(*ask, "--out", tmp_path / "again", "--allow-inconclusive")
    assert answer.code == 0 and "exported, but inconclusive" in answer.err


@pytest.mark.parametrize("target", ["1.3", "esmini", "carla"])
@pytest.mark.parametrize("only", [[], ["--only", "0"]])
def test_3_a_distribution_is_not_valid(
    xosc_export: Command, tmp_path: Path, target: str, only: list[str]
) -> None:
    scenario(tmp_path, stories=BRAKES)
    path = distribution(tmp_path, "sets", {"Gap": (20.0, 40.0, 10.0)})
    path.write_text(
        path.read_text().replace(
            "</ParameterValueDistribution>", "<Actt/></ParameterValueDistribution>"
        )
    )
    answer = xosc_export(path, "--to", target, "--out", tmp_path / "out", *only)
    assert (answer.code, answer.out) == (3, "")
    assert (
        "not valid in its own version" in answer.err
        and str(path) in answer.err
        and "Actt" in answer.err
    )


@pytest.mark.parametrize("target", ["1.3", "esmini", "sumo"])
def test_what_is_assumed_of_a_distribution_is_a_remark_of_its_exports(
    xosc_export: Command, tmp_path: Path, target: str
) -> None:
    scenario(tmp_path, stories=BRAKES, stop=0.5)
    path = distribution(tmp_path, "sets", {"Gap": (20.0, 40.0, 10.0)})
    path.write_text(path.read_text().replace('revMinor="', 'revMinor="9'))
    world = ["--world", "kinematic"] if target == "sumo" else []
    answer = xosc_export(path, "--to", target, "--out", tmp_path / "out", "--only", "0", *world)
    assert (
        answer.code == (6 if target == "sumo" else 0)  # what is played is inconclusive
        and f"{path}:" in answer.out + answer.err
        and "the header has the revision" in answer.out + answer.err
    )
