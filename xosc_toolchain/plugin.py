"""Templates that `xosc new` writes: packages that extend the toolchain, projects, scenarios and variations."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator
from pathlib import Path

from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from schemas.common.errors import UsageError
from schemas.common.storage import keep, writing
from schemas.common.terminal.files import LIBRARY, shipped
from schemas.common.terminal.files import named as file_of
from xosc.exports.draft import Folder
from xosc_toolchain.settings import write_settings

_PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "{name}"
version = "0.1.0"
requires-python = ">=3.11"
dependencies = ["xosc-toolchain"]

# Each group names modules; see docs/extending/plugin.md. Others: xosc.action, xosc.condition,
# xosc.position, xosc.dataset, and xosc.sut, which names classes.
[project.entry-points."xosc.measure"]
{name} = "{name}.measures"

[project.entry-points."xosc.export"]
{name}-speeds = "{name}.speeds"
"""
_PACKAGE = '"""Extensions of the scenario toolchain."""\n'
_MEASURES = '''\
"""Measures of runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.judging.measures.measure import RunMeasure, measure

if TYPE_CHECKING:
    from runner.judging.measures.criticality import Criticality

SHORT = 1.5
"""Threshold of the time to collision, s"""


@measure
class ShortTime(RunMeasure):
    """Time with a time to collision below the threshold."""

    name = "{name}_short_ttc"
    label = "Time exposed to a short time to collision"
    unit = "s"
    formula = f"time with time to collision < {{SHORT:g}} s"
    critical = "high"
    validity = "always"
    source = "this package"
    is_extreme = False

    def of(self, run: Criticality) -> float:
        short = run.ttc.valid & (run.ttc.value < SHORT)
        return float(run.time[1] - run.time[0]) * int(short.sum()) if len(run.time) > 1 else 0.0
'''
_SPEEDS = '''\
"""Target `{name}-speeds`: the speed of each participant at its last moment, m/s."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from xosc.exports.draft import Folder

TARGETS = {{"{name}-speeds": "JSON, last speed of each participant"}}


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write a file; the remarks on what it leaves out."""
    speeds = {{
        track.name: round(float(track.columns["speed"][-1]), 6)
        for track in result.recording.tracks.values()
    }}
    folder.write(f"{{name}}.json", (json.dumps(speeds) + "\\n").encode())
    return ["all but last speeds is left out"]
'''
_TEST = '''\
"""The measure and the target are found by name."""

import xosc_toolchain as xt


def test_the_measure_is_one_of_all() -> None:
    assert xt.measures()["{name}_short_ttc"].unit == "s"
'''
_FILES = {
    "pyproject.toml": _PROJECT,
    "{name}/__init__.py": _PACKAGE,
    "{name}/measures.py": _MEASURES,
    "{name}/speeds.py": _SPEEDS,
    "tests/test_{name}.py": _TEST,
}


def write_plugin(name: str, folder: Path) -> list[Path]:
    """Write a package with a measure and an export target; the files.

    Raises:
        UsageError: the name is none of a package, or there is something of that name already.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UsageError(f"{name!r} is no name of a package: small letters, digits and _ are")
    root = folder / name
    if root.exists():
        raise UsageError("there is something of this name already", path=root)
    written = []
    with writing("the package", root):
        for path, template in _FILES.items():
            file = root / path.format(name=name)
            file.parent.mkdir(parents=True, exist_ok=True)
            keep(template.format(name=name).encode(), file)
            written.append(file)
    return written


# scenarios, variations and projects: copies of shipped ones -------------------------------------

_STANDARD = "1.3"
"""Version of OpenSCENARIO of new files"""
_NAME = re.compile(r"[A-Za-z0-9][\w.-]*")


class _Renaming(Folder):
    """A folder in which one file gets another name.

    Args:
        path: the folder. old, new: names of the file.
    """

    def __init__(self, path: Path, old: str, new: str) -> None:
        super().__init__(path)
        self._old, self._new, self.written = old, new, list[Path]()

    def write(self, name: str, content: bytes) -> None:
        """Write a file; errors as of `Folder.write`."""
        name = self._new if name == self._old else name
        super().write(name, content)
        self.written.append(self.path / name)


def write_scenario(name: str, like: str, folder: Path) -> list[Path]:
    """Write a scenario or variation file that begins as a shipped one, with its road and catalogues.

    Args:
        name: of the new file, without an ending.
        like: name of the shipped one.

    Raises:
        UsageError: the name is none of a file, or a file is in the way.
        InvalidFile: no such scenario is shipped.
    """
    if not _NAME.fullmatch(name):
        raise UsageError(f"{name!r} is no name: letters, digits, _, - and . are")
    source, new = LIBRARY / f"{like}.xosc", f"{name.removesuffix('.xosc')}.xosc"
    if like not in shipped():
        source = file_of(Path(like))  # refuses it, with the most similar name
    if (folder / new).exists():
        raise UsageError("this file is there already", path=folder / new)
    made = _Renaming(folder, source.name, new)
    for exported in export_documents([source], TARGETS[_STANDARD], made):
        if exported.exit_code:
            raise UsageError("; ".join(exported.remarks), path=source)
    return sorted(made.written, key=lambda path: path.name != new)


def write_project(name: str, like: str, folder: Path) -> Iterator[Path]:
    """Write a folder with settings, a scenario and a variation of it; yield the files.

    Args:
        name: of the folder. like: name of the shipped variation that is in it.

    Raises:
        UsageError: there is something of that name, or a file can't be written.
    """
    root = folder / name
    if root.exists():
        raise UsageError("there is something of this name already", path=root)
    yield write_settings(root)
    yield from write_scenario(like, like, root / "scenarios")
