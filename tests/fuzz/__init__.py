"""Fuzzing: changes of files by what their formats allow, the commands and
readers that get them, what counts as a defect.
"""
