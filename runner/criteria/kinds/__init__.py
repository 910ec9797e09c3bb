"""The criteria, one module each: adding a module adds a criterion.

A module says in `CRITERION` what it judges, a literal with

- `name`: the name after `criteria_`,
- `unit`: of the value that it measures,
- `summary`: what has to hold,
- `parameters`: their defaults by name, in the order in which a scenario gives them; None where there is no default,
- `on_roads`: whether it needs a road network,

and holds `evaluate(drive, **parameters) -> Finding`.
"""
