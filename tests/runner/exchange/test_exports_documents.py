"""The matrix of documents: each target declares the fate of each field, and what
it keeps is read back.

Each field is exported in a scenario of its own: a target may refuse one.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

import xosc
from runner.exchange.exports import TARGETS, ExportTarget
from runner.exchange.exports.exporting import export_documents
from schemas.common import fates
from tests.runner.document_case import FIELDS, written
from xosc.exports import DOCUMENT_FIELDS
from xosc.exports.draft import Folder

OF_DOCUMENTS = [target for target in TARGETS.values() if not target.of_run]
UNREAD = "scenario_runner does not read it"


def test_each_field_has_a_case_and_a_fate_in_each_target() -> None:
    assert FIELDS.keys() == DOCUMENT_FIELDS.keys()
    for target in OF_DOCUMENTS:
        declared = import_module(target.module).FATES[target.name]
        assert fates.undeclared(DOCUMENT_FIELDS, declared) == [], target.name


@pytest.mark.slow
@pytest.mark.parametrize("target", OF_DOCUMENTS, ids=lambda target: target.name)
def test_fields_are_read_back_as_declared(target: ExportTarget, tmp_path: Path) -> None:
    declared = import_module(target.module).FATES[target.name]
    for name, field in FIELDS.items():
        fate, folder = declared[name], tmp_path / name.replace(" ", "_")
        source = written(folder, field)
        (outcome,) = export_documents([source], target, Folder(folder / "out"))
        assert outcome.exit_code == 4 if fate.text.startswith("refused") else outcome.exit_code == 0
        if outcome.exit_code or fate.text.startswith(UNREAD):
            continue
        (path,) = (folder / "out").rglob("*.xosc")
        same = field.read(xosc.load(path).root) == field.read(xosc.load(source).root)
        assert same is (fate.outcome == fates.KEPT), (name, outcome.remarks)
