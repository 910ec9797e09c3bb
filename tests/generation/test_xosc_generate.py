"""The command `xosc-generate`."""

from __future__ import annotations

import csv
import json
import re
import shutil
import sys
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType, FrameType

import numpy as np
import pytest

import schemas
from generation.search.outcomes import Repeats, Run
from generation.space import SpaceChoice
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from generation.xosc_generate import main
from runner.systems import Control, Observation, Participant
from schemas.common.storage import alone

CUT_IN = str(SCENARIOS / "cut_in_highway.xosc")
MOST_VISITED = 22
"""Files of the package on the way of a search from its command to its files"""
PACKAGE = Path(main.__code__.co_filename).parent
QUICK = ("--method", "draws", "--budget", "15", "--density", "gaussian", "--jobs", "1")


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """The exit code of the command."""
    monkeypatch.setattr("sys.argv", ["xosc-generate", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


class Visits:
    """Files of the package in which a function runs, but for what importing them runs."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self._known: dict[int, CodeType] = {}  # by identity: codes are slow to hash

    def __call__(self, frame: FrameType, _event: str, _argument: object) -> None:
        """A function is called."""
        code = frame.f_code
        if id(code) not in self._known:
            ours = code.co_flags & CO_OPTIMIZED and code.co_filename.startswith(f"{PACKAGE}/")
            if not ours or not _imports(frame):
                self._known[id(code)] = code
            if ours and id(code) in self._known:
                self.files.add(code.co_filename.removeprefix(f"{PACKAGE}/"))


def _imports(frame: FrameType | None) -> bool:
    """Whether a module is being imported."""
    while frame is not None and frame.f_code.co_name != "_find_and_load":
        frame = frame.f_back
    return frame is not None


@pytest.mark.slow
def test_a_search_without_time_claims_nothing_of_what_it_did_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--density", "uniform", "--budget", 10, "--minutes", 0.0001, "--timestep", 0.1)
    call(monkeypatch, CUT_IN, "--out", tmp_path / "out", *options, "--jobs", 1)
    told = capsys.readouterr().out
    assert "no sought runs" in told and "the time was over before" in told
    assert "nothing that is foreseeable and preventable fails" not in told


def test_draws_of_the_density_are_a_table_without_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table for a simulator of the user's own."""
    monkeypatch.setattr("generation.search.outcomes.Evaluator.__call__", None)
    pins = ("--pin", "Ego_Speed_mps=33", "--out", tmp_path)
    assert call(monkeypatch, CUT_IN, *pins, "--draw", 30, "--seed", 4) == 0
    told, path = capsys.readouterr().out, tmp_path / "cut_in_highway_draws.csv"
    assert "30 draws of the density mixture of 3,565 recorded manoeuvres, seed 4" in told
    assert "which no run has tested" in told and [*tmp_path.iterdir()] == [path]
    rows = [*csv.DictReader(path.open(newline=""))]
    assert {row["Ego_Speed_mps"] for row in rows} == {"33"}
    space = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "33"}))
    assert rows[0].keys() == {*space.pinned, *space.names, "log_density"}
    theta = np.array([[float(row[name]) for name in space.names] for row in rows])
    assert ((space.low <= theta) & (theta <= space.high)).all()
    prior = of_samples(of_recordings(None, "cut_in"), space).prior(space, "mixture")
    stated = np.array([float(row["log_density"]) for row in rows])
    np.testing.assert_allclose(prior.log_density(theta), stated, atol=1e-3)
    before = path.read_bytes()
    assert call(monkeypatch, CUT_IN, *pins, "--draw", 30) == 2
    assert "--overwrite replaces it" in capsys.readouterr().err and path.read_bytes() == before
    assert call(monkeypatch, CUT_IN, *pins, "--draw", 30, "--seed", 4, "--overwrite") == 0
    assert path.read_bytes() == before, "the seed decides"
    assert call(monkeypatch, CUT_IN, *pins, "--draw", 3, "--estimate") == 2
    assert "--draw runs nothing" in capsys.readouterr().err


