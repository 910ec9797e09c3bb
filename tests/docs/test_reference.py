"""The reference says what the code says, and every public name has something to say."""

from __future__ import annotations

import importlib.util
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer

from runner.judging.measures import measure
from schemas.common.errors import UsageError
from tests.xosc_toolchain.test_plugin import declare

ROOT = Path(__file__).parents[2]


def loaded() -> ModuleType:
    """`docs/generate.py`, which no package holds."""
    spec = importlib.util.spec_from_file_location("docs_generate", ROOT / "docs" / "generate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


generate = loaded()


def test_pages_are_what_make_docs_writes() -> None:
    pages = generate.pages()
    assert set(pages) == set(generate.REFERENCE.glob("*.md"))
    stale = [path.name for path, text in pages.items() if path.read_text(encoding="utf-8") != text]
    assert not stale, "run make docs"


def test_measures_of_packages_that_are_installed_beside_are_on_no_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = generate.measures_page()
    declare(tmp_path, "beside", {"xosc.measure": {"beside": "beside.absent"}})
    monkeypatch.syspath_prepend(tmp_path)
    measure._of_plugins.cache_clear()
    with pytest.raises(UsageError, match=r"beside\.absent"):
        measure.measures()
    assert generate.measures_page() == page


def test_tables_of_fields_and_formats_are_what_make_docs_writes() -> None:
    stale = [
        path.name
        for path, text in generate.matrices().items()
        if path.read_text(encoding="utf-8") != text
    ]
    assert not stale, "run make docs"


def undocumented(path: str) -> Iterator[str]:
    """Public names of a module, and of its classes, without a docstring."""
    module = import_module(path)
    for name in generate.public(module):
        value = getattr(module, name)
        if not generate.documentation(module, name, value):
            yield f"{path}.{name}"
        if inspect.isclass(value):
            yield from (
                f"{path}.{name}.{member}"
                for member, each in generate.members(value)
                if not inspect.getdoc(each)
            )


def test_public_names_are_documented() -> None:
    assert [name for path in generate.MODULES for name in undocumented(path)] == []


def test_every_package_that_names_what_is_public_is_in_the_reference() -> None:
    packages = {path.partition(".")[0] for path in generate.MODULES}
    naming = {
        ".".join(file.parent.relative_to(ROOT).parts)
        for package in packages
        for file in (ROOT / package).rglob("__init__.py")
        if "__all__ = " in file.read_text(encoding="utf-8")
    }
    assert naming <= set(generate.MODULES)


def options() -> dict[str, set[str]]:
    """Names of the options of every command and subcommand; what
    `xosc-recognize` takes by itself is for `catalogue`.
    """
    found: dict[str, set[str]] = {}
    for name, app in generate.apps():
        if name == generate.UMBRELLA:
            continue  # has no options but those of the others
        command = typer.main.get_command(app)
        found[name] = _options(command)
        for inner, subcommand in getattr(command, "commands", {}).items():
            found[f"{name} {inner}"] = _options(subcommand)
    found["xosc-recognize"] |= found["xosc-recognize catalogue"]
    return found


def _options(command: Any) -> set[str]:
    return {"--help", "--help-all"} | {
        option
        for parameter in command.params
        for option in (*parameter.opts, *parameter.secondary_opts)
    }


def test_pages_name_options_that_there_are() -> None:
    known = options()
    calls = re.compile(rf"({'|'.join(sorted(known, key=len, reverse=True))})(?![\w-])([^`|;&#\n]*)")
    pages = [
        page
        for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        if page.parent != generate.REFERENCE
    ]
    wrong = [
        (page.name, command, option)
        for page in pages
        for command, rest in calls.findall(page.read_text(encoding="utf-8").replace("\\\n", " "))
        for option in re.findall(r"(?<![\w-])--?[a-zA-Z][\w-]*", rest)
        if option not in known[command]
    ]
    assert wrong == []
