"""Judgement of runs: criticality measures, criteria, verdicts, assessment by protocols.

Modules:

- `assessment`: assessment of batches by published test protocols: `xosc-run --assess PROFILE`
- `criteria`: criteria of a scenario: what its ego has to do, or must not do
- `evidence`: what a run shows of its scenario, counted
- `execution`: scenarios loaded and compiled, and runs of them: as a whole, or step by step
- `measures`: criticality of encounters: measures, RSS, relations over time; plain numpy
- `result`: result of a run
- `settings`: the settings of a run
- `verdict`: the verdict of a run, and causes for which it is inconclusive

Example::

    runner.run("mine.xosc").verdict
"""
