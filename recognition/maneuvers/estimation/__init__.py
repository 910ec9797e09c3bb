"""Estimating the parameters from recorded motion: when a lane change begins and ends, the gap, the speeds; and back."""
