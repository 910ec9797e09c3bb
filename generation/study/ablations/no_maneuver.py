"""Ablation No-Maneuver: MCSG on the knots of trajectories, which the study gives it in place of manoeuvre parameters."""

from __future__ import annotations

from generation.mcsg.search import search as search

METHOD = {"title": "No-Maneuver", "meaning": "MCSG on trajectories, without manoeuvre parameters", "realistic": True}
TRAJECTORIES = True
