"""A manoeuvre scenario played for thousands of points at once, without a simulator: cheap, and measured against SUMO."""
