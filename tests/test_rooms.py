"""Rooms say what is in them, and commands load few modules."""

from __future__ import annotations

import ast
import re
import subprocess
import sys

import pytest

from tests.test_architecture import FLOORS, ROOMS, ROOT, entries_of


@pytest.mark.parametrize("package", ROOMS)
def test_every_room_lists_its_entries_with_an_example(package: str) -> None:
    rooms = [path.parent for path in sorted((ROOT / package).glob("*/__init__.py"))]
    missing = {}
    for room in rooms:
        text = ast.get_docstring(ast.parse((room / "__init__.py").read_text("utf-8"))) or ""
        listed = set(re.findall(r"^- `(\w+)`: \S", text, re.MULTILINE))
        missing[room.name] = set(entries_of(room)) ^ listed | set() if "Example::" in text else {""}
    assert {room: names for room, names in missing.items() if names} == {}


REACH = {"schemas.xosc_check": 51, "runner.xosc_run": 156}
"""Modules, without packages, that a command has loaded when it has done its
work, a tenth more than measured on 2026-11-28
"""
WORK = {
    "schemas.xosc_check": ["xosc/library/simple_cut_in.xosc"],
    "runner.xosc_run": [
        "xosc/library/simple_cut_in.xosc",
        "--quiet",
        "--timestep",
        "0.05",
        "--sut",
        "cas",
    ],
}
WITHOUT_PLUGINS = "--untrusted"
"""Packages of plug-ins that are installed here load whatever they need"""


def loaded_by(command: str) -> dict[str, bool]:
    """Names of the modules that a command has loaded when it has done its work,
    and whether each is a package.
    """
    program = (
        "import atexit, runpy, sys\n"
        "found = lambda: {name: hasattr(module, '__path__') for name, module in "
        "sys.modules.items()}\n"
        "atexit.register(lambda: print(found()))\n"
        f"sys.argv = {[command, *WORK[command], WITHOUT_PLUGINS]}\n"
        f"runpy.run_module({command!r}, run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    found: dict[str, bool] = ast.literal_eval(done.stdout.splitlines()[-1])
    return found


NEEDED = {
    "schemas.xosc_check": {"lxml", "typer", "xmlschema"},
    "runner.xosc_run": {"lxml", "numpy", "typer"},
}
"""Packages from outside that a command needs for its work, with those that they load themselves"""
OWN = {"annotated_doc", "cython_runtime", "elementpath", "shellingham", "rich", "pygments",
    "markdown_it", "mdurl",
       "xosc_toolchain"}  # fmt: skip
"""Those; pydantic, by which typer reads values, is a third of a start and not among them: see
`schemas.common.terminal.options.PlainValues`"""


@pytest.mark.parametrize("command", REACH)
def test_commands_load_few_modules_and_no_package_that_they_do_not_need(command: str) -> None:
    found = loaded_by(command)
    ours = [
        name for name, package in found.items() if name.partition(".")[0] in FLOORS and not package
    ]
    assert 0 < len(ours) <= REACH[command]
    tops = {name.partition(".")[0] for name in found}
    outside = {name for name in tops if not name.startswith("_")} - sys.stdlib_module_names
    assert outside - set(FLOORS) - OWN <= NEEDED[command]
