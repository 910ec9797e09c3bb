"""MCSG: the policy, its environment, and the search from coarse to fine."""
