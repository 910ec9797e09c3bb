"""Recordings from ASAM OSI ground truth: tracks of a trace, and the roads that it has, names or
draws."""
