"""Small OpenSCENARIO files for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

SCENARIO = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="{minor}" date="2024-05-31T12:00:00" description="test" author="test"/>
  <ParameterDeclarations>{parameters}</ParameterDeclarations>
  {declarations}
  <CatalogLocations>{locations}</CatalogLocations>
  <RoadNetwork>{road}</RoadNetwork>
  <Entities>{entities}</Entities>
  <Storyboard>{storyboard}</Storyboard>
</OpenSCENARIO>
"""
CATALOG = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="{minor}" date="2024-05-31T12:00:00" description="test" author="test"/>
  <Catalog name="{name}">{entries}</Catalog>
</OpenSCENARIO>
"""
PARTS = ("parameters", "declarations", "locations", "road", "entities", "storyboard")

Writer = Callable[..., Path]


@pytest.fixture
def scenario(tmp_path: Path) -> Writer:
    """Write a scenario:
    `scenario(minor=3, parameters="<ParameterDeclaration …/>", storyboard=…)`.
    """

    def write(name: str = "scenario.xosc", minor: int = 3, **parts: str) -> Path:
        path = tmp_path / name
        path.write_text(
            SCENARIO.format(minor=minor, **dict.fromkeys(PARTS, "") | parts), encoding="utf-8"
        )
        return path

    return write


@pytest.fixture
def catalog(tmp_path: Path) -> Writer:
    """Write a catalogue: `catalog("vehicles/cars.xosc", "<Vehicle …/>", name="Cars")`."""

    def write(file: str, entries: str, name: str = "Catalog", minor: int = 3) -> Path:
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(CATALOG.format(minor=minor, name=name, entries=entries), encoding="utf-8")
        return path

    return write
