"""Planted failures: systems that fail in known foreseeable regions, and searches judged by the
regions that they find."""
