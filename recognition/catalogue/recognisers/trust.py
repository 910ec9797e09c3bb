"""Whether a model's labels may sort a catalogue: by what the model states of sites that it was not trained on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from schemas.errors import InvalidFile, reason

AGREE, WRONG = 0.75, 0.10
"""Least share of rules' events that a model gives the rules' class, and greatest share that gets another one or none"""
_WEIGHTS, _ABOUT, _FIELD = "model.safetensors", "about", "unseen_sites"


class UnseenSites(NamedTuple):
    """How a model labels rules' events on sites that it was not trained on, the worst site of those measured.

    agree: share with the rules' class. wrong: share that is taken for another known class or for nothing; the rest is unknown.
    """

    agree: float
    wrong: float

    @property
    def sufficient(self) -> bool:
        """Whether catalogues may be sorted by such labels."""
        return self.agree >= AGREE and self.wrong <= WRONG

    def __str__(self) -> str:
        return f"{self.agree:.0%} get their class from the model and {self.wrong:.0%} another one or none"


def unseen_sites(folder: Path) -> UnseenSites | None:
    """What the model in a folder states of sites not seen: `unseen_sites` in its metadata; None where it states nothing.

    Raises:
        InvalidFile: there is no model, or what it states is no pair of shares.
    """
    from safetensors import SafetensorError, safe_open

    path = folder / _WEIGHTS
    try:
        with safe_open(path, "numpy") as file:
            stated = json.loads((file.metadata() or {}).get(_ABOUT, "{}")).get(_FIELD)
        if stated is None:
            return None
        found = UnseenSites(float(stated["agree"]), float(stated["wrong"]))
    except (OSError, SafetensorError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidFile(f"{_FIELD} can't be read from this model: {reason(error)}", path=path) from None
    if not all(0.0 <= share <= 1.0 for share in found):
        raise InvalidFile(f"{_FIELD} of this model holds shares from 0 to 1, not {found.agree:g} and {found.wrong:g}", path=path)
    return found


def objection(stated: UnseenSites | None) -> str | None:
    """Why a model with such a statement must not sort a catalogue; None where it may."""
    needed = f"at least {AGREE:.0%} and at most {WRONG:.0%} are required"
    if stated is None:
        return f"the model does not state how many of the rules' events on sites not seen get their class, or another ({needed})"
    return None if stated.sufficient else f"of the rules' events on sites not seen, {stated} ({needed})"
