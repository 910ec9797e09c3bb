"""Experiments: MCSG beside other methods, baselines, ablations. No product code imports this."""
