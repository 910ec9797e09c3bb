"""Tables of recorded rows: reading and checking them, their order in time, rates of change, tracks."""
