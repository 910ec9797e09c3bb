"""How likely manoeuvre parameters are: one contract (`base.Density`), a file in `models` for each density."""
