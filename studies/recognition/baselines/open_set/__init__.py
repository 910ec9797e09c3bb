"""Open-set methods on frozen features of the shared encoder, which reject by one rule
(`method.OpenSetMethod`)."""
