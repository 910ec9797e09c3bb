"""Participants: what a scenario declares about them, the state they are in, their boxes and
trailers."""
