"""The interpreter: compiles a scenario, runs its storyboard, says how it ended.

Modules:

- `actions`: actions of the standard, one class each
- `compile`: elements to runtime objects by registries, with the contracts that these keep
- `conditions`: conditions of the standard, one class each
- `motion`: motion of entities along lanes, paths and routes within their dynamics
- `participants`: what a scenario declares about them, the state they are in
- `positions`: positions of the standard, one class each
- `storyboard`: states of elements, triggers, steps of time, the simulation
- `worlds`: what participants live in: the protocol, a kinematic world, SUMO

Example::

    runner.prepare("mine.xosc")  # compiled, to be run many times
"""
