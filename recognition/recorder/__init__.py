"""Recordings of our own: SUMO's traffic on our maps, written as highD and INTERACTION recordings; see `record` and `SITES`."""

from recognition.recorder.recorder import record
from recognition.recorder.sites import SITES, Site

__all__ = ["SITES", "Site", "record"]
