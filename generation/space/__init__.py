"""The space that is searched: parameters of a logical scenario and how likely their values are.

Modules:

- `density`: densities of manoeuvre parameters: one contract (`base.Density`)
- `logical`: the logical scenarios of the library
- `recorded`: recorded parameters of a scenario: from a table of units
- `space`: search space: the parameters of a logical scenario as a box with a name on each

Example::

    Space.of("logical.xosc")  # a side for each parameter
"""
