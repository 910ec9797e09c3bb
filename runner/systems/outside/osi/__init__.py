"""Messages of ASAM OSI for one moment, which the bridge, FMUs and exports fill.

Modules:

- `lanes`: lanes and lane boundaries of a road network
- `messages`: objects, lamps, frame, version and time

Example::

    Lanes(network, lanelets(network).values(), 0).fill(ground_truth, None)
"""
