"""The search methods that `xosc-generate` offers: one module each."""
