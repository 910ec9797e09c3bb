"""Manoeuvres and their parameters: names and ranges, what estimates the values in recordings, what
writes them as scenarios.

`parameters` is the table. `estimation` has the one definition of begin and end, gap and speeds.
`units` cuts recordings into units for densities, `events` gives that of a recognised event;
`storyboard` writes it as a scenario.
"""
