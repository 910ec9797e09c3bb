"""Whether a model's labels may sort a catalogue: by what the model states of sites that it was not trained on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from schemas.errors import InvalidFile, reason

AGREE, WRONG = 0.75, 0.10
"""Least share of rules' events that a model gives the rules' class, and greatest share to which it gives another known one"""
_WEIGHTS, _ABOUT, _FIELD = "model.safetensors", "about", "unseen_sites"


class UnseenSites(NamedTuple):
    """How a model labels rules' events on sites that it was not trained on, the worst site of those measured.

    agree: share with the rules' class. wrong: share with another known class; the rest is unknown to it.
    """

    agree: float
    wrong: float

    @property
    def sufficient(self) -> bool:
        """Whether catalogues may be sorted by such labels."""
        return self.agree >= AGREE and self.wrong <= WRONG

    def __str__(self) -> str:
        return f"{self.agree:.0%} agree and {self.wrong:.0%} are wrong"


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
    needed = f"at least {AGREE:.0%} agree and at most {WRONG:.0%} wrong"
    if stated is None:
        return f"the model does not state how it labels sites not seen ({needed} are required)"
    return None if stated.sufficient else f"on sites not seen, {stated} of the model's labels ({needed} are required)"
