"""Contracts between a run and its actions, conditions and positions."""
