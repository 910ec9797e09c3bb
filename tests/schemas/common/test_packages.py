"""What the packages show to their users, and kinds that register by being a module of a folder."""

from __future__ import annotations

import sys
import zipfile
from importlib import import_module, metadata
from pathlib import Path

import pytest

from schemas.checks.registry import all_rules
from schemas.common import packages

PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation")


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_shows_its_names_its_version_and_that_it_is_typed(name):
    package = import_module(name)
    assert {*package.__all__, "__version__"} <= set(dir(package))
    assert all(getattr(package, public) is not None for public in package.__all__)
    assert package.__version__ == metadata.version("xosc-toolchain")
    assert (Path(str(package.__file__)).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing


@pytest.mark.parametrize("name", PACKAGES)
def test_no_module_imports_all_names_of_another(name):
    folder = Path(str(import_module(name).__file__)).parent
    assert [
        path for path in folder.rglob("*.py") if "import *" in path.read_text(encoding="utf-8")
    ] == []


# kinds ---------------------------------------------------------------------------------------

KIND = "SUMMARY = 'the {0}'\nLOADED = list(range(3))\ndef work():\n    return '{0}'\n"
FILES = {
    "__init__.py": "",
    "zebra.py": KIND.format("zebra"),
    "ant.py": KIND.format("ant"),
    "bee.py": '"""A bee.\n\nSUMMARY of it:\n"""\nSUMMARY = (\n    "the bee",\n)\n',
    "cat/__init__.py": "SUMMARY: tuple[str, int] = ('the cat', 4)\n",
    "helper.py": "import does_not_exist\n",
    "_hidden.py": KIND.format("hidden"),
    "notes.txt": "no module",
}


@pytest.fixture(params=("folder", "zip"))
def package(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = f"kinds_in_a_{request.param}"
    if request.param == "zip":
        root = tmp_path / "kinds.zip"
        with zipfile.ZipFile(root, "w") as archive:
            for file, text in FILES.items():
                archive.writestr(f"{name}/{file}", text)
    else:
        root = tmp_path
        for file, text in FILES.items():
            (root / name / file).parent.mkdir(parents=True, exist_ok=True)
            (root / name / file).write_text(text)
    monkeypatch.syspath_prepend(str(root))
    packages.names.cache_clear()
    packages.described.cache_clear()
    return name


def test_names_are_sorted_and_nothing_is_imported(package: str) -> None:
    assert packages.names(package) == ("ant", "bee", "cat", "helper", "zebra")
    assert not any(module.startswith(f"{package}.") for module in sys.modules)


def test_kinds_describe_themselves_without_being_imported(package: str) -> None:
    assert packages.described(package, "SUMMARY") == {
        "ant": "the ant",
        "bee": ("the bee",),
        "cat": ("the cat", 4),
        "zebra": "the zebra",
    }
    assert not any(module.startswith(f"{package}.") for module in sys.modules)


def test_a_description_is_a_literal(package: str) -> None:
    with pytest.raises(ValueError, match="malformed"):
        packages.described(package, "LOADED")


def test_load_imports_every_module_and_hides_no_error(package: str) -> None:
    with pytest.raises(ModuleNotFoundError, match="does_not_exist"):
        packages.load(package)
    assert sys.modules[f"{package}.ant"].work() == "ant"


def test_every_rule_module_is_loaded() -> None:
    all_rules()
    assert [module.__name__ for module in packages.load("xosc.rules")] == [
        f"xosc.rules.{name}" for name in packages.names("xosc.rules")
    ]
    assert {rule.check.__module__ for rule in all_rules()} <= set(sys.modules)
    assert len(all_rules()) > 40
