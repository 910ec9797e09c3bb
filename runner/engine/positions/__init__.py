"""Positions: one class per position kind of the standard, each resolved to a `Placement` when it is
asked for.

World, road and lane positions are the same whenever they are asked for; they are resolved, and
checked against the road network, when the scenario is compiled. The others depend on where entities
are, and say what is wrong when they are asked for.
"""
