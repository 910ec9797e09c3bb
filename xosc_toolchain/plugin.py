"""Templates that `xosc new` writes: packages that extend the toolchain, projects, scenarios and
variations."""

from __future__ import annotations

import keyword
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from runner.exchange.exports import TARGETS
from runner.exchange.exports.exporting import export_documents
from runner.view.explore import NUMBER, WHOLE, Explored, ExploredParameter
from schemas.common.errors import UsageError, guess, nearest
from schemas.common.storage import keep, writing
from schemas.common.terminal.files import LIBRARY, shipped
from schemas.common.terminal.files import named as file_of
from xosc.distributions import (
    Deterministic,
    DeterministicSingleParameterDistribution,
    DistributionSet,
    ParameterValueDistribution,
    write_distribution,
)
from xosc.document import load, to_bytes
from xosc.exports.draft import Folder
from xosc.writing.files import FileHeader
from xosc_toolchain.settings import write_settings

# packages that extend the toolchain: copies of the templates -------------------------------------

_TEMPLATES = Path(__file__).with_name("templates")
_NAMED = "acme"
"""Name in templates that stands for the package's"""


class _Kind(NamedTuple):
    """Kind of extension that a package may bring.

    Attributes:
        group: of its entry points.
        entry: the entry point's value, behind the package's name.
        files: templates beside its module and the test.
    """

    group: str
    entry: str
    files: tuple[str, ...] = ()


KINDS = {
    "action": _Kind("xosc.action", "action", ("coast.xosc",)),
    "condition": _Kind("xosc.condition", "condition", ("lane.xosc",)),
    "measure": _Kind("xosc.measure", "measure"),
    "criterion": _Kind("xosc.criterion", "criterion"),
    "export": _Kind("xosc.export", "export"),
    "dataset": _Kind("xosc.dataset", "dataset"),
    "system": _Kind("xosc.sut", "system:Acme"),
}
"""Kinds by the name of their templates"""
_PROJECT = """\
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "{name}"
version = "0.1.0"
requires-python = ">=3.11"
dependencies = ["xosc-toolchain"]
"""


def write_plugin(name: str, kinds: Sequence[str], folder: Path) -> list[Path]:
    """Write a package with an example of each kind and its test, to be installed by pip; the files.

    Args:
        name: of the package. kinds: some of `KINDS`.

    Raises:
        UsageError: the name is none of a package, there is something of that name already, or
            there is no such kind.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise UsageError(
            f"{name!r} is no name of a package: small letters, digits and _ "
            "are; --out is the folder"
        )
    for kind in kinds:
        if kind not in KINDS:
            known = f"kinds: {', '.join(KINDS)}"
            raise UsageError(f"there is no kind {kind!r}; {guess(kind, KINDS)}{known}")
    root = folder / name
    if root.exists():
        raise UsageError("there is something of this name already", path=root)
    with writing("the package", root):
        return [
            _kept(
                root / path.replace(_NAMED, name),
                text.replace("Acme", _camel(name)).replace(_NAMED, name),
            )
            for path, text in _package(list(dict.fromkeys(kinds)))
        ]


def _package(kinds: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Paths and texts of a package, `acme` in both."""
    project = _PROJECT.format(name=_NAMED)
    for kind in kinds:
        group, entry, _ = KINDS[kind]
        project += f'\n[project.entry-points."{group}"]\n{_NAMED} = "{_NAMED}.{entry}"\n'
    yield "pyproject.toml", project
    yield f"{_NAMED}/__init__.py", '"""Extensions of the scenario toolchain."""\n'
    for kind in kinds:
        yield f"{_NAMED}/{kind}.py", _text(f"{kind}.py")
        for file in (f"test_{kind}.py", *KINDS[kind].files):
            yield f"tests/{file}", _text(file)


def _text(template: str) -> str:
    return (_TEMPLATES / template).read_text("utf-8")


