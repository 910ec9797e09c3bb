"""Trajectory-level parameters: positions of the cutting-in vehicle at a few times, instead of the
seven of its manoeuvre.

For the ablation No-Maneuver (METHOD §3). A trajectory is described by the scene's time and by knots
at even shares of it: how far the actor is ahead of where the ego would be if it kept its speed, and
how far to the left of the middle of the ego's lane. In between it follows natural cubic splines.
Recorded manoeuvres are described by knots too, and the manoeuvre nearest to a trajectory by the
seven, so that both are as plausible as the same recordings make them (`motion`); `scenario` is the
file that is run.
"""
