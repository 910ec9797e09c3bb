"""Failure rate of a system in traffic."""
