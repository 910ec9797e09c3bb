"""Rules of `xosc-check` for OpenDRIVE by family, with those on the exact geometry of roads."""
