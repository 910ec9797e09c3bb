"""Framework of all packages: errors and remarks, storage, limits on untrusted files, command lines,
code found by its name.

Modules:

- `array_types`: names for numpy's arrays of numbers, of any shape; docstrings give the shapes
- `errors`: the exceptions that a user of the toolchain sees, each one clear line
- `fates`: of the fields of a model in a format: kept, changed or lost
- `packages`: public names on first use, extras, kinds in folders
- `plugins`: kinds that installed packages bring by entry points
- `policy`: of a command on reading, loading and resources: one per process
- `remarks`: what was assumed so that a file could be used which breaks its standard
- `storage`: reading files that may be anything, writing them whole or not at all
- `terminal`: options, help, progress, errors, text that no terminal obeys
- `xml`: the only XML parser of the toolchain: no document types, no entities, no network

Example::

    storage.read_bytes(path)  # within the limits of the command's policy
"""
