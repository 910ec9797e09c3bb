"""The files of an export before they are written: what is refused on the way leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TypedDict

from schemas.catalogs import Folders
from schemas.common.remarks import Remark, Remarks
from xosc.distributions.space import Selection
from xosc.document import Document
from xosc.exports.folder import Folder
from xosc.exports.starts import Geometry
from xosc.node import Node
from xosc.roads import RoadFile, find_roads, logic_file

Roads = Callable[[Node], RoadFile | None]
"""The road network of a scenario, by its root; None where it has none; errors as in `xosc.roads.find_roads`."""


def roads_in(*folders: str | PathLike[str]) -> Roads:
    """The road networks that scenarios name, looked for in these folders too."""

    def roads(scenario: Node) -> RoadFile | None:
        logic = logic_file(scenario)
        return find_roads(logic, folders) if logic is not None else None

    return roads


Locate = Callable[[Document], Geometry]
"""Puts a worked-out scenario on its roads; errors as in a run."""


class Resolving(TypedDict):
    """Settings for resolving documents, as in `xosc.resolve`."""

    enforce_constraints: bool
    strict: bool
    catalog_path: Folders


@dataclass(frozen=True)
class ExportSettings:
    """Settings of an export.

    Args:
        strict: refuse what is otherwise repaired, changed or left out with a remark.
        roads: where road networks are.
        locate: puts scenarios on their roads; None leaves out the changes that need it.
        catalog_path: folders in which directories of catalogues are looked for that are not where the scenario says.
        selection: parameter sets of distributions that are exported; where it leaves any out, a scenario is written for each.
        enforce_constraints: refuse worked-out values that violate their constraint groups, and leave such sets of a
            distribution out.
    """

    strict: bool = False
    roads: Roads = field(default_factory=roads_in)
    locate: Locate | None = None
    catalog_path: Folders = ()
    selection: Selection = field(default_factory=Selection)
    enforce_constraints: bool = True

    @property
    def resolving(self) -> Resolving:
        """Of them, what `xosc.resolve` takes."""
        return {
            "enforce_constraints": self.enforce_constraints,
            "strict": self.strict,
            "catalog_path": self.catalog_path,
        }


DEFAULTS = ExportSettings()


class Draft:
    """Files by name, relative to an output folder, and what is to be said of them.

    Args:
        folder: it is written into.
        settings: of the export.
    """

    def __init__(self, folder: Folder, settings: ExportSettings) -> None:
        self.folder = folder
        self.settings = settings
        self._files: dict[str, bytes] = {}
        self._remarks: dict[str, None] = {}

    def copy(self) -> Draft:
        """The same so far, to go on with: what is added to it can be given up."""
        draft = Draft(self.folder, self.settings)
        draft.take(self)
        return draft

    def take(self, other: Draft) -> None:
        """Add what another one has."""
        self._files |= other._files
        self._remarks |= other._remarks

    def add(self, name: str, content: bytes) -> None:
        """Add a file."""
        self._files[name] = content

    def note(self, *remarks: str | Remark) -> None:
        """Add remarks, each once.

        Raises:
            InvalidFile: one is on a repair, and exports are strict.
        """
        Remarks(self.settings.strict).add(*(each for each in remarks if isinstance(each, Remark)))
        self._remarks.update(dict.fromkeys(map(str, remarks)))

    def write(self, *also: str) -> Sequence[str]:
        """Write the files, of which nothing is refused any more.

        Args:
            also: remarks that come first.

        Returns:
            All remarks.

        Raises:
            UsageError: a file is in the way, or can't be written.
        """
        for name, content in self._files.items():
            self.folder.write(name, content)
        return list(dict.fromkeys((*also, *self._remarks)))
