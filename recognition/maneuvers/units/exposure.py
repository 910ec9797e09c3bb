"""How much driving recordings have seen: without it, a share of manoeuvres is no rate per hour or per kilometre."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from recognition.maneuvers.estimation.motion import LaneMotion
from recognition.maneuvers.unit import Unit

_HOUR, _KILOMETRE, _DIGITS = 3600.0, 1000.0, 4


@dataclass(frozen=True)
class Exposure:
    """What all vehicles of a recording that may be an ego have driven, and the manoeuvres that happened meanwhile.

    Attributes:
        hours: of driving, summed over vehicles.
        kilometres: likewise.
        counts: units by kind, those whose parameters can't be estimated among them.
    """

    hours: float
    kilometres: float
    counts: Mapping[str, int]

    @classmethod
    def of(cls, motion: LaneMotion, units: Iterable[Unit]) -> Exposure:
        """That of one recording."""
        scene = motion.scene
        steps = np.where((np.diff(scene.track) == 0) & (np.diff(scene.frame) == 1), np.diff(scene.time), 0.0)
        steps[~scene.egos[scene.track[:-1]]] = 0.0
        ways = steps * np.abs(scene.speed[:-1])
        hours, kilometres = float(steps.sum()) / _HOUR, float(ways.sum()) / _KILOMETRE
        return cls(round(hours, _DIGITS), round(kilometres, _DIGITS), dict(Counter(unit.kind for unit in units)))

    @classmethod
    def total(cls, parts: Iterable[Exposure]) -> Exposure:
        """That of several recordings together."""
        listed = list(parts)
        counts = sum((Counter(each.counts) for each in listed), Counter[str]())
        return cls(sum(each.hours for each in listed), sum(each.kilometres for each in listed), dict(counts))


def to_bytes(exposure: Mapping[str, Exposure]) -> bytes:
    """Exposure by recording, for files."""
    return json.dumps({name: vars(each) for name, each in exposure.items()}, separators=(",", ":")).encode()


def from_bytes(content: bytes) -> dict[str, Exposure]:
    """What `to_bytes` made bytes of.

    Raises:
        ValueError: these are others.
    """
    try:
        return {
            name: Exposure(float(each["hours"]), float(each["kilometres"]), {kind: int(n) for kind, n in each["counts"].items()})
            for name, each in json.loads(content).items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"no exposure of recordings: {error!r}") from None
