"""Encoders by what they read."""

from __future__ import annotations

from collections.abc import Sequence

from recognition.encoder.config import Architecture, Sizes, TokenArchitecture
from recognition.encoder.grids import GridEncoder
from recognition.encoder.model import Encoder
from recognition.encoder.tokens import TokenEncoder
from recognition.grids import Grid
from recognition.tokens.config import Tokens
from recognition.training.views import View
from schemas.errors import UsageError


def untrained(architecture: Sizes, view: View, classes: Sequence[int] = ()) -> Encoder:
    """A new encoder of a view, with a head for these classes, if any.

    Raises:
        UsageError: the architecture is for another view.
    """
    if isinstance(view, Tokens) and isinstance(architecture, TokenArchitecture):
        made: Encoder = TokenEncoder(architecture, view)
    elif isinstance(view, Grid) and isinstance(architecture, Architecture):
        made = GridEncoder(architecture, view)
    else:
        raise UsageError(f"{type(architecture).__name__} is for no encoder of {type(view).__name__}")
    made.set_classes(classes)
    return made
