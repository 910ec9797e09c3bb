"""Baselines and ablations of MCSG, one file each, all on one problem and one budget of simulator
calls."""
