"""Runs for other tools, and traces of others."""
