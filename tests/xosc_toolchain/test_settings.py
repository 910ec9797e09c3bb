"""One file has the settings of a project: found upwards, read by all commands,
behind the command line.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import xosc_toolchain as xt
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile
from schemas.common.policy import UNTRUSTED, in_force
from schemas.common.storage import fingerprint
from tests.commands import Command
from xosc_toolchain.settings import COMMANDS, of_command, shared_settings
from xosc_toolchain.start import OFFERED

ROOT = Path(__file__).parents[2]
CUT_IN = str(ROOT / "xosc" / "library" / "simple_cut_in.xosc")
SHORT = ("--world", "kinematic", "--max-time", "1", "--allow-inconclusive")


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project's folder, in which the commands are called."""
    from schemas.common.packages import offer

    offer(OFFERED)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_shared_option_of_a_command_may_stand_at_the_top() -> None:
    shared = shared_settings()
    assert {"sut", "fail-if", "least", "road-path", "catalog-path", "jobs", "seed"} <= set(shared)
    for name in COMMANDS:
        own = {key: each.kind for key, each in of_command(name).items() if each.shared}
        assert own == {key: shared[key].kind for key in own}


def test_the_file_is_found_upwards_and_the_command_line_wins(
    project: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "xosc.toml").write_text('sut = "none"\ntimestep = 0.1\n[run]\nout = "results"\n')
    below = project / "a" / "b"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    assert command("xosc-run", CUT_IN, *SHORT, "--timestep", "0.2").code == 0
    kept = json.loads((project / "results" / "batch.json").read_text())
    assert (kept["sut"], kept["timestep"]) == ("none", 0.2)
    digest = fingerprint((project / "xosc.toml").read_bytes())
    assert kept["settings_file"] == {"path": "../../xosc.toml", "digest": digest}
    assert (kept["version"], kept["format"]) == (xt.__version__, 1)


def test_a_table_of_pyproject_is_a_settings_file(project: Path, command: Command) -> None:
    (project / "pyproject.toml").write_text('[project]\nname = "x"\n[tool.xosc]\nsut = "none"\n')
    shown = command("xosc", "config").out.splitlines()
    assert shown[0].split() == ["sut", "none", "pyproject.toml:4"]


def test_a_settings_file_that_is_no_table_or_too_large_is_refused(
    project: Path, command: Command
) -> None:
    (project / "pyproject.toml").write_text("[tool]\nxosc = 3  # tool.xosc\n")
    answer = command("xosc", "config")
    assert (answer.code, answer.err.count("\n")) == (3, 1)
    assert "tool.xosc: a table [tool.xosc] is expected" in answer.err
    (project / "xosc.toml").write_text('sut = "none"\n#' + "x" * (1 << 20))
    assert "at most 1048576 bytes are read" in command("xosc", "config").err


def test_a_project_without_settings_has_the_defaults(project: Path) -> None:
    (project / "pyproject.toml").write_text('[project]\nname = "x"  # has no tool.xosc\n')
    assert RunSettings.of_project() == RunSettings()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('sutt = "adas"', "xosc.toml:1: sutt: there is no such setting; did you mean 'sut'?"),
        ("\nfail_if = []", ("xosc.toml:2: fail_if: there is no such setting; "
                           "did you mean 'fail-if'?")),
        ('out = "x"', ("xosc.toml:1: out: this is an option of single commands: "
                      "it stands in a table")),
        ("[runn]", "xosc.toml:1: runn: there is no such command; did you mean 'run'?"),
        ("[run]\nouut = 1", "xosc.toml:2: ouut: run has no such option; did you mean 'out'?"),
        ("jobs = true", "xosc.toml:1: jobs: a whole number is expected, not true"),
        ('jobs = "2"', "xosc.toml:1: jobs: a whole number is expected, not '2'"),
        ("[run]\njobs = 0", "xosc.toml:2: jobs: Input should be greater than or equal to 1"),
        ('strict = "yes"', "xosc.toml:1: strict: true or false is expected, not 'yes'"),
        ("sut = 3", 'xosc.toml:1: sut: a text is expected, as "…", not 3'),
        ('fail-if = "min_ttc<1"', 'xosc.toml:1: fail-if: a list is expected, as ["…"]'),
        ('junit-inconclusive = "skip"', "did you mean 'skipped'?"),
        ("a = = 1", "xosc.toml:1: this is no TOML: invalid value"),
    ],
)  # fmt: skip
def test_wrong_files_are_refused_with_line_and_suggestion(
    text: str, complaint: str, project: Path, command: Command
) -> None:
    (project / "xosc.toml").write_text(text + "\n")
    answer = command("xosc-run", CUT_IN)
    assert (answer.code, answer.out) == (3, "")
    assert complaint in answer.err


