"""Training of the models that ship: windows, splits, the command, the card."""
