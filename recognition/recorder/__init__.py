"""Recordings of our own: SUMO's traffic on our maps, written as highD and INTERACTION recordings; see `record` and `SITES`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from recognition.recorder.recorder import record as record
    from recognition.recorder.sites import SITES as SITES
    from recognition.recorder.sites import SimulatedSite as SimulatedSite

__all__ = ["SITES", "SimulatedSite", "record"]

__getattr__, __dir__ = public(
    __name__,
    {
        "SITES": "recognition.recorder.sites",
        "SimulatedSite": "recognition.recorder.sites",
        "record": "recognition.recorder.recorder",
    },
)
