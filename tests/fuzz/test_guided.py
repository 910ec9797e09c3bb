"""Targets of the fuzzing guided by coverage: their first inputs, and bytes of no
meaning, are no defects.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.guided import TARGETS, seeds


@pytest.mark.parametrize("target", TARGETS)
def test_a_target_takes_its_first_inputs(target: str, tmp_path: Path) -> None:
    test, inputs = TARGETS[target](tmp_path), seeds(target)
    assert len(inputs) >= 10
    for data in (*inputs[:2], inputs[0][:-30], b"", b"\x00\xff<a/>"):
        test(data)
