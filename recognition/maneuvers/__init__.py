"""Manoeuvres and their parameters: names and ranges, what estimates the values in recordings, what writes them as scenarios.

`parameters` is the table. `estimation` has the one definition of begin and end, gap and speeds. `units` cuts recordings into
units for densities, `events` gives the manoeuvre of a recognised event for catalogues, `scenario` writes triggers and actions.
"""
