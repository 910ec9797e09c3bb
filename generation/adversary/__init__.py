"""An adversary that acts within the episode: it drives as recorded drivers do who cut in, and as far from that as they go."""

NAME = "adversary"
"""Name of the method"""
