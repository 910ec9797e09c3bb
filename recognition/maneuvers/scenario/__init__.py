"""Manoeuvres as scenarios: declarations of the parameters, trigger, actions, and where participants start."""
