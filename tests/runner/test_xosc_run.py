"""The command `xosc-run`: options, exit codes, what goes to standard output and standard error."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import struct
import subprocess
import sys
import termios
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from lxml import etree

from schemas.common.packages import version
from tests.commands import Command
from tests.conformance.support import SCENARIOS as CONFORMANCE
from tests.runner.files import HEADER, car, distribution, place, scenario, story


@pytest.fixture
def xosc_run(command: Command) -> Command:
    """The command in the kinematic world."""
    return partial(command, "xosc-run", "--world", "kinematic")


@pytest.fixture
def passing(tmp_path: Path) -> Path:
    return scenario(tmp_path, "passing", stop=0.2)


def collision(folder: Path) -> Path:
    return scenario(
        folder, "collision", init=place("Ego", 100, 20) + place("Lead", 103, 20), stop=0.2
    )


# exit codes ---------------------------------------------------------------------------------


def test_0_passed(xosc_run: Command, passing: Path) -> None:
    answer = xosc_run(passing)
    assert answer.code == 0
    head, passed, evidence = answer.out.splitlines()
    assert head.split() == ["verdict", "run", "end", "ended", "by"]
    assert passed.split() == ["PASSED", "passing", "0.20", "s", "stop", "trigger"]
    assert evidence.startswith(
        "evidence: participants 2 of 2, seconds 0.20 s, ego 0.20 s, road 0.20 s"
    )
    assert answer.err == ""


def test_a_passed_run_tells_the_values_that_its_limits_are_about(
    xosc_run: Command, tmp_path: Path
) -> None:
    ahead = scenario(tmp_path, init=place("Ego", 100, 20) + place("Lead", 160, 10), stop=1.0)
    out = ("--sut", "none", "--out", tmp_path / "out")
    limits = ("--fail-if", "min_ttc<1", "--fail-if", "timeout", "--fail-if", "end_time>9")
    answer = xosc_run(ahead, *limits, *out)
    assert answer.code == 0
    value = re.search(
        r"trigger: (min_ttc is \d\.\d\d s with Lead at 1\.00 s); end_time is 1", answer.out
    )
    assert value is not None, answer.out
    assert "there until the end 2 of 2" in answer.out
    assert "measures of --fail-if defined for 100.0%" in answer.out and "reserve" not in answer.out
    again = xosc_run(ahead, *limits, *out, "--resume")
    assert value[1] in again.out and again.err == "", "it follows from the results"


def test_1_the_ego_collides(xosc_run: Command, tmp_path: Path) -> None:
    answer = xosc_run(collision(tmp_path))
    assert answer.code == 1
    assert "FAILED       collision" in answer.out
    assert "collision with Lead at 0.00 s" in answer.out


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--param", "Gap"], "NAME=VALUE"),
        (["--param", "=3"], "NAME=VALUE"),
        (["--param", "Gapp=3"], "did you mean 'Gap'?"),
        (["--param", "Gap=wide"], "'wide' is not a number"),
        (
            ["--sut", "absent"],
            (
                "there are adas, aeb, bridge, cas, fmu, fsm, idm, none, r157-cc, r157-reg, rss, "
                "sumo, and module"
            ),
        ),
        (["--sut", ":Class"], "there are adas, aeb, bridge, cas"),
        (["--sut", "absent_module:Class"], "No module named 'absent_module'"),
        (["--sut", "json:Absent"], "Absent"),
        (["--sut", "json:JSONEncoder"], "has no method reset"),
        (["--ego", "Egon"], "'Egon'; did you mean 'Ego'?"),
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
def test_2_wrong_usage(
    xosc_run: Command, passing: Path, options: list[str], complaint: str
) -> None:
    answer = xosc_run(*options, passing)
    assert answer.code == 2
    assert complaint in answer.err
    assert "PASSED" not in answer.out
    assert "Traceback" not in answer.err
    if "Usage" not in answer.err:
        assert answer.err.startswith("xosc-run: ")
        assert answer.err.count("\n") == 1


@pytest.mark.parametrize(
    "text", ["", "no XML", "<OpenSCENARIO/>", "<OpenDRIVE/>", "<!DOCTYPE a><a/>"]
)
def test_3_invalid_file(xosc_run: Command, tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.xosc").write_text(text)
    answer = xosc_run(tmp_path / "bad.xosc")
    assert answer.code == 3
    assert answer.out.splitlines()[-1].split() == ["ERROR", "bad", "invalid", "file"]
    assert answer.err.startswith(f"xosc-run: {tmp_path / 'bad.xosc'}:")
    assert answer.err.count("\n") == 1


def test_no_such_file_and_a_folder_or_glob_without_scenarios(
    xosc_run: Command, tmp_path: Path
) -> None:
    assert xosc_run(tmp_path / "absent.xosc")[::2] == (
        3,
        f"xosc-run: {tmp_path / 'absent.xosc'}: no such file\n",
    )
    (tmp_path / "cars.xosc").write_text(
        f'<OpenSCENARIO>{HEADER}<Catalog name="cars"/></OpenSCENARIO>'
    )
    for nothing in (tmp_path, tmp_path / "*.xosc"):
        answer = xosc_run(nothing)
        assert answer[::2] == (
            2,
            f"xosc-run: {nothing}: this stands for no scenario or variation file\n",
        )


def test_folders_and_globs_stand_for_what_can_be_run_in_them(
    xosc_run: Command, tmp_path: Path
) -> None:
    for name in ("a/one", "a/b/two", "c/three"):
        scenario(tmp_path / Path(name).parent, Path(name).name, stop=0.1)
    (tmp_path / "a" / "cars.xosc").write_text(
        f'<OpenSCENARIO>{HEADER}<Catalog name="cars"/></OpenSCENARIO>'
    )
    (tmp_path / "a" / "broken.xosc").write_text("<OpenSCENARIO>")

    def shown(*arguments: object) -> list[str]:
        return [
            line.split()[1]
            for line in xosc_run(*arguments).out.splitlines()
            if line.startswith(("PASSED", "ERROR "))
        ]

    assert shown(tmp_path / "a") == ["two", "broken", "one"]
    assert shown(tmp_path / "*" / "*e.xosc", tmp_path / "a" / "one.xosc") == ["one", "three"]


def test_4_not_supported(xosc_run: Command, tmp_path: Path) -> None:
    external = (
        '<ScenarioObject name="Ego"><ExternalObjectReference '
        'name="library/object"/></ScenarioObject>'
    )
    path = scenario(tmp_path, "external", entities=[external, car("Lead")])
    answer = xosc_run(path)
    assert answer.code == 4
    assert "not supported" in answer.out
    assert "ExternalObjectReference" in answer.err


def test_5_internal_error(
    xosc_run: Command, passing: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runner.engine.storyboard.simulation.Simulation.tick", lambda _: 1 // 0)
    answer = xosc_run(passing)
    assert (answer.code, answer.err) == (
        5,
        "xosc-run: internal error: ZeroDivisionError: integer division or modulo by zero\n",
    )


def test_5_a_system_under_test_fails(
    xosc_run: Command, passing: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
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


def test_of_several_runs_the_gravest_counts_and_none_is_left_out(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    failing = collision(tmp_path)
    assert xosc_run(passing, failing).code == 1
    answer = xosc_run(failing, tmp_path / "absent.xosc", passing)
    assert answer.code == 3
    assert [line.split()[0] for line in answer.out.splitlines()] == [
        "verdict", "FAILED", "ERROR", "PASSED", "ERROR,", "absent", "FAILED,", "collision", "3",
        "planned",
    ]  # fmt: skip
    assert "3 runs: 1 error, 1 failed, 1 passed" in answer.out
    assert xosc_run(failing, passing, tmp_path / "absent.xosc", "--ego", "Nobody").code == 3


# options ------------------------------------------------------------------------------------


def test_parameters_are_given_by_name(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    assert xosc_run(passing, "-p", "Gap=3", "--sut", "none").code == 1
    assert xosc_run(passing, "-p", "Gap=30", "--sut", "none").code == 0
    assert "one value is expected" in xosc_run(passing, "-p", "Gap=3", "-p", "Gap=30").err


def test_the_settings_reach_the_run(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    settings = [
        "--timestep",
        "0.1",
        "--seed",
        "7",
        "--max-time",
        "0.1",
        "--sut",
        "none",
        "--ego",
        "Lead",
    ]
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
    assert xosc_run(passing, "-p", "Gap=50", "--no-constraints").code == 6
    assert xosc_run(passing, "-p", "Gap=50", "--no-constraints", "--allow-inconclusive").code == 0
    variation = distribution(tmp_path, "variation", {"Gap": (6, 12, 2)}, of="passing")
    assert "2 parameter sets" in xosc_run(variation, "--dry-run").out
    assert "4 parameter sets" in xosc_run(variation, "--dry-run", "--no-constraints").out
    names = [line.split()[1] for line in xosc_run(variation).out.splitlines() if "~" in line][:2]
    assert names == ["variation~000000", "variation~000001"]
    excluded = xosc_run(variation, "--only", "1,3")
    assert (
        excluded.code == 3
        and "Gap = 12" in excluded.err
        and re.search(r"variation~000001 .* Gap=8", excluded.out)
    )


def test_sets_that_constraints_leave_out_are_told_and_none_left_is_an_error(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    group = '<ConstraintGroup><ValueConstraint rule="lessThan" value="10"/></ConstraintGroup>'
    passing.write_text(
        passing.read_text().replace(
            'value="50.0"/>', f'value="5">{group}</ParameterDeclaration>', 1
        )
    )
    variation = distribution(tmp_path, "variation", {"Gap": (6, 12, 2)}, of="passing")
    told = (
        f"remark: {variation}: 2 more parameter sets left out: the values violate the "
        "scenario's constraints"
    )
    for options in ([], ["--dry-run"], ["--sample", "4"]):
        assert told in xosc_run(variation, *options).out, options
    assert "left out" not in xosc_run(variation, "--no-constraints").out
    none = distribution(tmp_path, "none", {"Gap": (12, 18, 2)}, of="passing")
    for options in ([], ["--dry-run"], ["--sample", "2"], ["-q"]):
        answer = xosc_run(none, *options)
        assert answer.code == 3, options
        assert re.search(
            rf"^xosc-run: {none}:\d+: .*none of \d (parameter sets|samples) "
            r"satisfies the constraints",
            answer.err,
        )


def test_files_that_break_their_standard_are_told_of_under_quiet_too(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    assert xosc_run(passing, "-q") == (0, "", "")
    passing.write_text(
        passing.read_text().replace(' mass="1500"', "").replace("<CatalogLocations/>", "")
    )
    for options in (["-q"], ["-q", "--dry-run"]):
        answer = xosc_run(passing, *options)
        assert (answer.code, answer.out) == (0, "")
        assert answer.err.startswith(f"xosc-run: read though it breaks its standard: {passing}:"), (
            answer.err
        )
        assert answer.err.count("\n") == 1


def test_a_dry_run_compiles_and_writes_nothing(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    bad = scenario(tmp_path, "bad", stories=story("Nobody", []))
    answer = xosc_run(passing, bad, "--dry-run", "--out", tmp_path / "out")
    assert answer.code == 3
    assert [line.split()[:2] for line in answer.out.splitlines()[:2]] == [
        ["LOADED", "passing"],
        ["ERROR", "bad"],
    ]
    assert "not run (--dry-run)" in answer.out and "PASSED" not in answer.out
    assert answer.out.splitlines()[-2:] == [
        "2 files: 1 error, 1 loaded",
        "without --dry-run: 2 runs",
    ]
    assert not (tmp_path / "out").exists()


def test_a_dry_run_begins_the_scenario(xosc_run: Command) -> None:
    """Its initial actions are done, so that what these can't do, or assume, is said."""
    path = CONFORMANCE / "RelativeLanePosition.xosc"
    assert xosc_run(path, "--dry-run", "-p", "Lanes=0", "--sut", "none").code == 0
    refused = xosc_run(path, "--dry-run", "-p", "Lanes=5")
    assert refused.code == 3 and "dLane=5 leads from" in refused.out + refused.err
    assumed = xosc_run(path, "--dry-run", "-p", "Lanes=0", "-p", "Ds=5000", "--sut", "none")
    assert assumed.code == 6 and "its end is assumed" in assumed.out + assumed.err


