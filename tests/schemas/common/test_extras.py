"""Libraries of extras: a missing one is named with the line to type."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from schemas.common.packages import _EXTRAS, _WITHOUT, MissingExtra, missing, optional
from schemas.common.terminal.command_line import guarded
from tests.commands import Command
from tests.runner.files import scenario

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
DISTRIBUTIONS = {
    "sklearn": "scikit-learn",
    "osi3": "osi-python",
    "osi_utilities": "asam-osi-utilities",
}
BROUGHT_ALONG = {"google", "lz4", "mcap", "threadpoolctl", "zstandard"}
"""what these need themselves"""


def test_a_module_that_is_there() -> None:
    assert isinstance(optional("json.decoder"), ModuleType)


@pytest.mark.parametrize("library", _EXTRAS)
def test_a_missing_library_is_named_with_its_extra(
    library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        MissingExtra, match=rf'{library} is missing; type: pip install "xosc-toolchain\[\w+\]"; '
    ) as found:
        optional(f"{library}.part")
    assert f"[{_EXTRAS[library]}]" in str(found.value)
    assert str(found.value).partition("; without it: ")[2] == _WITHOUT[_EXTRAS[library]]


BLOCKED = """
import importlib.abc, sys

class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
from recognition.xosc_recognize import main
main()
"""


@pytest.mark.slow
def test_rules_label_without_the_extra_that_models_need(tmp_path: Path, command: Command) -> None:
    assert (
        command(
            "xosc-run",
            LIBRARY / "simple_cut_in.xosc",
            "--world",
            "kinematic",
            "--out",
            tmp_path / "runs",
        ).code
        == 0
    )
    program = BLOCKED.format(
        blocked={
            library for library, extra in _EXTRAS.items() if extra in ("recognition", "search")
        }
    )

    def recognized(*options: str) -> tuple[int, str]:
        call = [sys.executable, "-c", program, str(tmp_path / "runs"), *options]
        ended = subprocess.run(call, capture_output=True, text=True, check=False, cwd=tmp_path)
        return ended.returncode, ended.stderr.strip()

    code, said = recognized("--labels", "model", "--out", "by_model")
    assert (code, "--labels rules" in said) == (2, True), said
    assert recognized("--out", "by_rules")[0] == 0


@pytest.mark.parametrize(
    ("module", "library"),
    [("runner.view.gym.environment", "gymnasium"), ("recognition.TRFE", "threadpoolctl")],
)
def test_what_python_imports_says_so_too(module: str, library: str) -> None:
    package, _, name = module.rpartition(".")
    lines = f"import sys; sys.modules[{library!r}] = None; from {package} import {name}"
    ended = subprocess.run(
        [sys.executable, "-c", lines], capture_output=True, text=True, check=False
    )
    assert ended.stderr.splitlines()[-1].startswith(
        f"schemas.common.packages.MissingExtra: {library} is missing; type: pip install"
    )


def test_other_modules_that_are_missing_are_no_extras() -> None:
    with pytest.raises(ModuleNotFoundError):
        optional("no_such_library")
    assert missing(ModuleNotFoundError("No module named 'x'", name="x")) is None
    assert missing(ImportError("cannot import name 'y'")) is None


def test_extras_are_those_of_the_package() -> None:
    extras = PROJECT["optional-dependencies"]
    for library, extra in _EXTRAS.items():
        if library not in BROUGHT_ALONG:
            assert any(
                re.match(rf"{DISTRIBUTIONS.get(library, library)}\b", each)
                for each in extras[extra]
            ), library
    core = {re.split(r"[<>=]", each)[0] for each in PROJECT["dependencies"]}
    assert not core & {DISTRIBUTIONS.get(library, library) for library in _EXTRAS}
    (everything,) = extras["all"]
    # rtamt brings a library without a wheel: who wants it asks for it.
    assert set(re.findall(r"\w+", everything)) >= set(_EXTRAS.values()) - {"stl"}


@pytest.mark.parametrize(
    ("arguments", "library", "extra"),
    [
        (["--sut", "bridge"], "osi3", "osi"),
        (["--osi", "trace.osi"], "osi_utilities", "osi"),
        (["--ray", "local"], "ray", "ray"),
    ],
)
def test_a_command_says_what_to_type(
    arguments: list[str],
    library: str,
    extra: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: Command,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    for part in [each for each in sys.modules if each.startswith(f"{library}.")]:
        monkeypatch.delitem(sys.modules, part)
    answer = command("xosc-run", *arguments, scenario(tmp_path))
    assert answer.code in (2, 5)
    assert f'{library} is missing; type: pip install "xosc-toolchain[{extra}]"' in answer.err
    assert len(answer.err.splitlines()) == 1


def test_a_command_that_needs_a_whole_extra_names_that(capsys: pytest.CaptureFixture[str]) -> None:
    def app() -> None:
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    with pytest.raises(SystemExit) as end:
        guarded("xosc-generate", app, extra="study")
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith(
        'xosc-generate: torch is missing; type: pip install "xosc-toolchain[study]"; without it: '
    )


def test_the_search_needs_no_torch() -> None:
    extras = PROJECT["optional-dependencies"]
    assert extras["search"] == ["scikit-learn>=1.6"]
    program = BLOCKED.format(blocked={"torch", "safetensors"}).partition("from recog")[0]
    modules = "generation.loop.loop, generation.report.report, generation.search.methods.cover"
    subprocess.run([sys.executable, "-c", f"{program}import {modules}"], check=True)


def test_a_model_that_lacks_all_libraries_names_the_extra_with_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    for library in ("threadpoolctl", "safetensors", "torch"):
        monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, "recognition.catalogue.model", raising=False)
    answer = command("xosc-recognize", tmp_path, "--labels", "model", "--out", tmp_path / "out")
    assert answer.code == 2
    assert 'type: pip install "xosc-toolchain[recognition]"' in answer.err
