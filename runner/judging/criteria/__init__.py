"""Criteria of a scenario: conditions that its ego has to meet for the run to pass.

OpenSCENARIO has no element for them. CARLA's scenario_runner reads them from stop triggers: a
condition called `criteria_CollisionTest` that holds a ParameterCondition is no condition but the
demand that its CollisionTest passes. This package does the same (`declared`), judges them over the
recording of the finished run (`judge`), and has one function for each criterion (`kinds`).
docs/carla.md lists them with what differs from scenario_runner.
"""
