"""MCSG and every method beside it on one problem, with equal simulator calls: results, tables and
figures.

`python -m studies.generation methods SCENARIO --out DIR`
"""
