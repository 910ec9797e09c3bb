"""Commands of `xosc-recognize` that are no module of their own elsewhere."""
