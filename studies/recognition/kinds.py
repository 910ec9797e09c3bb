"""Methods and screenings by name: what is compared registers by being a module of its folder."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from schemas.common import packages

OPEN_SET, CLUSTERING = (
    "studies.recognition.baselines.open_set",
    "studies.recognition.baselines.clustering",
)
SCREENINGS = "studies.recognition.screenings"


def titles(package: str) -> dict[str, str]:
    """Names of a folder's kinds, as experiments call them (`stae-kmeans`), with their titles."""
    return {
        name.replace("_", "-"): title
        for name, title in packages.described(package, "TITLE").items()
    }


def kind(package: str, name: str) -> ModuleType:
    """The module of a kind by its name in experiments."""
    return import_module(f"{package}.{name.replace('-', '_')}")
