"""Inputs of the encoder: rasters and tokens of traffic windows, and the samples made of them."""
