"""MCSG without a part of it: one module each."""
