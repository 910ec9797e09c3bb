"""The kinds of repairs, one module each, in the order of their names."""
