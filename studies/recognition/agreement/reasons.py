"""Reasons for which vehicles that pass a junction have no label there."""

from __future__ import annotations

import numpy as np

from recognition.labels.rules import crosses
from recognition.labels.scene import Scene


def reasons(scene: Scene) -> list[str]:
    """For each track, what keeps its first passage of a junction from a label, as far as one
    passage shows it."""
    passages, rules = scene.passages, scene.rules
    turn, crossed = np.degrees(np.abs(passages.turn)), crosses(scene)
    why = np.full(len(passages), "in the way of a stronger one", object)
    why[(turn < rules.straight) & ~crossed] = "straight, no crossing traffic"
    why[(turn >= rules.straight) & (turn < rules.turn[0])] = (
        f"turns {rules.straight:.0f} to {rules.turn[0]:.0f}° inside"
    )
    why[turn > rules.turn[1]] = f"turns more than {rules.turn[1]:.0f}°"
    why[np.isnan(turn)] = "too little of it recorded"
    why[~scene.complete[passages.row]] = "window not whole"
    why[passages.signalised & (not rules.signalised)] = "traffic lights"
    first = np.searchsorted(scene.track[passages.row], np.arange(len(scene.names)))
    there = np.append(scene.track[passages.row], -1)[first] == np.arange(len(scene.names))
    return [
        str(why[index]) if known else "no way through a junction"
        for index, known in zip(first.tolist(), there.tolist(), strict=True)
    ]
