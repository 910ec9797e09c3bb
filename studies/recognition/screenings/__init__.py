"""Screenings that TRFE's own is compared with, one module each, found by being here.

A module says `TITLE`, the name of its row in the report, `PLAIN_VOTES`, whether it judges the votes
of trees that see features alone, and `SCREENING`, which makes it of a δ and a seed.
"""
