"""Failure rate of a system in traffic.

Modules:

- `bound`: draws in arrays until a bound on unknown failures holds, or a failure stands against it
- `estimate`: probability of a failure under the density
- `probability`: probabilities of failure from weighted draws with control variates

Example::

    xosc-generate logical.xosc --out edges --estimate
"""
