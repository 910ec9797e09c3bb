"""Participants: declarations, states, boxes and trailers."""
