"""The command `xosc-run`: options, exit codes, what goes to standard output and standard error."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from lxml import etree

from schemas.packages import version
from tests.commands import Command
from tests.runner.files import car, distribution, place, scenario, story


@pytest.fixture
def xosc_run(command: Command) -> Command:
    """The command in the kinematic world."""
    return partial(command, "xosc-run", "--world", "kinematic")


@pytest.fixture
def passing(tmp_path: Path) -> Path:
    return scenario(tmp_path, "passing", stop=0.2)


def collision(folder: Path) -> Path:
    return scenario(folder, "collision", init=place("Ego", 100, 20) + place("Lead", 103, 20), stop=0.2)


# exit codes ---------------------------------------------------------------------------------


def test_0_passed(xosc_run: Command, passing: Path) -> None:
    answer = xosc_run(passing)
    assert answer.code == 0
    assert [line.split() for line in answer.out.splitlines()] == [
        ["verdict", "run", "end", "ended", "by"],
        ["PASSED", "passing", "0.20", "s", "stop", "trigger"],
    ]
    assert answer.err == ""


def test_1_the_ego_collides(xosc_run: Command, tmp_path: Path) -> None:
    answer = xosc_run(collision(tmp_path))
    assert answer.code == 1
    assert "FAILED  collision" in answer.out
    assert "collision with Lead at 0.00 s" in answer.out


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--param", "Gap"], "NAME=VALUE"),
        (["--param", "=3"], "NAME=VALUE"),
        (["--param", "Gapp=3"], "did you mean 'Gap'?"),
        (["--param", "Gap=wide"], "'wide' is not a number"),
        (["--sut", "absent"], "there are aeb, cas, fsm, idm, none, r157-cc, r157-reg, rss, sumo, and module:Class"),
        (["--sut", ":Class"], "there are aeb, cas"),
        (["--sut", "absent_module:Class"], "No module named 'absent_module'"),
        (["--sut", "json:Absent"], "Absent"),
        (["--sut", "json:JSONEncoder"], "has no method reset"),
        (["--ego", "Egon"], "'Egon'; there are Ego, Lead"),
        (["--timestep", "0"], "the time step must be from"),
        (["--timestep", "nan"], "the time step must be from"),
        (["--timestep", "soon"], "--timestep"),
        (["--max-time", "-1"], "the time limit must be"),
        (["--max-time", "inf"], "the time limit must be"),
        (["--world", "flat"], "sumo, kinematic"),
        (["--jobs", "0"], "--jobs"),
        (["--resume"], "--out"),
        (["--bogus"], "--bogus"),
        (["--out", "/proc/absent/out"], "/proc/absent"),
        (["--out", "/dev/null/out"], "/dev/null"),
        (["--junit", "/dev/null/report.xml"], "/dev/null"),
        (["--junit", "/"], "/"),
    ],
)
def test_2_wrong_usage(xosc_run: Command, passing: Path, options: list[str], complaint: str) -> None:
    answer = xosc_run(*options, passing)
    assert answer.code == 2
    assert complaint in answer.err
    assert "PASSED" not in answer.out
    assert "Traceback" not in answer.err
    if "Usage" not in answer.err:
        assert answer.err.startswith("xosc-run: ")
        assert answer.err.count("\n") == 1


@pytest.mark.parametrize("text", ["", "no XML", "<OpenSCENARIO/>", "<OpenDRIVE/>", "<!DOCTYPE a><a/>"])
def test_3_invalid_file(xosc_run: Command, tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.xosc").write_text(text)
    answer = xosc_run(tmp_path / "bad.xosc")
    assert answer.code == 3
    assert answer.out.splitlines()[-1].split() == ["ERROR", "bad", "invalid", "file"]
    assert answer.err.startswith(f"xosc-run: {tmp_path / 'bad.xosc'}:")
    assert answer.err.count("\n") == 1


def test_3_no_such_file_and_a_folder(xosc_run: Command, tmp_path: Path) -> None:
    assert xosc_run(tmp_path / "*.xosc")[::2] == (3, f"xosc-run: {tmp_path / '*.xosc'}: no such file\n")
    assert xosc_run(tmp_path)[::2] == (3, f"xosc-run: {tmp_path}: this is a folder, a file is expected\n")


def test_4_not_supported(xosc_run: Command, tmp_path: Path) -> None:
    external = '<ScenarioObject name="Ego"><ExternalObjectReference name="library/object"/></ScenarioObject>'
    path = scenario(tmp_path, "external", entities=[external, car("Lead")])
    answer = xosc_run(path)
    assert answer.code == 4
    assert "not supported" in answer.out
    assert "ExternalObjectReference" in answer.err


def test_5_internal_error(xosc_run: Command, passing: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runner.interpreter.simulation.Simulation.tick", lambda _: 1 // 0)
    answer = xosc_run(passing)
    assert (answer.code, answer.err) == (5, "xosc-run: internal error: ZeroDivisionError: integer division or modulo by zero\n")


def test_5_a_system_under_test_fails(xosc_run: Command, passing: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "failing_system.py").write_text(
        "class Failing:\n"
        "    def reset(self, ego, timestep, seed): pass\n"
        "    def control(self, observation, dt): raise ValueError('no idea')\n"
    )
    monkeypatch.chdir(tmp_path)  # a system in the working directory is found
    answer = xosc_run(passing, "--sut", "failing_system:Failing")
    assert answer.code == 5
    place = tmp_path / "failing_system.py"
    failed = "the system under test failing_system:Failing failed at 0.00 s"
    assert answer.err == f"xosc-run: {failed}: ValueError: no idea ({place}:3)\n"


def test_of_several_runs_the_gravest_counts_and_none_is_left_out(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    failing = collision(tmp_path)
    assert xosc_run(passing, failing).code == 1
    answer = xosc_run(failing, tmp_path / "absent.xosc", passing)
    assert answer.code == 3
    assert [line.split()[0] for line in answer.out.splitlines()] == ["verdict", "FAILED", "ERROR", "PASSED", "3"]
    assert "3 runs: 1 passed, 1 failed, 1 error" in answer.out
    assert xosc_run(failing, passing, tmp_path / "absent.xosc", "--ego", "Nobody").code == 3


# options ------------------------------------------------------------------------------------


def test_parameters_are_given_by_name(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    assert xosc_run(passing, "-p", "Gap=3", "--sut", "none").code == 1
    assert xosc_run(passing, "-p", "Gap=3", "-p", "Gap=30").code == 0


def test_the_settings_reach_the_run(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    settings = ["--timestep", "0.1", "--seed", "7", "--max-time", "0.1", "--sut", "none", "--ego", "Lead"]
    assert "time limit" in xosc_run(passing, *settings, "--out", tmp_path / "out").out
    result = json.loads((tmp_path / "out" / "passing" / "result.json").read_text())
    assert result["settings"] == {"timestep": 0.1, "seed": 7, "world": "kinematic", "max_time": 0.1}
    assert (result["ego"], result["sut"], result["end_time"]) == ("Lead", "none", 0.1)


def test_constraints_can_be_left_aside(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    group = '<ConstraintGroup><ValueConstraint rule="lessThan" value="10"/></ConstraintGroup>'
    text = passing.read_text().replace('name="Gap" parameterType="double" value="50.0"/>', "@")
    assert "@" in text
    declared = f'name="Gap" parameterType="double" value="5">{group}</ParameterDeclaration>'
    passing.write_text(text.replace("@", declared))
    assert xosc_run(passing, "-p", "Gap=50").code == 3
    assert xosc_run(passing, "-p", "Gap=50", "--no-constraints").code == 0
    variation = distribution(tmp_path, "variation", {"Gap": (6, 12, 2)}, of="passing")
    assert xosc_run(variation, "--dry-run").out.count("PASSED") == 2
    assert xosc_run(variation, "--dry-run", "--no-constraints").out.count("PASSED") == 4


def test_a_dry_run_compiles_and_writes_nothing(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    bad = scenario(tmp_path, "bad", stories=story("Nobody", []))
    answer = xosc_run(passing, bad, "--dry-run", "--out", tmp_path / "out")
    assert answer.code == 3
    assert "not run (--dry-run)" in answer.out
    assert not (tmp_path / "out").exists()


def test_quiet_prints_failures_and_errors_only(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    assert xosc_run("-q", passing) == (0, "", "")
    answer = xosc_run("-q", passing, collision(tmp_path))
    assert answer.out.split()[:2] == ["FAILED", "collision"]


def test_verbose_prints_tracebacks(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    for arguments in ([tmp_path / "absent.xosc"], [passing, "--sut", "absent"]):
        assert "Traceback" not in xosc_run(*arguments).err
        answer = xosc_run("-v", *arguments)
        assert "Traceback" in answer.err
        assert answer.err.splitlines()[-1].startswith("xosc-run: ")


def test_a_batch_is_resumed(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    out = tmp_path / "out"
    first = xosc_run(passing, "--out", out)
    refused = xosc_run(passing, "--out", out)
    assert refused.code == 2
    assert "--resume" in refused.err
    assert xosc_run(passing, "--out", out, "--resume") == first


def test_junit_is_written_for_runs_and_dry_runs(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    report = tmp_path / "new" / "folder" / "report.xml"
    xosc_run(passing, "--junit", report)
    assert etree.parse(report).xpath("string(//testcase/@name)") == "passing"
    xosc_run(passing, tmp_path / "absent.xosc", "--dry-run", "--junit", report)
    assert etree.parse(report).xpath("count(//error)") == 1


def test_file_names_are_shown_without_control_characters(xosc_run: Command, tmp_path: Path) -> None:
    answer = xosc_run(tmp_path / "a\n\x1b[31mb.xosc")
    assert answer.code == 3
    assert "\x1b" not in answer.out + answer.err
    assert answer.err.count("\n") == 1


def test_version_and_help(xosc_run: Command) -> None:
    assert xosc_run("--version") == (0, f"xosc-run {version()}\n", "")
    answer = xosc_run("--help")
    assert answer.code == 0
    for option in ("--param", "--sut", "--ego", "--timestep", "--seed", "--max-time", "--out", "--junit", "--jobs", "--dry-run"):
        assert option in answer.out


# as a process -------------------------------------------------------------------------------


def test_a_closed_pipe_is_no_error(tmp_path: Path) -> None:
    scenario(tmp_path, stop=0.05)
    variation = distribution(tmp_path, "variation", {"Gap": (20, 80, 1)})
    command = [sys.executable, "-m", "runner.cli", "--world", "kinematic", str(variation)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(60) == 141
    assert process.stderr.read() == b""


def test_any_bytes_in_a_file_name_and_any_encoding_of_the_terminal(tmp_path: Path, passing: Path) -> None:
    name = bytes(tmp_path) + b"/odd-\xff-\xc3\xa4.xosc"
    Path(name.decode("utf-8", "surrogateescape")).write_bytes(passing.read_bytes())
    command = [sys.executable, "-m", "runner.cli", "--world", "kinematic", name, "--out", "out", "--junit", "junit.xml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, env={"PYTHONIOENCODING": "ascii"}, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"PASSED" in done.stdout
    (result,) = (tmp_path / "out").rglob("result.json")
    assert json.loads(result.read_text())["verdict"] == "passed"
    assert etree.parse(tmp_path / "junit.xml").xpath("count(//testcase)") == 1


def test_help_imports_no_simulator_and_no_numerics() -> None:
    code = "import sys, runner.cli; print(*[m for m in ('libsumo', 'numpy', 'lxml', 'pyarrow', 'xosc') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == ""
