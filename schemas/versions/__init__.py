"""Versions of the standards: the schema of each, official or made from the one before by its differences."""
