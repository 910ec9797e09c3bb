"""TRFE: recordings of traffic become labelled, unknown and newly discovered scenario classes."""
