"""Load and compile a scenario file, so that it can be run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from runner.interpreter.compiler import Scenario, compile_scenario
from runner.interpreter.ego import find_ego
from runner.settings import RunSettings

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from xosc.resolve import Argument


@dataclass(frozen=True, eq=False)
class Compiled:
    """A scenario file compiled with certain parameter values.

    Args:
        scenario: what the file was compiled to.
        parameters: the values that it was given.
    """

    scenario: Scenario
    parameters: Mapping[str, Argument]

    def ego(self, name: str | None = None) -> Entity | None:
        """The ego: the entity of that name, or else found by `runner.interpreter.ego.find_ego`."""
        return find_ego(self.scenario, name)


def compile_file(scenario: str | PathLike[str], parameters: Mapping[str, Argument] | None, settings: RunSettings) -> Compiled:
    """Load, resolve and compile a scenario file; arguments and errors as in `runner.run`."""
    import xosc
    from runner.interpreter.roads import load_roads

    document = xosc.resolve(
        xosc.load(Path(scenario)),
        parameters,
        enforce_constraints=settings.enforce_constraints,
        strict=settings.strict,
        catalog_path=settings.catalog_path,
    )
    network, assumed = load_roads(document, settings)
    document = replace(document, remarks=(*document.remarks, *assumed))
    return Compiled(compile_scenario(document, network, strict=settings.strict), dict(parameters or {}))
