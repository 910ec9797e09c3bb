"""Base of all commands: shared options, and the files that arguments mean."""
