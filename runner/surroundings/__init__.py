"""Surroundings of the entities: weather and time of day, traffic signals."""
