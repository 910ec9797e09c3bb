"""Checking files: the document as rules see it, the registry of rules, problems and reports."""
