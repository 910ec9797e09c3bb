"""Limits on untrusted files: no code is run, no other file is reached, time and memory are bounded."""
