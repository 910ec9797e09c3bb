"""Rules of `xosc-check` for OpenSCENARIO by family: a function each, entered under its uid by
`schemas.checks.registry.rule`.

Modules:

- `parameters`: parameters, variables and monitors are declared once, and where they are used
- `positions`: positions are on roads and lanes that exist
- `references`: entities, controllers, traffic signals
- `storyboard`: elements of the storyboard hold what they are there for
- `values`: values are of their type and obey their constraints; expressions have a value

Example::

    xosc-check --rules
"""
