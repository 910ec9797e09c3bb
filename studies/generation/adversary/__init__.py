"""An adversary that acts within the episode: it drives as recorded drivers do who cut in, and as
far from that as they go."""

OBJECTIVES = ("risk-field", "distance", "fuzzy")
"""Names of what shapes its reward (`studies.generation.adversary.shape`), the default one first"""
