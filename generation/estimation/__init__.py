"""Failure rate of a system in traffic.

Modules:

- `estimate`: probability of a failure under the density
- `probability`: probabilities of failure from weighted draws with control variates

Example::

    xosc-generate logical.xosc --out edges --estimate
"""
