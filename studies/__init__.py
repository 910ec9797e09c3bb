"""Experiments with the packages, outside the wheel: baselines, ablations, comparisons; no package
imports them."""
