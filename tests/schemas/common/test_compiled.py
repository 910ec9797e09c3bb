"""Compiled modules: `--version` says them, and the build finds its modules."""

from __future__ import annotations

import ast
from importlib import metadata
from pathlib import Path

import pytest

from schemas.common.packages import compiled

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(("pure", "expected"), [("true", False), ("false", True)])
def test_a_wheel_of_a_platform_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pure: str, expected: bool
) -> None:
    folder = tmp_path / "xosc_toolchain-0.1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: xosc-toolchain\nVersion: 0.1.0\n"
    )
    (folder / "WHEEL").write_text(f"Wheel-Version: 1.0\nRoot-Is-Purelib: {pure}\n")
    installed = metadata.Distribution.at(folder)
    monkeypatch.setattr(metadata, "distribution", lambda name: installed)
    assert compiled() is expected


def test_compiled_tuples_name_types_that_are_imported_at_run_time() -> None:
    """mypyc evaluates the fields of a NamedTuple: a name under TYPE_CHECKING ends the import."""
    hook = ast.parse((ROOT / "hatch_build.py").read_text(encoding="utf-8"))
    (modules,) = (
        ast.literal_eval(node.value)
        for node in hook.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "MODULES"
    )
    assert len(modules) > 20
    for module in modules:
        tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
        typing_only = {
            alias.name
            for block in tree.body
            if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
            for statement in block.body
            if isinstance(statement, ast.ImportFrom)
            for alias in statement.names
        }
        for tuples in ast.walk(tree):
            if not isinstance(tuples, ast.ClassDef) or "NamedTuple" not in map(
                ast.unparse, tuples.bases
            ):
                continue
            for field in tuples.body:
                if isinstance(field, ast.AnnAssign):
                    names = {n.id for n in ast.walk(field.annotation) if isinstance(n, ast.Name)}
                    assert not names & typing_only, f"{module}: {tuples.name}"
