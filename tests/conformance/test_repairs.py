"""Faults of documents that a run repairs: each is named by a check, played with a remark, and refused where that is asked for."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

import runner
from schemas import check
from schemas.errors import InvalidFile
from tests.conformance.support import track

HERE = Path(__file__).parent
BOM = "\ufeff"
DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'
HEADER = '  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="Conformance: what tests break and runs repair" author="xosc-toolchain"/>\n'  # noqa: E501
XML, VALID, TYPED = "xml.valid_xml_document", "xml.valid_schema", "parameters.parameter_declaration_parameter_type_inference"
VALUE, DIRECTORY = "expressions.expression_has_a_value", "reference_control.catalogs_referenced_by_directory"
ENTRY = "reference_control.catalog_reference_resolvability"


class Fault(NamedTuple):
    """A replacement in the sound scenario, the rule that it breaks, the line that is named, and the speed in the end (m/s)."""

    old: str
    new: str
    rule: str
    line: int
    speed: float = 7.0


def joined(value: str) -> str:
    """The declaration of the name, after those of its parts."""
    parts = {"First": "Eg", "Last": "o"}.items()
    declared = "".join(f'name="{name}" parameterType="string" value="{part}"/><ParameterDeclaration ' for name, part in parts)
    return f'{declared}name="Name" parameterType="string" value="{value}"'


FAULTS = {
    # values
    "text typed double": Fault('name="Name" parameterType="string"', 'name="Name" parameterType="double"', TYPED, 8),
    "number typed string": Fault('name="Count" parameterType="int"', 'name="Count" parameterType="string"', VALUE, 7),
    "boolean in capitals": Fault('value="false"', 'value="FALSE"', TYPED, 9),
    "integer with a fraction": Fault('value="2"', 'value="2.0"', TYPED, 7),
    "attribute in capitals": Fault('"$Triggering"', '"False"', VALID, 61),
    "dollar in a declared name": Fault('name="Half"', 'name="$Half"', "parameters.declared_name_is_a_name", 6),
    "declared twice": Fault(
        '<ParameterDeclaration name="Half"',
        '<ParameterDeclaration name="Speed" parameterType="double" value="20"/><ParameterDeclaration name="Half"',
        "parameters.declarations_are_unique",
        6,
        12.0,
    ),
    "assignment of what is not declared": Fault(
        'parameterRef="MaxSpeed"', 'parameterRef="TopSpeed"', "parameters.assigned_parameter_is_declared", 26
    ),
    "compared with a boolean in capitals": Fault(
        'SimulationTimeCondition rule="greaterThan" value="1"',
        'ParameterCondition parameterRef="Triggering" rule="equalTo" value="FALSE"',
        "parameters.value_is_of_the_declared_type",
        110,
        10.0,
    ),
    "texts in a sum": Fault('name="Name" parameterType="string" value="Ego"', joined("${$First + $Last}"), VALUE, 8),
    "texts of several expressions": Fault(
        'name="Name" parameterType="string" value="Ego"', joined("${$First}${$Last}"), "data_type.allowed_operators", 8
    ),
    # structure
    "byte-order mark twice": Fault(DECLARATION, BOM + BOM + DECLARATION, XML, 1),
    "XML declaration in the second line": Fault(DECLARATION, "\n" + DECLARATION, XML, 2),
    "document type": Fault(DECLARATION, DECLARATION.strip() + " <!DOCTYPE OpenSCENARIO>\n", XML, 1),
    "hyphens in a comment": Fault("  <Entities>", "  <!-- a -- b --><Entities>", XML, 22),
    "wrong revision": Fault('revMinor="3"', 'revMinor="0"', VALID, 3),
    "later revision": Fault('revMinor="3"', 'revMinor="9"', VALID, 3),
    "no revision": Fault(' revMajor="1" revMinor="3"', "", "xml.version_is_defined", 3),
    "no header": Fault(HEADER, "\n", "xml.fileheader_is_present", 2),
    "date without a time": Fault("T00:00:00", "", VALID, 3),
    "no delay": Fault(' conditionEdge="none" delay="0"', ' conditionEdge="none"', VALID, 92),
    "no edge": Fault('name="begin" conditionEdge="none"', 'name="begin"', VALID, 92),
    "no rule of entities": Fault(' triggeringEntitiesRule="any"', "", VALID, 94),
    "no value of a step": Fault(' dynamicsDimension="time" value="0"', ' dynamicsDimension="time"', VALID, 48),
    # catalogues
    "directory is a file": Fault('path="catalogs"', 'path="catalogs/vehicles.xosc"', DIRECTORY, 13),
    "directory is elsewhere": Fault('path="catalogs"', 'path="../library/catalogs"', DIRECTORY, 13),
    "catalogue by its file": Fault('catalogName="Vehicles"', 'catalogName="vehicles"', ENTRY, 24),
    "no such controller": Fault('entryName="driver"', 'entryName="pilot"', ENTRY, 30),
    "no catalogue of controllers": Fault('catalogName="Controllers"', 'catalogName="Pilots"', ENTRY, 30),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(HERE / "repairs", tmp_path / "repairs")
    shutil.copytree(HERE / "roads", tmp_path / "roads")
    return tmp_path / "repairs"


def run(scenario: Path, **options: object) -> runner.RunResult:
    return runner.run(scenario, **{"sut": None, "timestep": 0.05, "world": "kinematic", **options})


def test_the_sound_scenario_has_no_remark(folder: Path) -> None:
    assert check(folder / "sound.xosc") == []
    result = run(folder / "sound.xosc", strict=True)
    assert result.remarks == () and track(result, "Ego")["speed"][-1] == 7.0


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_repaired_with_a_remark_and_refused_if_strict(folder: Path, name: str) -> None:
    fault = FAULTS[name]
    text = (folder / "sound.xosc").read_text(encoding="utf-8")
    assert fault.old in text
    broken = folder / "broken.xosc"
    broken.write_text(text.replace(fault.old, fault.new, 1), encoding="utf-8")
    assert any(problem.rule.endswith(fault.rule) for problem in check(broken))
    result = run(broken)
    (remark,) = result.remarks
    assert remark.startswith(f"{broken}:{fault.line}: ") and remark.endswith(f":{fault.rule}]")
    assert track(result, "Ego")["speed"][-1] == fault.speed
    with pytest.raises(InvalidFile, match=fault.rule):
        run(broken, strict=True)
