"""Framework of all packages: errors and remarks, storage, limits on untrusted files, command lines, code found by its name."""
