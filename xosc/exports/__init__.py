"""Exports of documents: OpenSCENARIO in its versions, and profiles of other simulators' readers.

A module with a dict `TARGETS` and `export(source, target, folder, settings)` is found by
`runner.exchange.exports`.
"""
