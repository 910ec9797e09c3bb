"""Formats of data sets, one module or package each, found by being here.

A format says

- `TITLE`: its name for people. `BY_CONTENT`: whether `claims` reads files that are not named in its
  own way; formats that tell theirs by name are asked first.
- `claims(path)`: whether a file is the main file of recordings of the format, by its name and first
  bytes.
- `sources(path, roads)`: the recordings of such a file, of which no more than the head is read.
  `roads` is the folder for roads that have to be made.
"""
