"""Writing of scenarios: files by manoeuvres, tags, other versions of the standard."""
