"""Shell and Python of all manuals run, page by page, each in a folder of its own
with a small library.

The README, tutorials, roads and pages on extending are played by `test_commands`. A command is run
as it stands; what a page takes for granted is made before (`BEFORE`). What is not run is listed
line by line, with the reason, in `NOT_RUN`.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from tests.commands import SCRIPTS
from tests.docs import test_commands
from tests.docs.test_commands import ROOT, bare, blocks, call, interrupted

GENERATED = {"coverage.md", "publication.md"}
PAGES = [
    page
    for page in [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md"]
    if page.name not in GENERATED and page != test_commands.ROADS
]
SHELL = ("sh", "")
PROGRAMS = (
    *SCRIPTS,
    "python",
    "make",
    "pip",
    "export",
    ".venv/bin/python",
    ".venv/bin/ruff",
    ".venv/bin/mypy",
)
"""First words of commands; blocks without a language have what they print too"""
FILES = ("simple_cut_in", "simple_cut_in_variation", "highway_lead_brake")
"""Scenarios of the small library"""
SYSTEM = r"""from runner.systems import Control
class Mine:
    def reset(self, ego, timestep, seed): pass
    def control(self, observation, dt): return Control()
    def close(self): pass
"""
BEFORE = {
    "batches": [
        "xosc-run simple_cut_in -p CutIn_Gap_m=12 --world kinematic --out results",
        "xosc-run simple_cut_in -p CutIn_Gap_m=12 --world kinematic --out older",
    ],
    "ci": [
        "rm -r xosc xodr",
        "xosc new scenario mine --like simple_cut_in",
        f"printf '{SYSTEM}' | tee before.py > after.py",
    ],
    "osi": ["xosc-run simple_cut_in --osi trace.mcap --quiet"],
    "replay": ["xosc-run xosc/library/simple_cut_in.xosc --out results_before"],
    "labels": ["xosc-run simple_cut_in --out recordings", "mkdir roads"],
}
"""What a page takes for granted"""
MINUTES, FOREIGN, OWN = (
    "takes minutes",
    "needs a foreign data set",
    "stands for files of the reader",
)
CI = "is what continuous integration and developers run"
NOT_RUN = {
    "python -m benchmarks.qc_checkers qc-opendrive/tests/data": FOREIGN,
    "python -m benchmarks.qc_checkers qc-openscenarioxml/tests/data": FOREIGN,
    "export XOSC_BRIDGE_TOKEN=$(openssl rand -hex 16)": ("two terminals: "
                                                        "tests/runner/systems/outside/test_bridge.py"),
    ("xosc-run --sut bridge:port=48100 "
    "xosc/library/highway_lead_brake.xosc"): "two terminals, likewise",
    "python docs/examples/bridge_client.py 48100": "two terminals, likewise",
    "xosc-generate xosc/library/squeezed_highway.xosc --out found": MINUTES,
    ("python -m studies.generation pairs "
    "xosc/library/cut_in_before_braking_leader_highway.xosc --both"): MINUTES,
    "python -m studies.generation planted": MINUTES,
    "python -m studies.generation limits": MINUTES,
    "xosc-generate xosc/library/cut_in_highway.xosc --sut cas --out edge_cases": MINUTES,
    "xosc-generate catalogue --sut aeb --out edge_cases": MINUTES,
    "xosc-generate SCENARIO --recorded RECORDINGS --kind cut_in --free Ego_Speed_mps ...": OWN,
    "xosc-run edge_cases/cut_in_highway_edge_cases.xosc": "the tutorial on edge cases runs it",
    "xosc-generate alks_4_4_1_cut_in_variation.xosc --out found": FOREIGN,
    "xosc-generate CutIn.xosc --free 152@value=20..40 --free 182@value=20..80 --out found": OWN,
    ("xosc-generate mine.xosc --kind braking --map Ego_speed_kph=ego_speed*3.6 --free "
    "Ego_speed_kph=20..120 --out found"): OWN,
    ("xosc-generate cut_in_highway.xosc --out found_2 --sut mine:brake=9 "
    "--estimate --against found_1"): OWN,
    ("xosc-generate xosc/library/braking_leader_highway.xosc --recorded units.parquet --free "
    "Lead_Jerk_mps3 --out found"): OWN,
    "xosc-loop FOLDER --out DIR --sut cas": OWN,
    "xosc-loop FOLDER --out loop_2 --sut mine:brake=9 --against loop_1": OWN,
    "xosc-run xosc/library/simple_cut_in.xosc --gui": "needs a display",
    'pip install "xosc-toolchain[fmi]"': "needs a package index",
    "xosc-run --sut fmu:ego.fmu xosc/library/highway_lead_brake.xosc": ("an FMU of the reader: "
                                                                       "tests/runner/systems/outside/test_fmu.py"),
    "make install": CI,
    "make lint types test test-slow test-studies": CI,
    ".venv/bin/python -m pytest -n 0 -m 'not slow' tests/xodr/graph": CI,
    ".venv/bin/ruff check --fix . && .venv/bin/ruff format .": CI,
    ".venv/bin/mypy": CI,
    (".venv/bin/python -m pytest -n 0 tests/test_architecture.py tests/test_rooms.py "
    "tests/test_messages.py"): CI,
    "make docs": CI,
}  # fmt: skip
"""Beginnings of commands that are not run, and why"""


def commands(page: Path) -> list[str]:
    """The command lines of a page."""
    lines = [
        line
        for block in blocks(page)
        if block.language in SHELL
        for line in block.text.splitlines()
    ]
    return [line for line in lines if line.split(" ")[0] in PROGRAMS]


def is_run(line: str) -> bool:
    return not any(bare(line).startswith(beginning) for beginning in NOT_RUN)


def programs(page: Path) -> list[str]:
    """The Python of a page."""
    return [block.text for block in blocks(page) if block.language == "python"]


RUN = [page for page in PAGES if programs(page) or any(map(is_run, commands(page)))]


def test_what_is_not_run_is_on_a_page() -> None:
    lines = [bare(line) for page in PAGES for line in commands(page)]
    assert [each for each in NOT_RUN if not any(line.startswith(each) for line in lines)] == []
    assert BEFORE.keys() <= {page.stem for page in RUN}


def test_files_that_reasons_name_are_there() -> None:
    named = {path for reason in NOT_RUN.values() for path in re.findall(r"tests/\S+\.py", reason)}
    assert [path for path in named if not (ROOT / path).is_file()] == []


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = tmp_path / "xosc" / "library"
    shutil.copytree(ROOT / "xodr" / "library", tmp_path / "xodr" / "library")
    shutil.copytree(ROOT / "xosc" / "library" / "catalogs", library / "catalogs")
    for name in FILES:
        shutil.copy(ROOT / "xosc" / "library" / f"{name}.xosc", library)
    monkeypatch.chdir(tmp_path)
    for line in [*BEFORE.get(page.stem, []), *commands(page)]:
        if not is_run(line):
            continue
        if " explore " in line:
            code, printed = interrupted(bare(line))
        else:
            code, printed = call(["bash", "-c", bare(line)], tmp_path, {"PYTHONPATH": str(ROOT)})
        verdict = line.startswith("xosc-run ")
        assert code == 0 or (verdict and code == 1), f"{line}: {printed}"
    for program in programs(page):
        exec(compile(program, page.name, "exec"), {"__name__": "__main__"})
