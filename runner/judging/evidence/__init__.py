"""Evidence that a run tested something: rows, least values, and counting."""
