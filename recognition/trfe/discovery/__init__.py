"""Discovery of new classes among unknown windows."""
