"""Two loops over one folder, of two versions of a system: what became of the
failures of the first.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from urllib.parse import unquote

import pytest

from generation.loop.findings import (
    Against,
    Checked,
    Compared,
    KnownFailure,
    LoopResult,
    Ran,
    Recognised,
    closing,
)
from generation.loop.loop import run_loop
from generation.loop.page import PAGE, write
from generation.loop.xosc_loop import app
from generation.report.regression import Fate
from generation.search.settings import Ask, LoopSettings
from generation.space.logical.library import SCENARIOS
from runner.judging.settings import RunSettings
from runner.systems import Control, Observation, Participant
from schemas.common.errors import UsageError
from schemas.common.terminal.command_line import progress_bar
from tests.runner.chromium import Browser
from xosc.exports import standard
from xosc.exports.draft import Folder

BAR = partial(progress_bar, quiet=True)
pytestmark = pytest.mark.slow  # five whole loops
WEAK, STRONG = "cas:brake=2", "cas:sensor_range=150"
NAMES = "cut_in_highway", "cut_out_highway"


def looped(
    folder: Path, out: Path, sut: str, against: Path | None = None, seed: int = 0
) -> LoopResult:
    settings = LoopSettings(
        RunSettings(timestep=0.1, sut=sut, world="kinematic"), None, rounds=1, budget=30, most=3,
        shown=1, method="draws",
        processes=1, seed=seed, ask=Ask(density="gaussian"), against=against,
    )  # fmt: skip
    found = run_loop(folder, out, settings, BAR, lambda *_: None)
    write(found, out)
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mine")
    for name in NAMES:
        standard.export(SCENARIOS / f"{name}.xosc", "1.3", Folder(folder / name))
    return folder


@pytest.fixture(scope="module")
def old(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("old") / "loop_1"
    found = looped(folder, out, WEAK)
    assert any(
        case.verdict == "collision" for search in found.rounds[0].searches for case in search.cases
    )
    return out


def compared(folder: Path, of: Path, copy: Path, against: Path) -> Against:
    """A loop of the weak system, done before, held against another one."""
    shutil.copytree(of, copy)
    found = looped(folder, copy, WEAK, against).against
    assert found is not None
    return found


def test_the_same_version_has_all_failures_still(folder: Path, old: Path, tmp_path: Path) -> None:
    found = compared(folder, old, tmp_path / "again", old)
    assert (found.folder, found.sut) == ("loop_1", WEAK)
    assert {each.title for each in found.compared} == set(NAMES)
    assert found.counts[Fate.STILL_THERE] > 0
    assert found.counts[Fate.FIXED] == found.counts[Fate.NEW] == found.counts[Fate.UNKNOWN] == 0
    assert found.counts.fails(Fate.STILL_THERE) and not found.counts.fails(Fate.NEW)


def test_another_version_fixes_some_and_the_page_shows_which(
    folder: Path, old: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    out = tmp_path / "better"
    result = looped(folder, out, STRONG, old, seed=7)
    assert result.against is not None and result.against.counts[Fate.FIXED] > 0
    lines = list(closing(result))
    assert lines[1] == f"against {WEAK} in loop_1: {result.against.counts}"
    assert len(lines) == 2 + len(NAMES)
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        for width in (360, 1280):
            browser.open(out / PAGE, width=width)
            browser.run(
                "document.querySelectorAll('details').forEach(each => { each.open = true; })"
            )
            browser.settle()
            assert browser.run("document.documentElement.scrollWidth") <= width
        section = (
            "[...document.querySelectorAll('section')].find(each => "
            "each.querySelector('h2').textContent.startsWith('Against'))"
        )
        assert (
            browser.run(f"{section}.querySelector('h2').textContent") == f"Against {WEAK} (loop_1)"
        )
        shown = browser.run(
            f"[...{section}.querySelectorAll('tbody .badge')].map(each => each.textContent)"
        )
        assert sorted(shown) == sorted(
            str(each).replace("-", " ") for each in result.against.counts.elements()
        )
        for link in browser.run(
            f"[...{section}.querySelectorAll('a')].map(a => a.getAttribute('href').split('#')[0])"
        ):
            assert (out / unquote(link)).is_file()
        assert browser.errors == []


@pytest.fixture
def less(folder: Path, tmp_path: Path) -> Iterator[Path]:
    shutil.copytree(folder / NAMES[0], tmp_path / "less" / NAMES[0])
    yield tmp_path / "less"


def test_what_only_one_loop_searches_is_new_or_unknown(
    folder: Path, less: Path, old: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    found = {each.title: each for each in looped(less, out, WEAK, old).against.compared}  # type: ignore[union-attr]
    assert found[NAMES[1]].reason == "this loop does not search it"
    assert set(found[NAMES[1]].counts) <= {Fate.UNKNOWN}
    assert found[NAMES[1]].counts.fails(Fate.STILL_THERE) == bool(found[NAMES[1]].before), (
        "nothing good is assumed"
    )
    more = {each.title: each for each in compared(folder, old, tmp_path / "more", out).compared}
    assert not more[NAMES[1]].reason and not more[NAMES[1]].before
    assert more[NAMES[1]].counts[Fate.NEW] == len(more[NAMES[1]].new)


class Broken:
    """A system under test of which no run succeeds."""

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Nothing."""

    def control(self, observation: Observation, dt: float) -> Control:
        """It has no model."""
        raise RuntimeError("no model")


