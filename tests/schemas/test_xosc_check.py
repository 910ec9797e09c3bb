"""The command line, as a user and a pipeline see it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from schemas.xosc_check import app, main

runner = CliRunner()


def run(*arguments: object) -> tuple[int, str]:
    result = runner.invoke(app, [str(argument) for argument in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


NOWHERE = '<RouteCatalog><Directory path="nowhere"/></RouteCatalog></CatalogLocations>'
"""earns a warning"""


def test_sound_folder_is_accepted(project):
    code, output = run(project.folder)
    assert code == 0
    assert output == "4 files checked, 4 accepted: 0 errors, 0 warnings, 0 info\n"


def test_errors_exit_with_1_and_warnings_only_when_strict(project):
    project.edit("scenario", ("</CatalogLocations>", NOWHERE))
    assert run(project.folder)[0] == 0
    assert run(project.folder, "--strict")[0] == 1
    project.edit("scenario", ('<Private entityRef="Target">', '<Private entityRef="Nobody">'))
    code, output = run(project.folder)
    assert code == 1
    assert f"{project.files['scenario']}:{project.line('scenario', 'Nobody')}: error:" in output


def test_road_networks_are_looked_for_where_it_is_asked_for(project, tmp_path, monkeypatch):
    monkeypatch.delenv("XOSC_ROAD_PATH", raising=False)
    moved = tmp_path / "maps"
    moved.mkdir()
    project.files["road"].rename(moved / project.files["road"].name)
    code, output = run(project.files["scenario"])
    assert code == 1 and "LogicFile: there is no file" in output
    assert run(project.files["scenario"], "--road-path", moved)[0] == 0
    monkeypatch.setenv("XOSC_ROAD_PATH", str(moved))
    assert run(project.files["scenario"])[0] == 0
    project.edit("scenario", ('roadId="1"', 'roadId="77"'))
    assert "77" in run(project.files["scenario"])[1], (
        "references are checked against the network that was found"
    )


def test_severity_hides_lesser_levels(project):
    project.edit("scenario", ("</CatalogLocations>", NOWHERE))
    assert "warning: " in run(project.folder)[1]
    assert "warning: " not in run(project.folder, "--severity", "error")[1]


def test_quiet_and_verbose(project):
    assert run(project.folder, "-q") == (0, "")
    assert run(project.folder, "-v")[1].count(": accepted") == 4


@pytest.mark.parametrize("format", ["json", "junit", "xqar", "sarif"])
def test_report_goes_to_the_file(project, tmp_path, format):
    target = tmp_path / "report"
    code, output = run(project.files["scenario"], "--format", format, "--output", target)
    assert code == 0
    assert "1 file checked" in output
    assert target.stat().st_size > 100
    assert run(project.files["scenario"], "--format", format)[1] == target.read_text(
        encoding="utf-8"
    )


def test_globs_folders_and_files_count_once(project):
    code, output = run(
        project.folder / "**" / "*.xosc", project.files["scenario"], project.folder / "catalogs"
    )
    assert code == 0
    assert output.startswith("3 files checked")


def test_names_with_a_dot_are_left_out_of_folders_and_taken_where_they_are_named(project):
    for inner in (".venv/lib/broken.xosc", ".draft-broken.xosc"):
        path = project.folder / inner
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("<broken>")
    assert run(project.folder, "-q") == (0, "")
    assert run(project.folder / ".venv")[0] == run(project.folder / ".draft-broken.xosc")[0] == 1


def test_missing_file_is_a_problem(project):
    code, output = run(project.folder / "none.xosc")
    assert code == 3
    assert "none.xosc: error: no such file" in output


@pytest.mark.parametrize("arguments", [("*.nothing",), ("--format", "pdf", "."), ()])
def test_wrong_usage_exits_with_2(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["xosc-check", *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


def test_folder_without_scenarios_and_unwritable_report_are_usage_errors(
    project, tmp_path, monkeypatch, capsys
):
    (tmp_path / "empty").mkdir()
    for arguments in (
        (tmp_path / "empty",),
        (project.folder, "--output", tmp_path / "empty"),
    ):
        monkeypatch.setattr(sys, "argv", ["xosc-check", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            main()
        assert caught.value.code == 2
        assert capsys.readouterr().err.startswith("xosc-check: ")


def test_rules_are_listed():
    code, output = run("--rules")
    assert code == 0
    assert "asam.net:xosc:1.2.0:reference_control.resolvable_entity_references" in output


def test_version_and_help_load_nothing_that_they_do_not_need():
    assert run("--version")[1].startswith("xosc-check ")
    code = (
        "import sys; from schemas import xosc_check; sys.argv = ['xosc-check', '--help']\n"
        "try: xosc_check.main()\n"
        "except SystemExit as end: print(end.code)\n"
        "print([name for name in ('lxml', 'xmlschema', 'numpy', 'schemas.checks.registry') if "
        "name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *text, ended, loaded = done.stdout.splitlines()
    assert (ended, loaded) == ("0", "[]")
    assert "Exit codes" in "\n".join(text)


def test_pipe_that_closes_is_no_error(project):
    command = f"{sys.executable} -m schemas.xosc_check --format json {project.folder} | true"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_json_on_standard_output_is_nothing_but_json(project):
    assert json.loads(run(project.folder, "--format", "json")[1])["tool"] == "xosc-check"


def test_triage_needs_the_floors_above(project):
    call = [sys.executable, "-m", "schemas.xosc_check", "--triage", str(project.folder)]
    answer = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr.count("\n")) == (2, 1)
    assert "needs the whole toolchain" in answer.stderr
