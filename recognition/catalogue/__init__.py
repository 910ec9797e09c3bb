"""Catalogues of standard scenario files, made from recordings.

Modules:

- `detect`: classes found in a recording by rules or by a model
- `exposure`: time and distance that vehicles were observed
- `findings`: findings of many recordings by site and day, and scenarios on demand
- `model`: detection by a model, and what its card says of sites that it has not seen
- `pipeline`: recordings to a catalogue, and labels for the results of runs
- `recordings`: recordings of a catalogue: reading, checking and cutting one
- `whole`: a whole recording as one scenario that replays it
- `writing`: files of a catalogue: scenarios, index, page

Example::

    xosc-recognize recordings --out catalogue
"""
