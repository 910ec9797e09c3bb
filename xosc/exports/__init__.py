"""Exports of documents: OpenSCENARIO in its versions, and profiles of other simulators' readers.

A target is a module with `export(source, target, folder)`; `runner.exports` registers them by name.
"""
