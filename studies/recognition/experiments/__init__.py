"""Experiments of the protocol: open-set recognition, clustering, the open world, sensitivity."""
