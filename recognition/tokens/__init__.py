"""Tokens: the ego and the others about it over time, in lane coordinates: what the encoder sees of a scene."""
