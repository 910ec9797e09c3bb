"""Experiments: protocols, baselines, ablations, agreement with the rules. No product code imports
this."""
