"""Rooms say what is in them, and commands load few modules."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_architecture import FLOORS, ROOMS, ROOT, entries_of

GOING = ("twin",)
"""Rooms that a later change takes away"""


@pytest.mark.parametrize("package", ROOMS)
def test_every_room_lists_its_entries_with_an_example(package: str) -> None:
    rooms = [path.parent for path in sorted((ROOT / package).glob("*/__init__.py"))]
    missing = {}
    for room in (room for room in rooms if room.name not in GOING):
        text = ast.get_docstring(ast.parse((room / "__init__.py").read_text("utf-8"))) or ""
        listed = set(re.findall(r"^- `(\w+)`: \S", text, re.MULTILINE))
        missing[room.name] = set(entries_of(room)) ^ listed | set() if "Example::" in text else {""}
    assert {room: names for room, names in missing.items() if names} == {}


REACH = {"schemas.xosc_check": 51, "runner.xosc_run": 156}
"""Modules, without packages, that a command has loaded when it has done its work, a tenth more than measured on 2026-11-28"""
WORK = {
    "schemas.xosc_check": ["xosc/library/simple_cut_in.xosc"],
    "runner.xosc_run": ["xosc/library/simple_cut_in.xosc", "--quiet"],
}


@pytest.mark.parametrize("command", REACH)
def test_commands_reach_few_modules(command: str, tmp_path: Path) -> None:
    program = (
        "import atexit, runpy, sys\n"
        f"tops = {tuple(FLOORS)}\n"
        "ours = lambda name, module: name.partition('.')[0] in tops and not hasattr(module, '__path__')\n"
        "atexit.register(lambda: print(sum(ours(*each) for each in sys.modules.items())))\n"
        f"sys.argv = {[command, *WORK[command]]}\n"
        f"runpy.run_module({command!r}, run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert 0 < int(done.stdout.split()[-1]) <= REACH[command]
