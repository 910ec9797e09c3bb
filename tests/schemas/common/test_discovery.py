"""Kinds that register by being a module of a folder."""

import sys
import zipfile
from pathlib import Path

import pytest

from schemas.checks.registry import all_rules
from schemas.common import discovery

KIND = "SUMMARY = 'the {0}'\nLOADED = list(range(3))\ndef work():\n    return '{0}'\n"
FILES = {
    "__init__.py": "",
    "zebra.py": KIND.format("zebra"),
    "ant.py": KIND.format("ant"),
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
    discovery.names.cache_clear()
    discovery.described.cache_clear()
    return name


def test_names_are_sorted_and_nothing_is_imported(package: str) -> None:
    assert discovery.names(package) == ("ant", "cat", "helper", "zebra")
    assert not any(module.startswith(f"{package}.") for module in sys.modules)


def test_kinds_describe_themselves_without_being_imported(package: str) -> None:
    assert discovery.described(package, "SUMMARY") == {"ant": "the ant", "cat": ("the cat", 4), "zebra": "the zebra"}
    assert not any(module.startswith(f"{package}.") for module in sys.modules)


def test_a_description_is_a_literal(package: str) -> None:
    with pytest.raises(ValueError, match="malformed"):
        discovery.described(package, "LOADED")


def test_load_imports_every_module_and_hides_no_error(package: str) -> None:
    with pytest.raises(ModuleNotFoundError, match="does_not_exist"):
        discovery.load(package)
    assert sys.modules[f"{package}.ant"].work() == "ant"


def test_every_rule_module_is_loaded() -> None:
    all_rules()
    assert [module.__name__ for module in discovery.load("xosc.rules")] == [
        f"xosc.rules.{name}" for name in discovery.names("xosc.rules")
    ]
    assert {rule.check.__module__ for rule in all_rules()} <= set(sys.modules)
    assert len(all_rules()) > 40
