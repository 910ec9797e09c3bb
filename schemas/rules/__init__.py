"""Semantic rules, one module each."""
