"""The incremental open-world protocol: splits, rounds of new classes, every method beside TRFE,
tables and figures."""
