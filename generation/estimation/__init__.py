"""How often a system fails in traffic."""
