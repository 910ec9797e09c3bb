"""The methods that TRFE is compared with, one module each, named after its paper.

A module of `open_set` or `clustering` with a `TITLE`, the name of its row in the report, is a
method: `METHOD`, made of a seed.
"""
