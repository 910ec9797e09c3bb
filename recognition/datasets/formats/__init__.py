"""Formats of data sets, one module (or package) each: whoever adds one adds a file here."""
