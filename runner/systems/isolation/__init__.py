"""Systems under test in processes of their own: the side of the run, that of the system, and the
messages between."""
