"""How likely manoeuvre parameters are: one file a model, one contract (`base.Density`), fitted by `fitting`."""