def test_a_dry_run_of_a_variation_file_is_one_line(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    good = distribution(tmp_path, "good", {"Gap": (20, 60, 10)}, of="passing")
    answer = xosc_run(good, "--dry-run")
    assert answer.out.split() == [
        "LOADED",
        "good",
        "not",
        "run",
        "(--dry-run):",
        "5",
        "parameter",
        "sets",
    ]
    last = xosc_run(good, passing, "--dry-run").out.splitlines()[-1]
    assert "without --dry-run: 6 runs" in last and last.endswith("--sample 1")
    scenario(
        tmp_path,
        "short",
        init=place("Ego", 100, 20) + place("Lead", "${100 + sqrt($Gap - 20)}", 20),
    )
    partly = distribution(tmp_path, "partly", {"Gap": (0, 40, 10)}, of="short")
    answer = xosc_run(partly, passing, "--dry-run", "--junit", tmp_path / "junit.xml")
    assert answer.code == 3
    assert (
        answer.err.startswith("xosc-run: 2 of 5 parameter sets: ") and answer.err.count("\n") == 1
    )
    assert etree.parse(tmp_path / "junit.xml").xpath("count(//testcase)") == 2


def test_quiet_prints_failures_and_errors_only(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    assert xosc_run("-q", passing) == (0, "", "")
    answer = xosc_run("-q", passing, collision(tmp_path))
    assert answer.out.split()[:2] == ["FAILED", "collision"]


def test_verbose_prints_tracebacks(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    for arguments in ([tmp_path / "absent.xosc"], [passing, "--sut", "absent"]):
        assert "Traceback" not in xosc_run(*arguments).err
        answer = xosc_run("-v", *arguments)
        assert "Traceback" in answer.err
        assert answer.err.splitlines()[-1].startswith("xosc-run: ")


@pytest.mark.parametrize("how", [(), ("--jobs", 2), ("--batch",)])
def test_a_batch_stops_after_so_many_failures_and_is_resumed(
    xosc_run: Command, tmp_path: Path, how: tuple[str | int, ...]
) -> None:
    scenario(tmp_path, "scenario", init=place("Ego", 100, 20) + place("Lead", 103, 20), stop=0.2)
    variation = distribution(tmp_path, "variation", {"Gap": (20, 70, 10)})
    out = ("--out", tmp_path / "out")
    stopped = xosc_run(variation, "--maxfail", 2, *out, *how)
    assert stopped.code == 1 and stopped.out.count("FAILED  ") == 2
    assert "xosc-run: stopped by --maxfail: 4 of 6 runs left; --resume goes on" in stopped.err
    assert "planned and done: files 1 of 1, runs 2 of 6, tested 2 of 6" in stopped.out
    again = xosc_run(variation, "--maxfail", 2, *out, "--resume", "-q")
    assert again.code == 1
    # Other processes may have done more before the stop, which are known from then on.
    assert "--jobs" in how or "stopped by --maxfail: 2 of 6 runs" in again.err, "quiet, too"
    whole = xosc_run(variation, "--maxfail", 7, *out, "--resume")
    assert whole.code == 1 and "6 runs: 6 failed" in whole.out and "maxfail" not in whole.err
    last = xosc_run(variation, "--maxfail", 6)
    assert "runs 6 of 6" in last.out and "maxfail" not in last.err, "nothing is left"
    refused = xosc_run(variation, "--maxfail", 2, "--dry-run")
    assert refused.code == 2 and "--dry-run has none" in refused.err


def test_a_batch_is_resumed(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    out = tmp_path / "out"
    first = xosc_run(passing, "--out", out)
    refused = xosc_run(passing, "--out", out)
    assert refused.code == 2
    assert "--resume" in refused.err
    assert xosc_run(passing, "--out", out, "--resume") == first


def test_junit_is_written_for_runs_and_dry_runs(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    report = tmp_path / "new" / "folder" / "report.xml"
    xosc_run(passing, "--junit", report)
    assert etree.parse(report).xpath("string(//testcase/@name)") == "passing"
    xosc_run(passing, tmp_path / "absent.xosc", "--dry-run", "--junit", report)
    assert etree.parse(report).xpath("count(//error)") == 1


def test_file_names_are_shown_without_control_characters(xosc_run: Command, tmp_path: Path) -> None:
    answer = xosc_run(tmp_path / "a\n\x1b31mb.xosc")
    assert answer.code == 3
    assert "\x1b" not in answer.out + answer.err
    assert answer.err.count("\n") == 1


def test_version_and_help(xosc_run: Command) -> None:
    assert xosc_run("--version") == (0, f"xosc-run {version()}\n", "")
    answer = xosc_run("--help")
    assert answer.code == 0
    assert xosc_run("-h") == answer
    for option in (
        "--param",
        "--sut",
        "--ego",
        "--timestep",
        "--seed",
        "--max-time",
        "--out",
        "--junit",
        "--jobs",
        "--dry-run",
    ):
        assert option in answer.out


# what is run, and what is told of it ----------------------------------------------------------


def test_numbers_choose_parameter_sets(xosc_run: Command, tmp_path: Path, passing: Path) -> None:
    variation = distribution(
        tmp_path, "variation", {"Gap": (20, 70, 10), "Ego_Speed": (10, 12, 1)}, of="passing"
    )
    answer = xosc_run(variation, "--only", "4, 0-1,17", "--out", tmp_path / "out")
    assert answer.code == 0
    shown = [
        re.sub(r" +0\.20 s +stop trigger +", " ", line[13:])
        for line in answer.out.splitlines()
        if line.startswith("PASSED")
    ]
    assert shown == [
        "variation~000000 Gap=20, Ego_Speed=10",
        "variation~000001 Gap=20, Ego_Speed=11",
        "variation~000004 Gap=30, Ego_Speed=11",
        "variation~000017 Gap=70, Ego_Speed=12",
    ]
    assert (tmp_path / "out" / "variation~000017" / "result.json").is_file()
    assert xosc_run(variation, "--only", "18")[::2] == (
        2,
        f"xosc-run: {variation}: there is no variation 18, the last of 18 is 17\n",
    )


@pytest.mark.parametrize("text", ["", "a", "3-1", "1,,2", "-1", "1-", "1.5"])
def test_what_is_no_number_of_a_parameter_set_is_refused(
    text: str, xosc_run: Command, passing: Path
) -> None:
    answer = xosc_run(passing, f"--only={text}")
    assert answer.code == 2 and "such as 3,7-9" in answer.err


def test_numbers_of_parameter_sets_are_refused_where_no_file_has_any(
    xosc_run: Command, passing: Path, tmp_path: Path
) -> None:
    answer = xosc_run(passing, "--only", "7")
    assert answer.code == 2 and "there is none among the files" in answer.err
    sets = distribution(tmp_path, "sets", {"Gap": (20, 22, 1)}, of="passing")
    answer = xosc_run(passing, sets, "--only", "1")
    assert [line.split()[1] for line in answer.out.splitlines()[1:-2]] == ["passing", "sets~000001"]


def test_values_with_many_digits_are_shortened_in_the_table(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    sets = distribution(tmp_path, "long", {"Gap": (20.123456789, 21.2, 1.0)}, of="passing")
    answer = xosc_run(sets, "--sut", "none", "--max-time", "0.05")
    assert "Gap=20.1235\n" in answer.out and "Gap=21.1235\n" in answer.out


def test_a_sample_of_a_space_of_any_size_is_the_same_for_a_seed(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    ranges = {"Gap": (20.0, 120.0, 0.0001), "Ego_Speed": (10.0, 11.0, 0.001)}
    huge = distribution(tmp_path, "huge", ranges, of="passing")

    def chosen(*options: str) -> list[str]:
        answer = xosc_run(huge, "--sut", "none", "--sample", "5", "--max-time", "0.1", *options)
        return [line.split()[1] for line in answer.out.splitlines() if line.startswith("PASSED")]

    assert len(set(chosen())) == 5
    assert chosen() == chosen() == sorted(chosen())
    assert chosen("--seed", "1") != chosen()
    assert xosc_run(huge, "--sample", "5", "--only", "1").code == 2
    few = distribution(tmp_path, "few", {"Gap": (20, 60, 10)}, of="passing")
    assert "5 runs: 5 passed" in xosc_run(few, "--sample", "9").out


def test_runs_are_repeated_with_seeds_that_count_up(
    xosc_run: Command, tmp_path: Path, passing: Path
) -> None:
    answer = xosc_run(passing, "--repeat", "3", "--seed", "7", "--out", tmp_path / "out")
    names = [f"passing~seed{seed}" for seed in (7, 8, 9)]
    assert [
        line.split()[1] for line in answer.out.splitlines() if line.startswith("PASSED")
    ] == names
    results = [json.loads((tmp_path / "out" / name / "result.json").read_text()) for name in names]
    assert [result["settings"]["seed"] for result in results] == [7, 8, 9]
    again = xosc_run(passing, "--repeat", "3", "--seed", "7", "--out", tmp_path / "out", "--resume")
    assert again == answer
    table = pq.read_table(tmp_path / "out" / "runs.parquet").to_pylist()
    assert [row["seed"] for row in table] == [7, 8, 9]


def test_the_summary_names_failures_by_cause(xosc_run: Command, tmp_path: Path) -> None:
    scenario(
        tmp_path, "near", init=place("Ego", 100, 20) + place("Lead", "${100 + $Gap}", 10), stop=1.0
    )
    variation = distribution(tmp_path, "variation", {"Gap": (3, 33, 3)}, of="near")
    # with a gap of 18 m the end comes before a contact that no brake avoids
    answer = xosc_run(variation, tmp_path / "absent.xosc", "--sut", "none")
    summary = answer.out.splitlines()[13:]
    assert summary == [
        "ERROR, 1 run: no such file",
        "    absent",
        "FAILED, 5 runs: collision with Lead at … s",
        *(f"    variation~00000{number} Gap={3 + 3 * number}" for number in range(5)),
        "INCONCLUSIVE, 1 run: the run ended at … s, … s before Ego would touch Lead at … m/s",
        "    variation~000005 Gap=18",
        "worst 5 of 5 contacts, by the risk that one of the two dies:",
        *(
            f"     10.0 m/s, change of velocity  5.0 m/s, risk <0.1 %  variation~00000{number} "
            f"Gap={3 + 3 * number}: "
            "the ego hit Lead with its front"
            for number in range(5)
        ),
        "12 runs: 1 error, 5 failed, 1 inconclusive, 5 passed",
        "planned and done: files 1 of 2, runs 11 of 12, tested 10 of 12",
    ]


def test_an_error_that_many_runs_share_is_told_once(xosc_run: Command, tmp_path: Path) -> None:
    path = scenario(tmp_path, "lost")
    path.write_text(
        path.read_text(encoding="utf-8").replace(".xodr", "_lost.xodr"), encoding="utf-8"
    )
    answer = xosc_run(distribution(tmp_path, "variation", {"Gap": (3, 9, 3)}, of="lost"))
    assert answer.out.count("invalid file") == 3
    assert answer.err.count("does not exist") == 1


def test_the_terminal_shows_totals_and_names_as_wide_as_it_is(
    tmp_path: Path, passing: Path
) -> None:
    variation = distribution(
        tmp_path, "variation", {"Gap": (20, 70, 10), "Ego_Speed": (10, 12, 1)}, of="passing"
    )
    command = [
        sys.executable,
        "-m",
        "runner.xosc_run",
        "--world",
        "kinematic",
        str(variation),
        "--only",
        "0-3",
    ]
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
    environment = {
        name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")
    }
    process = subprocess.Popen(command, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    shown = b""
    with contextlib.suppress(OSError):  # the other end is closed
        while part := os.read(ours, 65536):
            shown += part
    os.close(ours)
    assert process.wait(60) == 0
    text = shown.decode()
    assert re.search(r"\r\x1b\[K1 of 4 runs, about \d+ s left", text)
    assert "4 of 4 runs" in text
    row = re.search(r"PASSED {7}\x1b\[0m(.*)\r\n", text)
    assert row is not None and re.search("variation~000000 .* Gap=20, Ego_Speed=10", row[1])
    assert len(row[1]) <= 120 - 13  # beside the column of verdicts


# as a process -------------------------------------------------------------------------------


def test_a_closed_pipe_is_no_error(tmp_path: Path) -> None:
    scenario(tmp_path, stop=0.05)
    variation = distribution(tmp_path, "variation", {"Gap": (20, 80, 1)})
    command = [sys.executable, "-m", "runner.xosc_run", "--world", "kinematic", str(variation)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(60) == 141
    assert process.stderr.read() == b""


@pytest.mark.slow
def test_any_bytes_in_a_file_name_and_any_encoding_of_the_terminal(
    tmp_path: Path, passing: Path
) -> None:
    name = bytes(tmp_path) + b"/odd-\xff-\xc3\xa4.xosc"
    Path(name.decode("utf-8", "surrogateescape")).write_bytes(passing.read_bytes())
    command = [
        sys.executable,
        "-m",
        "runner.xosc_run",
        "--world",
        "kinematic",
        name,
        "--out",
        "out",
        "--junit",
        "junit.xml",
    ]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, env={"PYTHONIOENCODING": "ascii"}, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"PASSED" in done.stdout
    (result,) = (tmp_path / "out").rglob("result.json")
    assert json.loads(result.read_text())["verdict"] == "passed"
    assert etree.parse(tmp_path / "junit.xml").xpath("count(//testcase)") == 1


def test_help_imports_no_simulator_and_no_numerics() -> None:
    code = (
        "import sys, runner.xosc_run; print(*[m for m in ('libsumo', 'numpy', 'lxml', 'pyarrow', "
        "'xosc') if m in sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == ""
    )
