"""Densities of manoeuvre parameters: one contract (`base.Density`), a file in `models` for each."""
