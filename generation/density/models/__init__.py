"""Densities of recorded parameters: one module each."""
