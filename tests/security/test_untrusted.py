"""`--untrusted` and the limits, for every command: what lies elsewhere,
plug-ins, links, time, memory and runs.
"""

from __future__ import annotations

import inspect
import resource
import signal
import sys
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

import runner.batch.pool
from runner.batch.jobs import Job, Outcome
from runner.systems import find_system
from schemas.checks.checker import check_many
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from schemas.common.policy import (
    UNTRUSTED,
    CommandPolicy,
    LimitReached,
    current,
    in_force,
    limited,
    of_command,
    scratch,
)
from schemas.common.storage import read_bytes
from schemas.common.terminal import command_line
from schemas.common.terminal.options import READ, WRITTEN, file_use
from tests.commands import SCRIPTS, Command
from tests.runner.files import ROADS, SLOW_SYSTEM, distribution, scenario
from xosc.distributions.values import UserDefinedDistribution

COMMANDS = [
    *([name] for name in SCRIPTS),
    *(["xosc-recognize", each] for each in ("catalogue", "label", "record", "train")),
    *(
        ["xosc-road", each]
        for each in (
            "convert",
            "compare",
            "info",
            "show",
            "cut",
            "place",
            "join",
            "repair",
            "drive",
        )
    ),
]
FUNCTIONS = (
    "schemas.xosc_check:xosc_check", "xosc.listing.xosc_list:xosc_list", "runner.xosc_run:xosc_run",
    "runner.exchange.xosc_export:xosc_export", "runner.view.xosc_replay:xosc_replay",
    "generation.xosc_generate:xosc_generate", "generation.loop.xosc_loop:xosc_loop",
    "recognition.xosc_recognize:catalogue", "recognition.xosc_recognize:label",
    "recognition.xosc_recognize:record",
    "recognition.trfe.training.command:train",
    "xosc_toolchain.xosc_explore:xosc_explore",
    *(
        f"xodr.formats.maps.xosc_road:{each}_command"
        for each in ("convert", "compare", "info", "show", "cut", "place", "join", "repair",
            "drive")
    ),
)  # fmt: skip
"""All commands, as functions"""


