"""Criticality of encounters: measures, RSS, relations over time; plain numpy."""
