"""The methods of a study in the order of its tables: those of `xosc-generate`, the baselines, the
ablations of MCSG."""

from __future__ import annotations

from generation.search.methods import methods_of, offered

ABLATIONS = methods_of("studies.generation.ablations")
METHODS = {**offered(), **methods_of("studies.generation.baselines"), **ABLATIONS}
TRAJECTORIES = frozenset({"no-maneuver"})
"""Methods that search trajectories (`studies.generation.knots`), not manoeuvres."""
