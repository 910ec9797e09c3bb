"""Recordings of our own: SUMO's traffic on our maps, written as highD and INTERACTION recordings;
see `record` and `SITES`.

Modules:

- `recorder`: records traffic, each recording a simulation of its own with its own seed
- `simulation`: SUMO simulation of the recorder
- `sites`: sites for recorded traffic with maps of their own
- `traffic`: recorded traffic: the fleet's vehicles and drivers, and the demand on each route

Example::

    xosc-recognize record recordings
"""

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
