"""No file of the working folder becomes code unless the user names its class; entry points are
those of installed packages.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
import typer

from generation.space.logical.library import SCENARIOS
from runner.batch.pool import connect
from runner.systems import find_system
from schemas.common.errors import UsageError
from schemas.common.packages import _EXTRAS, leave_working_folder_out
from schemas.common.plugins import installed
from tests.commands import SCRIPTS as COMMANDS
from tests.commands import Command
from tests.runner.files import distribution, scenario

SCRIPTS = Path(sys.executable).parent
NAMES = sorted(
    {
        *_EXTRAS,
        "IPython",
        "pandas",
        "mcap",
        "cupy",
        "numexpr",
        "bottleneck",
        "psutil",
        "yaml",
        "tqdm",
        "defusedxml",
        "cycler_ext",
    }
    | {
        "sitecustomize",
        "usercustomize",
        "multiprocessing",
        "pickle",
        "json",
        "lxml",
        "typer",
        "rich",
        "numpy",
        "pyarrow",
    }
    | {
        "schemas",
        "xosc",
        "xodr",
        "runner",
        "recognition",
        "generation",
        "ray_setproctitle",
        "setproctitle",
        "colorama",
        "sut",
    }
)
"""Libraries that something tries to import, ours or theirs, installed or not"""

SYSTEM = """
from runner.systems import Control
import beside  # a neighbour, with it

class Mine:
    def reset(self, ego, timestep, seed):
        pass

    def control(self, observation, dt):
        from later import ACCELERATION  # a neighbour that is imported when the run is on
        from parts.inner import more  # a package's module, which imports its own
        return Control(ACCELERATION * more())
"""


@pytest.fixture
def trapped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder full of files that leave a mark if they are executed."""
    mark = f"open({str(tmp_path / 'executed')!r}, 'a').write(__name__ + '\\n')\n"
    folder = tmp_path / "contributed"
    folder.mkdir()
    for name in NAMES:
        (folder / f"{name}.py").write_text(mark)
    for package in ("osi3", "google"):
        (folder / package).mkdir()
        (folder / package / "__init__.py").write_text(mark)
    metadata = folder / "innocent-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: innocent\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[xosc.sut]\ninnocent = sut:System\n[xosc.distribution]\ntricky = sut:System\n"
    )
    (folder / "matplotlibrc").write_text("backend: module://sut\ntext.usetex: True\n")
    scenario(folder, stop=0.2)
    monkeypatch.chdir(folder)
    return folder


def executed(folder: Path) -> list[str]:
    path = folder.parent / "executed"
    return sorted(set(path.read_text().split())) if path.exists() else []


def started(*call: str, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
    } | variables
    program = (
        [str(SCRIPTS / call[0]), *call[1:]]
        if call[0].startswith("xosc")
        else [sys.executable, *call]
    )
    return subprocess.run(program, capture_output=True, text=True, env=environment, timeout=120)


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        ["xosc-run", "scenario.xosc", "--jobs", "2", "--out", "out", "--replay", "--plot"],
        ["xosc-run", "scenario.xosc", "--osi", "trace.osi", "--gui"],
        ["xosc-run", "scenario.xosc", "--dry-run"],
        ["xosc-check", "."],
        ["xosc-list", "."],
        ["xosc-export", "scenario.xosc", "--to", "1.0", "--out", "out"],
        ["xosc-recognize", ".", "--out", "out"],
        ["-P", "-m", "runner.xosc_run", "scenario.xosc", "--dry-run"],
    ],
    ids=" ".join,
)
def test_no_command_executes_files_of_the_working_folder(trapped: Path, call: list[str]) -> None:
    answer = started(*call)
    assert executed(trapped) == [], answer.stderr


def test_processes_that_are_started_anew_do_not_either(trapped: Path) -> None:
    """Of `xosc-loop`: multiprocessing starts them by `python -c`, which has the
    working folder on its path.
    """
    program = trapped.parent / "program.py"
    program.write_text(
        "from schemas.common.packages import leave_working_folder_out\n"
        "from runner.batch.pool import executor\n"
        "if __name__ == '__main__':\n"
        "    leave_working_folder_out()\n"
        "    with executor(1, anew=True) as pool:\n"
        "        print(pool.submit(abs, -3).result())\n"
    )
    answer = started(str(program))
    assert (answer.stdout, executed(trapped)) == ("3\n", []), answer.stderr
    program.write_text(program.read_text().replace("    leave_working_folder_out()\n", ""))
    started(str(program))
    assert executed(trapped), "the trap works"


