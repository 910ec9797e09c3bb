"""The methods of a study in the order of its tables: those of `xosc-generate`, the baselines, the ablations of MCSG."""

from __future__ import annotations

from generation.search.method import methods_of, offered
from schemas.discovery import described

_ABLATIONS = "generation.study.ablations"
ABLATIONS = methods_of(_ABLATIONS)
METHODS = {**offered(), **methods_of("generation.study.baselines"), **ABLATIONS}
TRAJECTORIES = {module.replace("_", "-") for module, searched in described(_ABLATIONS, "TRAJECTORIES").items() if searched}
"""Those whose problem is that of trajectories (`generation.study.knots`), not that of manoeuvres."""
