"""Smoothing of recorded tracks: one possible motion for each, within the limits of what moves."""