def test_commands_of_lower_floors_know_the_settings_of_all(project: Path, command: Command) -> None:
    (project / "xosc.toml").write_text('sut = "adas"\n[generate]\nbudget = 9\n')
    assert command("xosc-check", CUT_IN).code == 0
    (project / "xosc.toml").write_text('sud = "adas"\n')
    assert "did you mean 'sut'?" in command("xosc-check", CUT_IN).err


def test_a_wrong_value_names_its_file(project: Path, command: Command) -> None:
    (project / "xosc.toml").write_text("timestep = 7\nseed = 1\n")
    answer = command("xosc-run", CUT_IN)
    assert answer.code == 2
    assert "remark: xosc.toml sets timestep, seed" in answer.err
    given = command("xosc-run", CUT_IN, "--jobs", "0")
    assert "xosc.toml" not in given.err
    assert "'--jobs'" in given.err


def test_settings_that_hold_are_named_unless_quiet(project: Path, command: Command) -> None:
    (project / "xosc.toml").write_text("max-time = 4\n[generate]\nbudget = 9\n")
    assert command("xosc-run", CUT_IN).err.startswith("xosc-run: remark: xosc.toml sets max-time\n")
    assert "sets" not in command("xosc-run", CUT_IN, "--quiet").err
    (project / "xosc.toml").write_text("[generate]\nbudget = 9\n")
    assert "sets" not in command("xosc-run", CUT_IN, *SHORT).err


def test_strangers_files_are_played_without_the_settings(project: Path, command: Command) -> None:
    (project / "xosc.toml").write_text('sut = "evil.py:Class"\nnonsense = 1\n')
    answer = command("xosc-run", CUT_IN, *SHORT, "--sut", "none", "--untrusted")
    assert answer.code == 0
    assert "remark: xosc.toml: settings are not read under --untrusted" in answer.err
    with in_force(UNTRUSTED):
        assert RunSettings.of_project() == RunSettings()


def test_paths_are_relative_to_the_file(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (project / "mine.py").write_text("class Mine: ...\n")
    (project / "xosc.toml").write_text(
        'sut = "mine.py:Mine"\nroad-path = ["maps"]\nroad = "auto"\n'
    )
    (project / "below").mkdir()
    monkeypatch.chdir(project / "below")
    chosen = RunSettings.of_project()
    assert chosen.sut == "../mine.py:Mine"
    assert (chosen.road_path, chosen.road) == (("../maps",), "auto")


def test_python_has_the_settings_too(project: Path) -> None:
    (project / "xosc.toml").write_text(
        'sut = "none"\ntimestep = 0.1\nworld = "kinematic"\nmax-time = 1\nfail-if = '
        '["new-failure", "timeout"]\n'
    )
    result = xt.run(CUT_IN)
    assert (result.sut, result.settings["timestep"]) == ("none", 0.1)
    assert result.verdict.passed is False
    assert xt.run(CUT_IN, xt.RunSettings(max_time=0.1)).settings["timestep"] == 0.05
    assert xt.prepare(CUT_IN).run(timestep=0.2).settings["timestep"] == 0.2
    (project / "xosc.toml").write_text("sutt = 1\n")
    with pytest.raises(InvalidFile, match="did you mean 'sut'"):
        xt.run(CUT_IN)


def test_a_written_file_holds_and_is_kept(project: Path, command: Command) -> None:
    assert command("xosc", "init").out == "xosc.toml\n"
    assert command("xosc", "config").out.splitlines()[0].split()[:2] == ["sut", "adas"]
    assert command("xosc", "init").code == 2
    assert (
        "xosc: there is no command 'rn'; did you mean 'run'?" in command("xosc", "config", "rn").err
    )


def test_values_of_a_command_are_shown_with_their_table(project: Path, command: Command) -> None:
    (project / "xosc.toml").write_text("jobs = 2\n[run]\njobs = 3\n[recognize]\njobs = 4\n")
    shown = [line.split() for line in command("xosc", "config").out.splitlines()]
    assert shown[:3] == [
        ["jobs", "2", "xosc.toml:1"],
        ["run.jobs", "3", "xosc.toml:3"],
        ["recognize.jobs", "4", "xosc.toml:5"],
    ]
    assert command("xosc", "config", "run").out.splitlines()[0].split()[1] == "3"
