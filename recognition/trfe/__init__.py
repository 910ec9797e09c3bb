"""TRFE: features, votes, screening, the buffer, and discovery of new classes.

Modules:

- `config`: settings of TRFE, and its steps with the default of each
- `discovery`: of new classes among unknown windows
- `encoder`: the encoder: occupancy grids to feature vectors
- `forest`: random forests that vote on classes: votes, distances to neighbours as features
- `inputs`: rasters and tokens of traffic windows
- `storage`: TRFE models in a folder
- `training`: of the models that ship: settings, windows, splits, the command, the card
- `trfe`: recognise scenarios of known classes, set aside unknown ones

Example::

    xosc-recognize train recordings --out model
"""