@pytest.fixture
def contributed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder, and a sound road and catalogue outside of it."""
    outside = tmp_path / "outside"
    (outside / "catalogs").mkdir(parents=True)
    (outside / "road.xodr").write_bytes((ROADS / "straight.xodr").read_bytes())
    (outside / "catalogs" / "one.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" '
        'author="a" description="d"/>'
        '<Catalog name="secret"/></OpenSCENARIO>'
    )
    folder = tmp_path / "contributed"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def naming(folder: Path, road: str) -> Path:
    path = scenario(folder, stop=0.2)
    text = path.read_text()
    start = text.index('<LogicFile filepath="') + len('<LogicFile filepath="')
    path.write_text(text[:start] + road + text[text.index('"', start) :])
    return path


# all commands ----------------------------------------------------------------------------------


OUTPUTS = {"out", "osi", "junit", "output", "keep_model", "copy_to", "page"}
INPUTS = {
    "paths",
    "path",
    "files",
    "folders",
    "folder",
    "source",
    "road",
    "road_path",
    "catalog_path",
}
"""Names of options that commands write to, and read from: each has to declare so"""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_command_has_it_and_knows_which_arguments_are_files(name: str) -> None:
    module, _, function = name.partition(":")
    parameters = inspect.signature(
        getattr(import_module(module), function), eval_str=True
    ).parameters
    assert {"untrusted", "max_memory", "max_seconds"} <= parameters.keys()
    assert ("max_runs" in parameters) == (
        function in {"xosc_run", "xosc_export", "xosc_generate", "xosc_loop"}
    )
    uses = {each: file_use(what.annotation) for each, what in parameters.items()}
    assert {each for each in uses if each in OUTPUTS} == {
        each for each, use in uses.items() if use is WRITTEN
    }
    assert {each: use for each, use in uses.items() if each in INPUTS and use is not READ} == {}


def test_no_command_is_forgotten() -> None:
    assert (
        len(FUNCTIONS) == len(COMMANDS) - 3
    )  # xosc, xosc-recognize and xosc-road have subcommands only


REFUSING = {
    "run": ("xosc-run", "scenario.xosc", "--world", "kinematic"),
    "run in processes": ("xosc-run", "scenario.xosc", "--world", "kinematic", "--jobs", "2"),
    "dry run": ("xosc-run", "scenario.xosc", "--dry-run"),
    "check": ("xosc-check", "scenario.xosc"),
    "export": ("xosc-export", "scenario.xosc", "--to", "1.3", "--out", "out"),
    "export of a run": ("xosc-export", "scenario.xosc", "--to", "parquet", "--out", "out",
        "--world", "kinematic"),
    "generate": (
        "xosc-generate", "scenario.xosc", "--out", "out", "--method", "draws", "--budget", "1",
        "--density", "uniform",
        "--free", "Gap=20..70",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "road",
    ["../outside/road.xodr", "link.xodr", "{}/outside/road.xodr", "file://{}/outside/road.xodr"],
)
@pytest.mark.parametrize("call", REFUSING)
def test_a_road_outside_is_refused_by_all_commands(
    contributed: Path, command: Command, call: str, road: str
) -> None:
    (contributed / "link.xodr").symlink_to("../outside/road.xodr")
    naming(contributed, road.format(contributed.parent))
    answer = command(*REFUSING[call], "--untrusted")
    assert answer.code in (1, 3), answer
    assert "lies outside of" in answer.out + answer.err
    assert "--untrusted refuses" in answer.out + answer.err


def test_roads_are_not_sought_in_the_folders_above(contributed: Path, command: Command) -> None:
    (contributed.parent / "road.xodr").write_bytes((ROADS / "straight.xodr").read_bytes())
    naming(contributed, "road.xodr")
    assert command("xosc-run", "scenario.xosc", "--world", "kinematic").code == 0
    answer = command("xosc-run", "scenario.xosc", "--world", "kinematic", "--untrusted")
    assert answer.code == 3
    assert "does not exist" in answer.err
    assert (
        command(
            "xosc-run", "scenario.xosc", "--world", "kinematic", "--untrusted", "--road-path", ".."
        ).code
        == 0
    )


@pytest.mark.parametrize("directory", ["../outside/catalogs", "link"])
def test_catalogues_outside_are_refused(
    contributed: Path, command: Command, directory: str
) -> None:
    (contributed / "link").symlink_to("../outside/catalogs")
    path = scenario(contributed, stop=0.2)
    locations = (
        "<CatalogLocations><VehicleCatalog><Directory "
        f'path="{directory}"/></VehicleCatalog></CatalogLocations>'
    )
    text = path.read_text().replace("<CatalogLocations/>", locations)
    assert directory in text
    path.write_text(text)
    answer = command("xosc-export", "scenario.xosc", "--to", "1.3", "--out", "out", "--untrusted")
    assert (answer.code, "lies outside of" in answer.out) == (0, True), (
        "no entry is used: the scenario is worked out without"
    )
    assert not (contributed / "out" / "catalogs").exists()
    path.write_text(
        text.replace(
            "<Vehicle name", '<CatalogReference catalogName="secret" entryName="x"/><!--'
        ).replace("</Vehicle>", "-->")
    )
    answer = command("xosc-run", "scenario.xosc", "--world", "kinematic", "--untrusted")
    assert answer.code == 3
    assert "lies outside of" in answer.err


def test_recordings_behind_links_are_refused(contributed: Path, command: Command) -> None:
    (contributed.parent / "outside" / "vehicle_tracks_000.csv").write_text(
        "case_id,track_id,secret\n"
    )
    (contributed / "site").mkdir()
    (contributed / "site" / "vehicle_tracks_000.csv").symlink_to(
        "../../outside/vehicle_tracks_000.csv"
    )
    answer = command("xosc-recognize", "site", "--out", "out", "--labels", "rules", "--untrusted")
    assert answer.code == 3
    assert "lies outside of" in answer.err and "secret" not in answer.err


def test_results_of_runs_name_no_road_outside(contributed: Path, command: Command) -> None:
    scenario(contributed, stop=0.2)
    assert command("xosc-run", "scenario.xosc", "--world", "kinematic", "--out", "out").code == 0
    result = contributed / "out" / "scenario" / "result.json"
    text = result.read_text()
    place = text.index('"road": "')
    result.write_text(
        text[:place] + '"road": "/proc/self/environ' + text[text.index('"', place + 9) :]
    )
    answer = command("xosc-replay", "out/scenario", "--untrusted")
    assert (answer.code, "lies outside of" in answer.err) == (3, True), answer


# code -----------------------------------------------------------------------------------------


def test_models_behind_links_are_refused(contributed: Path) -> None:
    from recognition.catalogue.model import unseen_sites
    from recognition.trfe.storage import load

    shipped = Path(__file__).parents[2] / "recognition" / "models" / "cpu"
    (contributed / "model").mkdir()
    for path in shipped.iterdir():
        (contributed / "model" / path.name).symlink_to(path)
    with in_force(CommandPolicy(named=(contributed,), untrusted=True)):
        for read in (unseen_sites, load):
            with pytest.raises(InvalidFile, match=r"lies outside of .*, which --untrusted refuses"):
                read(contributed / "model")


@pytest.mark.parametrize("name", ["own:System", "installed_by_somebody", "json:loads"])
def test_no_plug_in_is_loaded(contributed: Path, command: Command, name: str) -> None:
    (contributed / "own.py").write_text("open('executed', 'w')")
    scenario(contributed, stop=0.2)
    answer = command("xosc-run", "scenario.xosc", "--untrusted", "--sut", name)
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert "--untrusted loads no code but the toolchain's own" in answer.err
    assert not (contributed / "executed").exists()
    with in_force(UNTRUSTED):
        assert find_system("cas") is not None
        with pytest.raises(Unsupported, match="--untrusted loads none"):
            _ = UserDefinedDistribution("normal", "").plugin


def test_python_that_imports_from_the_folder_is_refused(
    contributed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (contributed / "src").mkdir()
    monkeypatch.setattr(sys, "path", [*sys.path, str(contributed / "src")])
    with pytest.raises(UsageError, match="Python imports from this folder"):
        of_command(["."], [], [], UNTRUSTED)
    of_command(["."], [], [], CommandPolicy())


# links ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "call",
    [
        ["xosc-check", "elsewhere"],
        ["xosc-check", "elsewhere/road.xodr"],
        ["xosc-run", "scenario.xosc", "--out", "elsewhere/new"],
        ["xosc-run", "scenario.xosc", "--out", "out"],
        ["xosc-run", "scenario.xosc", "--junit", "report.xml"],
        ["xosc-check", "scenario.xosc", "--output", "report.xml"],
        ["xosc-run", "scenario.xosc", "--osi", "report.xml"],
        ["xosc-export", "scenario.xosc", "--to", "1.3", "--out", "out"],
    ],
    ids=" ".join,
)
def test_links_that_lead_out_are_refused(
    contributed: Path, command: Command, call: list[str]
) -> None:
    scenario(contributed, stop=0.2)
    (contributed / "elsewhere").symlink_to("../outside")
    (contributed / "report.xml").symlink_to("../outside/report.xml")
    (contributed / "out").mkdir()
    (contributed / "out" / "scenario").symlink_to("../../outside")
    before = sorted(contributed.parent.joinpath("outside").rglob("*"))
    answer = command(*call, "--untrusted")
    assert (answer.code, answer.err.count("\n")) == (2, 1), answer
    assert "symbolic link" in answer.err
    assert sorted(contributed.parent.joinpath("outside").rglob("*")) == before


def test_what_a_name_stands_for(contributed: Path) -> None:
    (contributed / "deep").mkdir()
    (contributed / "deep" / "a.xosc").touch()

    def named(*paths: str) -> tuple[Path, ...]:
        return of_command(paths, [], [], UNTRUSTED).named

    assert named("deep/a.xosc") == named(".") == (contributed,)
    assert named("deep") == (contributed / "deep",)
    assert named("../outside/road.xodr") == named("../outside") == (contributed.parent / "outside",)
    assert command_line._named([["deep/**/*.xosc", "a?.xosc"]]) == [
        Path("deep"),
        Path(),
    ]
    with in_force(of_command(["deep"], ["out"], [], UNTRUSTED)):
        assert (
            current().allows("out/new")
            and not current().allows("beside")
            and not current().allows("\0")
        )
        with (
            pytest.raises(InvalidFile, match="at most"),
            (contributed / "deep" / "large").open("wb") as file,
        ):
            file.truncate(UNTRUSTED.max_bytes + 1)
            read_bytes(contributed / "deep" / "large")


# limits ---------------------------------------------------------------------------------------


def hangs(job: Job) -> Outcome:
    """Waits in Python where its name says so, else outside of Python, or takes memory."""
    if job.name == "waits":
        with limited():
            time.sleep(60.0)
    elif job.name == "blocks":
        with limited():
            sum(range(10**13))  # does not come back to Python for long, as a library
    elif job.name == "swallows":
        with limited():
            while True:
                with suppress(Exception):
                    time.sleep(60.0)
    elif job.name == "grows":
        with limited():
            bytearray(3 * 2**30)
    return Outcome(job, "passed", 0)


def done(job: Job) -> Outcome:
    from runner.batch.jobs import failure

    try:
        return hangs(job)
    except Exception as error:
        return failure(job, error)


def lost(job: Job, signal_number: int | None = None) -> Outcome:
    return Outcome(job, "error", 5, "died")


@pytest.mark.slow
def test_limits_hold_in_worker_processes_and_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = (
        int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize() / 2**30
    )  # GiB, by tests before this one
    monkeypatch.setattr("schemas.common.policy._GRACE", 0.2)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    names = ["first", "waits", "swallows", "blocks", "grows", "last"]
    jobs = [Job(name, Path(name), Path(name)) for name in names]
    with (
        in_force(CommandPolicy(max_seconds=0.3, max_memory=taken + 2.5)),
        runner.batch.pool.Pool(2, done, lost) as pool,
    ):
        found = {outcome.job.name: outcome for outcome in pool.execute(iter(jobs))}
    assert [found[name].state for name in ("first", "last")] == ["passed", "passed"]
    assert all(
        found[name].exit_code == 4
        and "longer than the 0.3 s of --max-seconds" in found[name].message
        for name in ("waits", "swallows")
    )
    assert found["blocks"].message == "died"
    assert (found["grows"].exit_code, "memory" in found["grows"].message) == (4, True)


def test_a_run_that_takes_too_long_ends_and_the_others_go_on(
    contributed: Path, command: Command
) -> None:
    (contributed / "slow_one.py").write_text(SLOW_SYSTEM)
    scenario(contributed, "long", stop=60.0)
    scenario(contributed, "short", stop=0.1)
    call = [
        "xosc-run",
        "long.xosc",
        "short.xosc",
        "--world",
        "kinematic",
        "--sut",
        "slow_one:Slow",
        "--sut-in-process",
        "--max-seconds",
        "1",
    ]
    answer = command(*call)
    assert (answer.code, answer.err.count("\n")) == (4, 1), answer
    assert "long.xosc: this takes longer than the 1 s of --max-seconds" in answer.err
    assert "short" in answer.out


def test_a_file_that_takes_too_long_to_check_is_one_problem_and_the_others_go_on(
    contributed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from schemas.checks import checker

    def slow(path: Path, *_: object) -> list[object]:
        time.sleep(5.0 if path.name == "slow" else 0.0)
        return []

    monkeypatch.setattr(checker, "check", slow)
    with in_force(CommandPolicy(max_seconds=0.2)):
        found = dict(check_many(["slow", "sound"]))
    assert [problem.message for problem in found[Path("slow")]] == [
        "this takes longer than the 0.2 s of --max-seconds"
    ]
    assert found[Path("sound")] == []


SLOW = {
    "xosc-check scenario.xosc": "schemas.checks.checker.check",
    "xosc-list .": "xosc.listing.load",
    "xosc-run scenario.xosc --world kinematic": "runner.judging.execution.run",
    "xosc-run scenario.xosc --dry-run": "runner.judging.execution.prepare",
    "xosc-export scenario.xosc --to 1.3 --out out": "xosc.exports.standard.export",
    (
        "xosc-export scenario.xosc --to parquet --out out --world kinematic"
    ): "runner.judging.execution.run",
    "xosc-replay results/scenario": "runner.batch.outputs.folder.load_run",
    "xosc-recognize results --labels rules --out out": "recognition.recordings.Source.load",
    "xosc-recognize replay results --out out/a.xosc": "recognition.recordings.Source.load",
    "xosc-recognize label results --labels rules": "recognition.recordings.Source.load",
    "xosc-recognize record out --families 1": "recognition.recorder.recorder._attempt",
    "xosc-recognize train results --out out": "recognition.recordings.Source.load",
}
"""A call of each command that works on files one by one, and what takes long in it"""


@pytest.mark.slow
@pytest.mark.parametrize("call", SLOW)
def test_every_command_ends_work_that_takes_too_long(
    contributed: Path, command: Command, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    scenario(contributed, stop=0.1)
    if "results" in call:
        command("xosc-run", "scenario.xosc", "--world", "kinematic", "--out", "results")
    monkeypatch.setattr(SLOW[call], lambda *_, **__: time.sleep(20.0))
    answer = command(*call.split(), "--max-seconds", "0.3")
    assert answer.code == (1 if call.startswith("xosc-check") else 4), answer
    assert "longer than the 0.3 s of --max-seconds" in answer.out + answer.err


def test_a_search_spends_no_more_runs_than_allowed(contributed: Path, command: Command) -> None:
    scenario(contributed, stop=0.1)
    call = [
        *REFUSING["generate"][:4],
        "--method",
        "draws",
        "--density",
        "uniform",
        "--free",
        "Gap=20..70",
        "--quiet",
    ]
    answer = command(*call, "--max-runs", "3", "--world", "kinematic")
    assert answer.code == 1 and "--max-runs 3 leaves 3 of 3000 runs to the search" in answer.err
    refused = command(*call, "--max-runs", "600", "--estimate")
    assert refused.code == 2 and "--max-runs 600 is too few" in refused.err


def test_the_inner_of_two_limits_does_not_end_the_outer() -> None:
    with in_force(CommandPolicy(max_seconds=0.3)), pytest.raises(LimitReached), limited():
        with limited():
            pass
        time.sleep(5.0)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize(
    "call",
    [["xosc-run"], ["xosc-run", "--dry-run"], ["xosc-export", "--to", "1.0", "--out", "out"]],
    ids=" ".join,
)
def test_a_file_with_too_many_runs_is_refused_and_the_others_go_on(
    contributed: Path, command: Command, call: list[str]
) -> None:
    scenario(contributed, stop=0.1)
    distribution(contributed, "varied", {"Gap": (20, 70, 10)})
    files = ["varied.xosc", "scenario.xosc", "--world", "kinematic"]
    answer = command(*call, *files, "--max-runs", "5")
    assert answer.code == 4
    assert "this file stands for 6 runs, --max-runs allows 5" in answer.err
    assert "scenario" in answer.out
    assert (
        command(
            *call, *files, "--max-runs", "6", "--out", "two" if "--out" in call else "three"
        ).code
        == 0
    )


def test_limits_of_untrusted_can_be_changed(
    contributed: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[CommandPolicy] = []
    monkeypatch.setattr(
        "xosc.listing.listing",
        lambda *_: seen.append(current()) or (_ for _ in ()).throw(UsageError("seen")),
    )
    for more in ([], ["--max-seconds", "7"], ["--untrusted"], ["--untrusted", "--max-memory", "1"]):
        command("xosc-list", ".", *more)
    assert [(each.untrusted, each.max_memory, each.max_seconds) for each in seen] == [
        (False, None, None), (False, None, 7.0), (True, 4.0, 300.0), (True, 1.0, 300.0),
    ]  # fmt: skip
    assert current() == CommandPolicy()


def test_folders_of_our_own_may_be_read(contributed: Path) -> None:
    with in_force(CommandPolicy(named=(contributed,), untrusted=True)):
        with scratch("xosc-test-") as folder:
            (folder / "between.xml").write_bytes(b"<net/>")
            assert read_bytes(folder / "between.xml") == b"<net/>"
            kept = folder
        with pytest.raises(InvalidFile, match="lies outside"):
            current().admit(kept / "between.xml")


def test_a_first_run_builds_its_network(
    contributed: Path, command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / "empty"))
    road = contributed / "first.xodr"
    road.write_bytes((ROADS / "straight.xodr").read_bytes())
    answer = command("xosc-road", "drive", road, "--untrusted")
    assert (answer.code, "lies outside" in answer.err) == (0, False), answer.err
