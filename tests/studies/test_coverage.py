"""The coverage page, the registries and the official XSD say the same, and each
element has a conformance scenario.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from runner.engine.compile import registry
from schemas.versions.registry import schema_for
from studies import coverage

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "tests" / "conformance" / "scenarios"
FAMILIES = (registry.action, registry.condition, registry.position)


def all_rows() -> list[coverage.CoverageRow]:
    root = coverage.schema_root()
    found = [row for family in coverage.FAMILIES for row in coverage.rows(root, family)]
    return found + [
        row for type_name in coverage.OTHERS for row in coverage.other_rows(root, type_name)
    ]


def test_every_element_is_executed_or_refused_with_a_reason() -> None:
    rows = all_rows()
    assert len(rows) > 90
    assert [row.name for row in rows if row.status not in ("executed", "refused")] == []
    assert [row.name for row in rows if not row.note] == []
    assert len({row.name for row in rows}) == len(rows)


def test_nothing_is_registered_that_no_version_of_the_standard_knows() -> None:
    schemas = [schema_for("OpenSCENARIO", (1, minor)) for minor in range(5)]
    roots = [schema.tree().getroot() for schema in schemas if schema is not None]
    known = {
        str(element.get("name"))
        for root in roots
        for element in root.iter("{http://www.w3.org/2001/XMLSchema}element")
    }
    for family in FAMILIES:
        family.load()
        names = {name.rpartition("/")[2] for name in (*family.classes, *family.refused)}
        assert names <= known, family.family


def test_the_page_is_up_to_date() -> None:
    page = ROOT / "docs" / "coverage.md"
    assert page.read_text(encoding="utf-8") == coverage.markdown(), "run `make docs`"


def test_esmini_is_compared_by_elements_that_exist() -> None:
    assert coverage.ESMINI.keys() <= {row.name for row in all_rows()}


def test_every_addition_of_1_4_has_a_note() -> None:
    assert set(coverage.NEW_IN_1_4) == set(coverage.new_parts())


def test_other_notes_name_elements_of_the_xsd() -> None:
    root = coverage.schema_root()
    for type_name, notes in coverage.OTHERS.items():
        assert set(notes) == {row.name for row in coverage.other_rows(root, type_name)}


def registered() -> list[str]:
    for family in FAMILIES:
        family.load()
    return sorted({name for family in FAMILIES for name in family.classes})


@pytest.mark.parametrize("name", registered())
def test_every_executed_element_has_a_conformance_scenario(name: str) -> None:
    parent, _, element = name.rpartition("/")
    scenario = SCENARIOS / f"{parent.removesuffix('Action')}{element}.xosc"
    assert scenario.is_file()
    assert f"<{element}" in scenario.read_text(encoding="utf-8")


def test_a_new_module_of_a_family_is_all_that_a_new_element_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "new_family"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from runner.engine.compile.registry import Registry\nfamily = "
        "Registry('action', __name__)\n",
        encoding="utf-8",
    )
    (package / "coast.py").write_text(
        "from new_family import family\n@family('CoastAction')\nclass CoastAction: ...\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    family = import_module("new_family").family
    assert family.classes == {}
    family.load()
    assert family.classes.keys() == {"CoastAction"}
