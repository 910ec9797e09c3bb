"""Oracles of verdicts: what must not pass, by construction."""
