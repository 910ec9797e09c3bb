"""What a search found as one page, and what is new in it against a search of another version of the system."""
