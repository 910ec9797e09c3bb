"""Judgement of runs: criticality measures, criteria, verdicts, assessment by protocols."""
