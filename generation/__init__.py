"""MCSG: a space of manoeuvre parameters, how likely its points are, and the search for plausible ones that are critical."""
