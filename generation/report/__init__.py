"""Report of a search as one page, with its differences from a search of another version of the system."""
