"""The random forest of a model: its votes, the distances that its trees see, and the similarity of samples in it (RFAP)."""
