"""What surrounds the participants: weather and time of day, traffic signals."""
