"""Rules of `xosc-check` for OpenDRIVE by family, those that take the exact geometry of roads among them."""
