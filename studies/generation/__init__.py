"""Experiments on generation: baselines, ablations of MCSG, and what they are compared by.

`python -m studies.generation` runs them.
"""
