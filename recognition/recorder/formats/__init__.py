"""Recordings of our own in the formats of public data sets."""
