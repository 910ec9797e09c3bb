"""A search needs no torch: its extra brings none, and where it is broken nothing notices."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCENARIO = "xosc/library/cut_in_highway.xosc"


@pytest.mark.slow
def test_a_search_completes_where_torch_can_not_be_imported(tmp_path: Path) -> None:
    blocked = tmp_path / "blocked"
    blocked.mkdir()
    (blocked / "torch.py").write_text("raise ImportError('torch is blocked')\n", encoding="utf-8")
    command = [str(Path(sys.executable).with_name("xosc-generate")), SCENARIO, "--sut", "cas"]
    command += ["--budget", "12", "--pin", "Ego_Speed_mps=36", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(blocked)}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode in (0, 1) and "torch" not in done.stderr, done.stderr
    assert (tmp_path / "out" / "report.html").is_file()
