"""Training of the models that ship: windows, splits, the command, the card."""

from typing import Literal

Unit = Literal["recording", "vehicle"]
"""Unit that is never divided between training and test."""
