"""Worlds that participants live in: the protocol, a kinematic world, SUMO."""
