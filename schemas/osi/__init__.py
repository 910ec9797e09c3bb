"""OSI traces: reading them, and the rules that they are checked by."""
