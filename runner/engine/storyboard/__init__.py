"""Storyboard and simulation: states of elements, triggers, steps of time."""