def _kept(file: Path, text: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    keep(text.encode(), file)
    return file


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


# scenarios, variations and projects: copies of shipped ones -------------------------------------

_STANDARD = "1.3"
"""Version of OpenSCENARIO of new files"""
_NAME = re.compile(r"[A-Za-z0-9][\w.-]*")
_NO_NAME = "{name!r} is no name: letters, digits, _, - and . are; --out is the folder"
_VARIED, _REACH = 2, 1.0 / 3.0
"""Parameters of a new variation of a scenario, and the share of the way to its limits at which a
value is varied: at the limits themselves a scenario is rarely meant"""


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
    """Write a scenario or variation file that begins as a shipped one, with its road and
    catalogues.

    Args:
        name: of the new file, without an ending.
        like: name of the shipped one.

    Raises:
        UsageError: the name is none of a file, or a file is in the way.
        InvalidFile: no such scenario is shipped.
    """
    if name in shipped() and name != like:
        told = f"{name!r} is the name of a shipped file: another name; --like {name} begins as that"
        raise UsageError(told)
    source = LIBRARY / f"{like}.xosc"
    if like not in shipped():
        source = file_of(Path(like))  # refuses it, with the most similar name
    return copy_scenario(source, name, folder)


def copy_scenario(source: Path, name: str, folder: Path) -> list[Path]:
    """Write a scenario or variation file under a new name, with its road and catalogues; the files,
    its own first.

    Errors as in `write_scenario`.
    """
    if not _NAME.fullmatch(name):
        raise UsageError(_NO_NAME.format(name=name))
    new = f"{name.removesuffix('.xosc')}.xosc"
    if (folder / new).exists():
        raise UsageError("this file is there already", path=folder / new)
    made = _Renaming(folder, source.name, new)
    for exported in export_documents([source], TARGETS[_STANDARD], made):
        if exported.exit_code:
            raise UsageError("; ".join(exported.remarks), path=source)
    return sorted(made.written, key=lambda path: path.name != new)


def declare(path: Path, values: Mapping[str, str]) -> None:
    """Give the parameters of a scenario file other values.

    Raises:
        UsageError: it declares no parameter of a name.
    """
    document = load(path)
    found = {
        declaration.get("name", ""): declaration
        for declaration in document.root.iterfind("ParameterDeclarations/ParameterDeclaration")
    }
    for name, value in values.items():
        if name not in found:
            raise UsageError(f"there is no parameter {name!r}; {nearest(name, found)}", path=path)
        found[name].set("value", value)
    if values:
        keep(to_bytes(document), path)


def write_variation(name: str, like: str, folder: Path) -> list[Path]:
    """Write a variation file: one that begins as another, with its scenario, or one of a scenario
    of the user, which stays where it is.

    Args:
        name: of the new file, without an ending.
        like: name of a shipped file, or path of one.

    Raises:
        UsageError: as in `write_scenario`; or no parameter of the scenario has limits.
        InvalidFile: there is no such file.
    """
    source = file_of(Path(like))
    if load(source).root.find("ParameterValueDistribution") is not None:
        return write_scenario(name, like, folder)
    own = folder / f"{name.removesuffix('.xosc')}.xosc"
    if own.exists():
        raise UsageError("this file is there already", path=own)
    if not _NAME.fullmatch(name):
        raise UsageError(_NO_NAME.format(name=name))
    varied = {
        parameter.name: _around(parameter)
        for parameter in Explored.of(source).parameters
        if parameter.limited and parameter.kind in (NUMBER, WHOLE)
    }
    if not varied:
        told = "no parameter has limits on both sides (ConstraintGroup), between which to vary it"
        raise UsageError(told, path=source)
    files = copy_scenario(source, source.stem, folder) if like in shipped() else [source]
    # More than two parameters would be thousands of runs: further ones are the user's choice.
    chosen = dict(islice(varied.items(), _VARIED))
    return [vary(files[0], chosen, own), *(files if like in shipped() else ())]


def _around(parameter: ExploredParameter) -> list[str]:
    """Value of a parameter between two others, on the way to its limits."""
    at = float(parameter.value)
    ends = (at + _REACH * (end - at) for end in (parameter.low, parameter.high))
    below, above = map(parameter.text, ends)
    return list(dict.fromkeys((below, parameter.value, above)))


def vary(scenario: Path, varied: Mapping[str, list[str]], path: Path | None = None) -> Path:
    """Write the variation file of a scenario, with each combination of values.

    Args:
        path: of the file; beside the scenario by default.
    """
    single = tuple(
        DeterministicSingleParameterDistribution(name, DistributionSet(tuple(texts)))
        for name, texts in varied.items()
    )
    path = path or scenario.with_name(f"{scenario.stem}_variation.xosc")
    date = datetime.fromisoformat(load(scenario).node.need("FileHeader").get("date"))
    header = FileHeader(f"Variations of {scenario.stem}", "xosc-toolchain", date)
    file = os.path.relpath(scenario.resolve(), path.parent.resolve())
    distribution = ParameterValueDistribution(Path(file).as_posix(), Deterministic(single))
    write_distribution(distribution, path, header)
    return path


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
