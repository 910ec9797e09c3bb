"""How critical an encounter was: criticality measures, RSS, relations over time; plain numpy."""