def test_workers_of_a_ray_cluster_do_not_either(
    trapped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ray puts the folder that it is started in first on the path of its workers."""
    ray = pytest.importorskip("ray", reason="Ray is not installed (extra: ray)")
    places = []
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", lambda **_: places.append(Path.cwd()))
    connect("local", 1)
    assert places == [Path(sys.prefix)]
    assert Path.cwd() == trapped


def test_python_m_leaves_the_folder_out_once_the_command_begins(
    trapped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, Python itself imports from there: docs/security.md says to type
    the command, or `python -P -m`.
    """
    for first in ("", str(trapped), "."):
        monkeypatch.setattr(sys, "path", [first, *sys.path])
        leave_working_folder_out()
        assert sys.path[0] != first
    kept = [sys.path[0], str(trapped), *sys.path[1:]]
    monkeypatch.setattr(sys, "path", list(kept))
    leave_working_folder_out()
    assert sys.path == kept, "a source tree that is installed (pip install -e) stays"


# entry points ---------------------------------------------------------------------------------


@pytest.mark.parametrize("entry", ["", ".", "{folder}", "{folder}/src"])
def test_entry_points_of_the_working_folder_are_none(
    trapped: Path, monkeypatch: pytest.MonkeyPatch, entry: str
) -> None:
    (trapped / "src").mkdir()
    (trapped / "innocent-1.0.dist-info").rename(
        trapped / entry.format(folder=trapped) / "innocent-1.0.dist-info"
    )
    monkeypatch.setattr(sys, "path", [entry.format(folder=trapped), *sys.path])
    assert "innocent" not in installed("xosc.sut")
    assert "tricky" not in installed("xosc.distribution")
    (trapped.parent / "elsewhere").mkdir()
    monkeypatch.chdir(trapped.parent / "elsewhere")
    if entry.startswith("{"):
        assert "innocent" in installed("xosc.sut"), (
            "elsewhere a folder of the path may hold packages (pip install --target)"
        )


def test_packages_of_an_environment_in_the_working_folder_are_installed(
    trapped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = trapped / ".venv" / "site-packages"
    packages.mkdir(parents=True)
    (trapped / "innocent-1.0.dist-info").rename(packages / "innocent-1.0.dist-info")
    monkeypatch.setattr(sys, "path", [*sys.path, str(packages)])
    monkeypatch.setattr("site.getsitepackages", lambda: [str(packages)])
    assert installed("xosc.sut")["innocent"].value == "sut:System"


def test_a_scenario_names_no_code(trapped: Path, command: Command) -> None:
    """A controller's module, a user-defined action and a user-defined
    distribution: their names are of files beside it.
    """
    path = trapped / "scenario.xosc"
    text = path.read_text()
    controller = (
        '<ObjectController><Controller name="sut:System"><Properties><Property name="module" '
        'value="sut"/>'
        '<Property name="class" '
        'value="sut:System"/></Properties></Controller></ObjectController></ScenarioObject>'
    )
    path.write_text(text.replace("</ScenarioObject>", controller, 1))
    answer = command("xosc-run", path, "--world", "kinematic")
    assert (answer.code, executed(trapped)) == (0, []), answer.out
    varied = distribution(trapped, "varied", {"Gap": (20, 30, 10)})
    content = varied.read_text()
    start, end = (
        content.index("<DistributionRange"),
        content.index("</DeterministicSingleParameterDistribution>"),
    )
    varied.write_text(
        content[:start]
        + '<UserDefinedDistribution type="tricky">sut:System</UserDefinedDistribution>'
        + content[end:]
    )
    answer = command("xosc-run", varied, "--world", "kinematic")
    assert (answer.code, executed(trapped)) == (4, []), answer.out
    assert "no plug-in for the user-defined distribution type 'tricky'" in answer.err


# classes that the user names ----------------------------------------------------------------------


@pytest.fixture
def own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[str]:
    """A system under test in the working folder, under a name of its own, with
    neighbours; and a trap.
    """
    name = f"own_{abs(hash(request.node.name))}"
    files = {
        name: SYSTEM,
        "beside": "LOADED = True",
        "later": "ACCELERATION = 0.5",
        "parts/__init__": "",
    }
    files |= {
        "parts/inner": "def more():\n    from . import factor\n    return factor.FACTOR",
        "parts/factor": "FACTOR = 1.0",
    }
    for module, text in files.items():
        path = tmp_path / f"{module}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    (tmp_path / "gym_of_nobody.py").write_text("raise SystemExit('imported')")
    (tmp_path / "files").mkdir()
    monkeypatch.chdir(tmp_path)
    yield f"{name}:Mine"
    for module in ("beside", "later", "parts", "parts.inner", "parts.factor"):
        sys.modules.pop(module, None)


CALLS = {
    "run": ("xosc-run", "scenario.xosc", "--world", "kinematic"),
    "run in processes": ("xosc-run", "scenario.xosc", "--world", "kinematic", "--jobs", "2"),
    "dry run": ("xosc-run", "scenario.xosc", "--dry-run"),
    "export of a run": ("xosc-export", "scenario.xosc", "--to", "parquet", "--out", "out",
        "--world", "kinematic"),
    "generate": (
        "xosc-generate", str(SCENARIOS / "cut_in_highway.xosc"), "--out", "out", "--method",
        "draws", "--budget", "1",
        "--density", "gaussian", "--jobs", "1", "--pin", "CutIn_Gap_m=100",
    ),
    "loop": ("xosc-loop", "files", "--out", "out", "--labels", "rules", "--budget", "1", "--rounds",
        "1", "--jobs", "1",
             "--method", "draws"),
}  # fmt: skip
"""All commands that take --sut"""


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_a_class_of_the_working_folder_is_found_by_all_commands_alike(
    own: str, command: Command, call: str
) -> None:
    scenario(Path(), stop=0.2)
    scenario(Path("files"), stop=0.2)
    answer = command(*CALLS[call], "--sut", own)
    assert "can't be imported" not in answer.out + answer.err
    assert answer.code in (0, 1), answer.out + answer.err  # a search of one run finds nothing
    assert str(Path.cwd()) not in sys.path and "" not in sys.path


def test_no_command_that_takes_a_system_is_left_out() -> None:
    taking = {name for name, home in COMMANDS.items() if "sut" in parameters(home)}
    served = {"xosc-explore"}  # it runs until it is ended: tests/xosc_toolchain/test_explore.py
    assert taking - served == {name for name, *_ in CALLS.values()}


def parameters(module: str) -> set[str]:
    built = typer.main.get_command(import_module(module).app)
    return {param.name or "" for param in built.params}


@pytest.mark.parametrize("call", CALLS)
def test_one_that_is_not_there_is_refused_by_all_commands_alike(
    own: str, command: Command, call: str
) -> None:
    scenario(Path(), stop=0.2)
    answer = command(*CALLS[call], "--sut", "nowhere_at_all:Mine")
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert "the system under test 'nowhere_at_all:Mine' can't be imported" in answer.err


def test_what_others_import_is_not_found_there(own: str) -> None:
    find_system(own)
    with pytest.raises(ModuleNotFoundError):
        import gym_of_nobody  # noqa: F401
    with pytest.raises(ModuleNotFoundError):
        exec("import gym_of_nobody", {"__name__": "pandas"})
    assert not any(
        hasattr(finder, "find_distributions")
        for finder in sys.meta_path
        if "WorkingFolder" in type(finder).__name__
    )


def test_an_error_in_it_is_told_with_its_line(own: str) -> None:
    Path("broken.py").write_text("x = 1\ny = (\n")
    with pytest.raises(UsageError, match=r"broken.py:2"):
        find_system("broken:Mine")
    Path("raising.py").write_text("x = 1\nraise ValueError('no licence')\n")
    with pytest.raises(UsageError, match=r"ValueError: no licence \(.*raising.py:2"):
        find_system("raising:Mine")
