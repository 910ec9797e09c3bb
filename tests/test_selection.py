"""Studies run where `-m` names them, and with no other expression."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("marks", "collected"),
    [("not slow", False), ("not study and not every", False), ("study", True)],
)
def test_studies_run_by_their_name_alone(marks: str, collected: bool) -> None:
    asked = ("--collect-only", "-p", "no:cacheprovider", "-m", marks)
    listed = subprocess.run(
        [sys.executable, "-m", "pytest", *asked, "tests/generation/loop/test_demo.py"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert ("test_the_demo_shows" in listed.stdout) == collected, listed.stdout
