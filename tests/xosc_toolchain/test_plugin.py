"""Packages that extend the toolchain: the template of each kind, installed in a
folder of its own, works by entry points.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import runner
from runner.engine.compile.element import EntityCondition
from runner.engine.compile.registry import condition
from runner.judging.criteria.criterion import CriterionKind, kinds
from runner.judging.measures.criticality import Criticality, criticality
from runner.judging.measures.measure import ALWAYS, RunMeasure
from schemas.common.errors import ExitCode, UsageError, describe
from schemas.common.plugins import installed, load
from tests.commands import Command
from tests.runner.judging.test_criticality import motion
from xosc_toolchain.plugin import KINDS, write_plugin
from xosc_toolchain.xosc import EXTENSIONS

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node

ROOT = Path(__file__).parents[2]
CUT_IN = str(ROOT / "xosc" / "library" / "simple_cut_in.xosc")


def declare(target: Path, name: str, groups: dict[str, dict[str, str]]) -> None:
    """Write the metadata of an installed package with entry points."""
    metadata = target / f"{name}-0.1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1.0\n")
    lines = [
        line
        for group, entries in groups.items()
        for line in (f"[{group}]", *(f"{entry} = {value}" for entry, value in entries.items()))
    ]
    (metadata / "entry_points.txt").write_text("\n".join([*lines, ""]))


def install(project: Path, target: Path) -> None:
    """Put a project's package and its metadata in a folder, as an installer does."""
    about = tomllib.loads((project / "pyproject.toml").read_text())["project"]
    for file in (project / about["name"]).rglob("*.py"):
        copy = target / file.relative_to(project)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(file.read_bytes())
    declare(target, about["name"], about["entry-points"])


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The template's package with all kinds."""
    folder = tmp_path_factory.mktemp("project")
    write_plugin("lab_kit", list(KINDS), folder)
    return folder / "lab_kit"