@pytest.fixture(scope="module")
def old(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a search leaves."""
    folder = tmp_path_factory.mktemp("searched") / "old"
    with pytest.MonkeyPatch.context() as monkeypatch:
        assert call(monkeypatch, CUT_IN, "--out", folder, *QUICK, "--violations", "-q") == 0
    return folder


@pytest.mark.slow
def test_a_scenario_becomes_edge_cases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pinned = ("--pin", "Ego_Speed_mps=36", "--most", 3, "--violations", "--concrete")
    assert call(monkeypatch, CUT_IN, "--out", tmp_path / "out", *QUICK, *pinned) == 0
    told = capsys.readouterr().out
    assert "draws against cas, seed 0, with Ego_Speed_mps=36" in told
    assert "7 unguided draws of the density: " in told and "8 sought runs: " in told
    assert "with 95 % confidence failures that were not found have a probability below 0.35" in told
    numbers = json.loads((tmp_path / "out" / "cut_in_highway_search.json").read_text())
    assert (numbers["draws"]["runs"], numbers["sought"]["runs"], numbers["plays"]) == (
        7,
        8,
        0,
    )
    assert numbers["statement"]["unknown_below"] == pytest.approx(1.0 - 0.05 ** (1.0 / 7))
    files = sorted(path.name for path in (tmp_path / "out").glob("*.xosc"))
    assert files[0] == "cut_in_highway.xosc"
    assert {
        "cut_in_highway_edge_cases.xosc",
        "cut_in_highway_density.xosc",
        "cut_in_highway_edge_case_000002.xosc",
    } <= set(files)
    assert not any(schemas.check(path) for path in (tmp_path / "out").rglob("*.xosc"))


@pytest.mark.slow
def test_a_search_that_finds_nothing_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    idle = ("--sut", "none", "--world", "kinematic", "--domain", "Ego_Speed_mps=0..5")
    assert call(monkeypatch, CUT_IN, "--out", tmp_path / "out", *QUICK, *idle, "--budget", 40) == 1
    assert re.search(r"0 edge cases: collisions: [1-9]\d*, foreseeable: 0", capsys.readouterr().out)
    far = ("--pin", "CutIn_Gap_m=100", "--pin", "Ego_Speed_mps=20")
    assert call(monkeypatch, CUT_IN, "--out", tmp_path / "one", *QUICK, *far, "--budget", 1) == 1
    assert (
        "0 edge cases: no sought run collides; the least distance of the ego to another one is "
        in capsys.readouterr().out
    )


def test_a_wrong_method_is_named_before_a_folder_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, CUT_IN, "--method", "magic") == 2
    assert "no search method 'magic'; methods: cover" in capsys.readouterr().err


def test_ranges_are_refused_for_a_catalogue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cut_in").mkdir()
    shutil.copy(CUT_IN, tmp_path / "cut_in" / "one.xosc")
    asked = ("--free", "CutIn_Gap_m=5..40", "--out", tmp_path / "out")
    assert call(monkeypatch, tmp_path, *asked) == 2
    told = capsys.readouterr().err
    assert "--free CutIn_Gap_m=LOW..HIGH is for single scenarios" in told


@pytest.mark.slow
def test_two_searches_do_not_write_into_one_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with alone(tmp_path, "a search"):
        assert call(monkeypatch, CUT_IN, "--out", tmp_path, *QUICK) == 2
    assert "a search of another process writes into this folder" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.jsonl"))


@pytest.mark.slow
def test_an_edited_file_is_in_the_way_unless_it_may_be_replaced(
    old: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "again"
    shutil.copytree(old, folder)
    edited = folder / "cut_in_highway.xosc"
    content = edited.read_bytes()
    edited.write_bytes(content + b"<!-- mine -->")
    search = (CUT_IN, "--out", folder, *QUICK, "--violations", "-q")
    assert call(monkeypatch, *search) == 2
    assert (
        "cut_in_highway.xosc: another file is in the way; --overwrite replaces it"
        in capsys.readouterr().err
    )
    assert call(monkeypatch, *search, "--overwrite") == 0
    assert edited.read_bytes() == content


def test_a_scenario_of_no_known_kind_says_what_could_be_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, SCENARIOS / "r157_cut_in.xosc", "--out", tmp_path, *QUICK) == 2
    said = capsys.readouterr().err
    assert "--free Ego_Speed_kmh=LOW..HIGH (it declares Ego_Speed_kmh = " in said
    assert "--kind" in said


@pytest.mark.slow
def test_a_version_of_which_no_run_succeeds_does_not_pass(
    old: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = ("--sut", f"{Broken.__module__}:{Broken.__name__}")
    against = ("--against", old, "--fail-if", "new")
    assert call(monkeypatch, CUT_IN, "--out", tmp_path / "new", *QUICK, *broken, *against) == 5
    out = capsys.readouterr().out
    assert ", 0 new" in out, out
    page = (tmp_path / "new" / "report.html").read_text(encoding="utf-8")
    assert "failed and count for nothing, the first with: the system under test" in page


class Broken:
    """A system under test with a defect."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        raise AttributeError("no such thing")

    def control(self, observation: Observation, dt: float) -> Control:
        return Control()


@pytest.fixture(scope="module")
def again(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Visits]:
    """What the same search leaves, and the files of the package that it visits."""
    folder, visits = tmp_path_factory.mktemp("searched") / "again", Visits()
    with pytest.MonkeyPatch.context() as monkeypatch:
        before = sys.gettrace()
        sys.settrace(visits)
        try:
            assert call(monkeypatch, CUT_IN, "--out", folder, *QUICK, "--violations", "-q") == 0
        finally:
            sys.settrace(before)
    return folder, visits


@pytest.mark.slow
def test_the_same_call_gives_the_same_bytes(old: Path, again: tuple[Path, Visits]) -> None:
    one, other = (
        {
            path.relative_to(folder): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        for folder in (old, again[0])
    )
    assert one == other


@pytest.mark.slow
def test_a_search_is_read_in_few_files(again: tuple[Path, Visits]) -> None:
    assert {"xosc_generate.py", "pipeline.py", "search/plays.py", "report/report.py"} < again[
        1
    ].files
    assert len(again[1].files) <= MOST_VISITED, sorted(again[1].files)


@pytest.mark.parametrize(
    ("arguments", "code", "reason"),
    [
        (("nothing.xosc",), 3, "no such file"),
        ((CUT_IN, "--method", "magic"), 2, "methods: cover"),
        ((str(SCENARIOS / "r157_cut_in.xosc"), "--method", "magic"), 2, "methods: cover"),
        (
            (str(SCENARIOS / "r157_cut_in.xosc"), "--map", "Speed=ego_speed"),
            2,
            "there is no parameter 'Speed'",
        ),
        ((CUT_IN, "--fail-if", "new"), 2, "--against says where"),
        (
            (CUT_IN, "--against", str(SCENARIOS), "--fail-if", "old"),
            2,
            "with --against also new or",
        ),
        ((CUT_IN, "--fail-if", "min_ttc<0"), 2, "no run can reach"),
        ((CUT_IN, "--against", str(SCENARIOS)), 2, "no search of cut_in_highway.xosc"),
        ((CUT_IN, "--kind", "parking"), 2, "kinds: braking"),
        ((CUT_IN, "--pin", "Ego_Speed"), 2, "--pin 'Ego_Speed': NAME=VALUE"),
        ((CUT_IN, "--free", "CutIn_Jerk"), 2, "no parameter"),
        ((CUT_IN, "--sut", "nobody", *QUICK), 2, "nobody"),
        ((CUT_IN, "--world", "moon", *QUICK), 2, "sumo, kinematic"),
        ((str(SCENARIOS / "r157_cut_in.xosc"),), 2, "--kind"),
        (
            (str(SCENARIOS / "cut_in_highway_variation.xosc"),),
            2,
            "search cut_in_highway.xosc itself",
        ),
        ((str(SCENARIOS), "--kind", "cut_in"), 2, "for single scenarios"),
        ((str(Path(__file__).parent),), 2, "no scenario with parameters to search"),
        ((CUT_IN, "--method", "no-maneuver"), 2, "methods: cover, draws, mcsg, mcsg-published"),
    ],
)
def test_wrong_use_is_one_line_and_an_exit_code(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    code: int,
    reason: str,
) -> None:
    assert call(monkeypatch, *arguments, "--out", tmp_path / "out") == code
    said = capsys.readouterr().err
    assert reason in said
    assert "Traceback" not in said
    assert not list(tmp_path.rglob("*.xosc"))


def test_a_failure_that_never_comes_again_is_no_finding_to_rely_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    repeated = Repeats.of

    def passing(count: int, run: Run, seed: int, number: int) -> Repeats:
        return repeated(
            count, lambda _: (np.ones(count, bool), np.zeros(count, bool)), seed, number
        )

    monkeypatch.setattr(Repeats, "of", passing)
    drawn = ("--method", "draws", "--density", "uniform", "--budget", 16, "--timestep", 0.1)
    told = ("--world", "kinematic", "--jobs", 1, "--quiet")
    assert call(monkeypatch, CUT_IN, "--out", tmp_path / "out", *drawn, *told) == 6
    assert "did not fail again" in capsys.readouterr().err