def test_a_version_of_which_no_run_succeeds_never_passes(
    less: Path, old: Path, tmp_path: Path
) -> None:
    broken = f"{__name__}:Broken"
    first = looped(less, tmp_path / "first", broken, old)
    second = looped(less, tmp_path / "second", broken, tmp_path / "first")
    for result, before in ((first, True), (second, False)):
        found = result.against
        assert found is not None
        (each,) = [each for each in found.compared if each.title == NAMES[0]]
        assert (
            each.blind
            and each.reason.startswith("no run succeeded: ")
            and "no model" in each.reason
        )
        assert set(each.counts) == ({Fate.UNKNOWN} if before else set())
        assert found.fails(Fate.NEW) and found.fails(Fate.STILL_THERE)
        assert f"  {NAMES[0]}: not known ({each.reason})" in closing(result)
        assert result.unsound
        assert {
            search.failures[search.title].split(",")[0] for search in result.rounds[0].searches
        } == {"no run succeeded"}
    found = looped(less, tmp_path / "mended", WEAK, tmp_path / "first").against
    assert found is not None and not any(each.blind for each in found.compared)
    assert (
        found.compared[0].reason
        == "no run of the earlier loop succeeded: what is new here may be older"
    )
    assert found.counts[Fate.UNLIKE] == len(found.compared[0].others) > 0, (
        "the former system can't be played"
    )


def test_a_folder_without_a_loop_is_refused_before_anything_is_done(
    folder: Path, old: Path, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="no loop is in this folder"):
        looped(folder, tmp_path / "out", WEAK, folder)
    assert not (tmp_path / "out").exists()
    with pytest.raises(UsageError, match="the output folder itself"):
        looped(folder, old, WEAK, old)


def test_exit_codes_say_whether_a_failure_counts(
    folder: Path, old: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from generation.loop import loop

    fates: list[Fate] = []
    blind = False

    def run(*_: object) -> LoopResult:
        known = [KnownFailure({}, each) for each in fates]
        against = Against(
            "loop_1", WEAK, [Compared(target="a", title="a", before=known, blind=blind)]
        )
        settings = json.loads((old / "loop.json").read_text())
        return LoopResult(
            settings, 0, Recognised(), [], [], Ran(), Ran(), Checked(files=1, problems=[]), against
        )

    monkeypatch.setattr(loop, "run_loop", run)
    (tmp_path / "out").mkdir()

    def code(*options: str) -> int:
        arguments = [
            str(folder),
            "--out",
            str(tmp_path / "out"),
            "--quiet",
            "--labels",
            "rules",
            *options,
        ]
        return int(app(arguments, standalone_mode=False) or 0)

    for each, options, expected in (
        (Fate.FIXED, (), 0),
        (Fate.STILL_THERE, (), 0),
        (Fate.STILL_THERE, ("--fail-if", "still-there"), 1),
        (Fate.STILL_THERE, ("--fail-if", "new", "--fail-if", "still-there"), 1),
        (Fate.UNKNOWN, ("--fail-if", "still-there"), 1),
        (Fate.NEW, ("--fail-if", "still-there"), 0),
    ):
        fates[:] = [each]
        assert code("--against", str(old), *options) == expected, (each, options)
    fates[:], blind = [], True
    for options in ((), ("--fail-if", "new"), ("--fail-if", "still-there")):
        assert code("--against", str(old), *options) == 1, "nothing is known of what failed"
    with pytest.raises(UsageError, match="--against says where these are"):
        code("--fail-if", "new")
    with pytest.raises(UsageError, match="with --against also new or still-there"):
        code("--against", str(old), "--fail-if", "old")