@pytest.fixture(scope="module")
def site(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on the path with the template's package installed."""
    target = tmp_path_factory.mktemp("site")
    install(project, target)
    return target


def call(site: Path | None, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command with a folder of installed packages on the path."""
    path = os.pathsep.join([*([str(site)] if site else []), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
    )


@pytest.mark.slow
def test_each_kind_works_by_its_name(project: Path, site: Path) -> None:
    """The tests of the template are those of an action, a condition, … of an installed package."""
    quiet = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist")
    done = call(site, project, "-m", "pytest", *quiet, "tests")
    assert done.returncode == 0, done.stdout
    assert "10 passed" in done.stdout


def test_commands_know_them_unless_files_are_untrusted(site: Path, tmp_path: Path) -> None:
    code = """
import sys
from runner.exchange.exports import target_lines, target_of
from runner.judging.measures.measure import measures
from runner.judging.criteria.criterion import kinds
from runner.engine.compile.registry import action
from runner.systems import load_system, systems
from recognition import recordings
from schemas.common.errors import ToolchainError
from schemas.common.policy import UNTRUSTED, in_force
open("lab_kit_yard.csv", "w").write("t,name,x,y,yaw\\n0,me,0,0,0\\n0.1,me,1,0,0\\n")
def known():
    action.load()
    yield "LabKitCoastAction" in action.classes
    yield "lab_kit_tet" in measures()
    yield "labkitcomforttest" in kinds()
    for ask in (
        lambda: target_of("lab_kit"),
        lambda: load_system("lab_kit"),
        lambda: recordings.open("lab_kit_yard.csv").sources,
    ):
        try:
            yield ask() is not None
        except ToolchainError as error:
            yield False
with in_force(UNTRUSTED):
    print([*known()], [name for name in sys.modules if name.startswith("lab_kit")])
print([*known()])
with in_force(UNTRUSTED):
    print("lab_kit_tet" in measures())
print(("lab_kit", "plug-in", "of lab_kit.export, installed by pip") in target_lines(), systems()["lab_kit"])
"""
    done = call(site, tmp_path, "-c", code)
    assert done.stdout.splitlines() == [
        f"{[False] * 6} []",
        f"{[True] * 6}",
        "False",
        "True of lab_kit.system, installed by pip",
    ], done.stderr


def test_a_check_names_the_plug_in_that_an_element_is_of(project: Path, site: Path) -> None:
    check = ("-m", "schemas.xosc_check", "tests/lane.xosc")
    told, untrusted = (call(site, project, *check, *more).stdout for more in ((), ("--untrusted",)))
    assert "LabKitLaneCondition is of the plug-in 'lab_kit' of xosc.condition" in told
    assert "no version of the standard has it" in told
    assert "did you mean" not in told
    assert "plug-in" not in untrusted
    assert "LabKitLaneCondition is not expected here" in untrusted


FAULTS = {
    "an error": (
        "xosc.measure",
        "raise RuntimeError('not today')",
        "can't be imported: RuntimeErr",
    ),
    "nothing measured": ("xosc.measure", "", "registers nothing"),
    "no action": ("xosc.action", "", "registers nothing"),
    "no export": ("xosc.export", "TARGETS = {'bad': ''}", "has no export"),
    "another target": ("xosc.export", "TARGETS = {}\nexport = print", "has no target of this name"),
    "no format": ("xosc.dataset", "TITLE = BY_CONTENT = claims = print", "has no sources"),
    "an action of ours": (
        "xosc.action",
        "from runner.engine.compile.registry import action\n"
        "@action('SpeedAction')\nclass Mine:\n    pass",
        "takes a name in use: the action SpeedAction is registered by runner.engine.actions.speed",
    ),
    "a measure of ours": (
        "xosc.measure",
        "from runner.judging.measures.kinds.encounter import MinTimeToCollision\n"
        "from runner.judging.measures.measure import measure\n"
        "measure(MinTimeToCollision)",
        "takes a name in use: the measure min_ttc is registered by",
    ),
    "a criterion of ours": (
        "xosc.criterion",
        "from runner.judging.criteria.criterion import criterion\n"
        "criterion('collisiontest', unit='1', summary='mine')(print)",
        "takes a name in use: the criterion collisiontest is registered by runner.judging.criteria",
    ),
}
ASK = {
    "xosc.action": "from runner.engine.compile.registry import action; action.load()",
    "xosc.measure": "from runner.judging.measures.measure import measures; measures()",
    "xosc.criterion": "from runner.judging.criteria.criterion import kinds; kinds()",
    "xosc.export": "from runner.exchange.exports import target_of; target_of('bad')",
    "xosc.dataset": "from recognition import recordings; recordings.open('.').sources",
    "xosc.sut": "from runner.systems import load_system; load_system('cas')",
}


def refusals(site: Path, folder: Path, programs: dict[str, str]) -> list[str]:
    """Do programs in one process, each with its own folder of the site on the path; the errors."""
    code = f"""
import sys
from schemas.common.errors import UsageError
for name, program in {programs!r}.items():
    sys.path.insert(0, {str(site)!r} + "/" + name)
    try:
        exec(program)
        print(name, "is not refused")
    except UsageError as error:
        print(error)
    del sys.path[0]
"""
    done = call(None, folder, "-c", code)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


TAKEN = {"xosc.sut": "cas", "xosc.export": "esmini", "xosc.dataset": "highd"}
"""A name of ours in each group whose kinds are chosen by name"""


def test_a_faulty_plug_in_is_refused_by_name(tmp_path: Path) -> None:
    site, work, programs, expected = tmp_path / "site", tmp_path / "work", {}, []
    for number, (name, (group, source, reason)) in enumerate(FAULTS.items()):
        package = f"bad{number}"
        declare(site / name, package, {group: {"bad": f"{package}.kinds"}})
        (site / name / package).mkdir()
        (site / name / package / "__init__.py").touch()
        (site / name / package / "kinds.py").write_text(source + "\n")
        programs[name] = ASK[group]
        told = f"the plug-in 'bad' of {group} ({package}.kinds, package {package})"
        expected.append(f"{told} {reason}")
    for group, name in TAKEN.items():
        declare(site / group, "rival", {group: {name: "rival:Any"}})
        programs[group] = ASK[group].replace("bad", name)
        told = f"the plug-in {name!r} of {group} (rival:Any, package rival)"
        expected.append(f"{told} takes a name of the toolchain's own")
    for package in ("one", "two"):
        declare(site / "twice", package, {"xosc.sut": {"mine": f"{package}:Any"}})
    programs["twice"] = ASK["xosc.sut"]
    told = "the plug-in 'mine' of xosc.sut ({0}:Any, package {0})"
    expected.append(f"{told.format('two')} takes the name of {told.format('one')}; uninstall one")
    work.mkdir()
    (work / "some.csv").write_text("a\n")
    for line, start in zip(refusals(site, work, programs), expected, strict=True):
        assert line.startswith(start)


def test_a_measure_of_the_ego_alone_is_defined_without_another_participant() -> None:
    class Alone(RunMeasure):
        """A measure of a package that needs nobody but the ego."""

        name, validity = "alone", ALWAYS

        def of(self, run: Criticality) -> float:
            return float(run.ego.speed.mean())

    class Near(Alone):
        """A measure of a package that needs another participant."""

        name, validity = "near", "another participant is there"

    found = criticality(motion("Ego", 0.0, 20.0), [])
    assert (Alone().result(found), Alone().defined(found), Near().defined(found)) == (20.0, 1, 0)


def test_a_measure_that_fails_is_told_by_its_name() -> None:
    class Odd(RunMeasure):
        """A measure of a package with a defect."""

        name = "odd"

        def of(self, run: object) -> float:
            raise KeyError("speed")

    with pytest.raises(UsageError, match=r"the measure odd \(.*test_plugin\) failed: KeyError"):
        Odd().result(None)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [("1 / 0", r"ZeroDivisionError: .* \(.*lab_criteria\.py:4\)"), ("None", "it returned None")],
)
def test_a_criterion_that_fails_is_told_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str, reason: str
) -> None:
    (tmp_path / "lab_criteria.py").write_text(
        "from runner.judging.criteria.criterion import criterion\n"
        "@criterion('OddTest', unit='1', summary='odd')\n"
        "def odd(drive):\n"
        f"    return {answer}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "lab_criteria", raising=False)
    kinds()
    with monkeypatch.context() as patch:
        patch.setattr("runner.judging.criteria.criterion._registered", {})
        load(EntryPoint("lab", "lab_criteria", "xosc.criterion"))
        module = sys.modules["lab_criteria"]
    kind = CriterionKind("OddTest", "1", "odd", {}, False, module.odd)
    monkeypatch.setattr("runner.judging.criteria.criterion._of_plugins", lambda: {"oddtest": kind})
    with pytest.raises(
        UsageError, match=rf"the criterion OddTest \(lab_criteria\) failed: {reason}"
    ):
        runner.run(CUT_IN, sut=None, world="kinematic", max_time=1.0, fail_if=("OddTest",))


def test_an_error_below_the_code_of_a_plug_in_is_told_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = "def holds():\n    return [].nearest\n\n\ndef calls(other):\n    return other()\n"
    (tmp_path / "lab_conditions.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("schemas.common.errors._plugins", {})
    module = load(EntryPoint("lab", "lab_conditions", "xosc.condition"))
    told = "the plug-in 'lab' of xosc.condition (lab_conditions, package unknown) failed"

    def ours() -> None:
        raise KeyError("speed")

    for act, line in ((module.holds, 2), (lambda: module.calls(ours), 6)):
        with pytest.raises((AttributeError, KeyError)) as failed:
            act()
        message, code = describe(failed.value)
        assert message.startswith(told) and message.endswith(f"lab_conditions.py:{line})")
        assert code == ExitCode.USAGE
    with pytest.raises(KeyError) as failed:
        ours()
    assert describe(failed.value) == ("internal error: KeyError: 'speed'", ExitCode.INTERNAL)


def test_an_element_of_a_plug_in_is_never_told_to_be_ignored(
    tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Refusing(EntityCondition):
        """A condition that refuses its element."""

        @classmethod
        def from_xml(cls, node: Node, context: Context) -> Refusing:
            raise node.invalid("value=-1 must be greater than 0")

        def holds(self, entity: Entity, run: Instant) -> bool:
            return False

        def describe(self, entity: Entity, run: Instant) -> str:
            return ""

    condition.load()
    monkeypatch.setitem(condition.classes, "AcmeLaneCondition", Refusing)
    scenario = ROOT / "xosc_toolchain" / "templates" / "lane.xosc"
    answer = command("xosc-run", scenario, "--world", "kinematic", "--road", "auto")
    assert answer.code == 3 and "value=-1 must be greater than 0" in answer.err
    assert "NOT executed" not in answer.err


def test_a_misspelt_target_of_a_plug_in_is_guessed(
    site: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(site)
    monkeypatch.chdir(tmp_path)
    answer = command("xosc-export", CUT_IN, "--to", "lab_kid", "--out", tmp_path / "out")
    assert answer.code == 2 and "did you mean 'lab_kit'?" in answer.err


def test_a_command_ends_with_one_line_where_a_plug_in_fails(tmp_path: Path) -> None:
    declare(tmp_path / "site", "bad", {"xosc.measure": {"bad": "bad.measures"}})
    (tmp_path / "work").mkdir()
    run = (
        "-m",
        "runner.xosc_run",
        CUT_IN,
        "--world",
        "kinematic",
        "--max-time",
        "1",
        "--out",
        "out",
    )
    done = call(tmp_path / "site", tmp_path / "work", *run)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(
        "xosc-run: the plug-in 'bad' of xosc.measure (bad.measures, package bad) can't be imported"
    )


def test_the_template_is_written_once(command: Command, tmp_path: Path) -> None:
    new = ("xosc", "new", "plugin")
    answer = command(*new, "acme", "--out", tmp_path)
    assert answer.code == 0 and str(tmp_path / "acme" / "pyproject.toml") in answer.out
    assert {path.name for path in (tmp_path / "acme" / "acme").iterdir()} == {
        "__init__.py",
        "measure.py",
        "export.py",
    }
    assert command(*new, "acme", "--out", tmp_path).code == 2
    assert command(*new, "not-a-name", "--out", tmp_path).code == 2
    assert "--kind KIND" in command(*new, "--help").out
    elsewhere = command("xosc", "new", "scenario", tmp_path / "mine")
    assert elsewhere.code == 2 and "--out is the folder" in elsewhere.err
    refused = command(*new, "other", "--kind", "mesure", "--out", tmp_path)
    assert refused.code == 2 and "measure" in refused.err
    assert tuple(KINDS) == EXTENSIONS
    strange = command(*new, "other", "--kind", "rule", "--out", tmp_path)
    assert strange.code == 2 and f"'rule'; kinds: {', '.join(KINDS)}" in strange.err


def test_metadata_in_the_working_folder_is_none_of_a_package(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(site)
    monkeypatch.chdir(tmp_path)
    assert "lab_kit" in installed("xosc.measure")
    monkeypatch.chdir(site)
    assert "lab_kit" not in installed("xosc.measure")
