"""CatalogLocations whose directories are elsewhere: `--catalog-path` finds them,
and the run is the same.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from schemas.common.errors import InvalidFile
from tests.conformance.support import changed, track

REPAIRS = Path(__file__).parent / "repairs"


def test_a_catalogue_that_is_elsewhere_is_found_by_the_catalogue_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XOSC_CATALOG_PATH", raising=False)
    moved = changed(REPAIRS / "sound.xosc", tmp_path)
    with pytest.raises(
        InvalidFile, match=r"changed\.xosc:\d+: CatalogReference: there is no catalogue 'Vehicles'"
    ):
        runner.run(moved, sut=None)
    found = runner.run(
        moved, sut=None, world="kinematic", catalog_path=(str(REPAIRS),), strict=True
    )
    there = runner.run(REPAIRS / "sound.xosc", sut=None, world="kinematic")
    assert track(found, "Ego")["speed"][-1] > 0.0
    assert all(
        (track(found, "Ego")[name] == column).all() for name, column in track(there, "Ego").items()
    )
