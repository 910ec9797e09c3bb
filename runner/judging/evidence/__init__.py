"""Evidence that a run tested something: its rows, their least values, and what is counted."""
